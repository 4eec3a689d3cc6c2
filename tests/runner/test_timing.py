"""Samples of a frame: how many, why no more, that passes add up, and what is counted beside them."""

import gc
import subprocess
import sys
import time
from dataclasses import dataclass
from types import SimpleNamespace
from typing import ClassVar

import pytest
import warp as wp
from helpers.small_scenes import make_scene
from shadowbench.harness.frame.method import SimpleMethod
from shadowbench.harness.frame.session import Session
from shadowbench.harness.results.throttled import throttled
from shadowbench.harness.runner.machine import environment
from shadowbench.harness.runner.measuring import measured_point, timing
from shadowbench.harness.runner.measuring.measured_point import spread_frames
from shadowbench.harness.runner.measuring.memory import Memory
from shadowbench.harness.runner.measuring.timing import Sampling, compile_clock, sample_frame, stop_reason
from shadowbench.harness.runner.planning.planned_point import orders


@wp.func_native("""
#if defined(__CUDA_ARCH__)
unsigned long long now, began;
asm volatile("mov.u64 %0, %globaltimer;" : "=l"(began));
do asm volatile("mov.u64 %0, %globaltimer;" : "=l"(now)); while (now - began < nanoseconds);
#endif
""")
def _until(nanoseconds: wp.uint64): ...


@wp.kernel(enable_backward=False)
def _wait(nanoseconds: wp.uint64):
    _until(nanoseconds)


@dataclass(frozen=True)
class Work:
    """Length of build, trace and shadow pass, in units of 2.5 microseconds."""

    build: int = 200
    trace: int = 600
    shadow: int = 400


class Spinner(SimpleMethod):
    """Passes of known relative lengths; counts its launches."""

    name: ClassVar[str] = "spinner"
    Trace = Work

    def prepare(self, frame):
        self.launches = []

    def _turn(self, what, frame):
        """A wait: a core or a GPU that has other work makes it no longer."""
        self.launches.append(what)
        units = getattr(self.trace, what)
        if frame.device == "cpu":
            time.sleep(units / 4e5)
        else:
            wp.launch(_wait, dim=1, inputs=[2500 * units], device=frame.device)

    def build_structure(self, frame):
        self._turn("build", frame)

    def trace_primary(self, frame):
        self._turn("trace", frame)

    def trace_shadow(self, frame, light):
        self._turn("shadow", frame)


def triangle():
    return make_scene([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]], [(2.0, 2.0, 2.0)], (0.0, 0.0, 3.0))


def session(method=None, device="cpu"):
    prepared = triangle()
    made = Session(method or Spinner(), prepared, 4, 4, device)
    made.load(prepared.moment(0, 4, 4))
    made.run_complete()
    return made


@pytest.mark.parametrize("capturable", [True, False])
def test_counts_of_samples(device, capturable):
    method = Spinner()
    method.capturable = capturable
    measured = sample_frame(session(method, device), Sampling(samples=5, most=5, stage_samples=3))
    assert len(measured.total_ms) == len(measured.wall_ms) == 5
    assert [(p["name"], p["part"]) for p in measured.passes] == [
        ("build", "build"),
        ("primary rays", "trace"),
        ("light 0: shadow rays", "shadow"),
    ]
    assert all(len(p["ms"]) == 3 for p in measured.passes)
    assert min(measured.total_ms) > 0
    assert measured.stopped_by == "samples"
    assert abs(measured.started - time.time()) < 60
    if device == "cpu" or capturable:
        assert measured.submitted_ms is None
    else:  # the part of the host is told apart where it launches pass by pass
        assert 0 < measured.submitted_ms < max(measured.wall_ms)


@pytest.mark.parametrize(("lasts", "frames"), [(0.001, timing.SUBMITTED), (2.0, 2), (100.0, 1)])
def test_frames_that_the_host_submits_ahead_of_the_device_stay_within_the_budget(lasts, frames, monkeypatch):
    """The host submits 20 frames of a second in no time, and then waits for them all."""
    done, now = [], time.perf_counter()
    monkeypatch.setattr(time, "perf_counter", lambda: now)
    card = SimpleNamespace(is_cuda=True)
    monkeypatch.setattr(timing.wp, "get_device", lambda _: card)
    monkeypatch.setattr(timing.wp, "synchronize_device", lambda _: None)
    monkeypatch.setattr(timing, "_whole_frames", lambda _: lambda count: [(1e3 * lasts, 1e3 * lasts)] * count)
    launched = SimpleNamespace(device="cuda:0", replays=False, passes=[], run=lambda: done.append(1))
    measured = sample_frame(launched, Sampling(samples=1, most=1, stage_samples=0, budget_s=16.0))
    assert measured.submitted_ms == 0.0
    assert len(done) == frames


def test_passes_of_a_captured_frame_that_has_too_many_are_not_timed_one_by_one(device, monkeypatch):
    """Their prefixes take a time that grows with the square of their number."""
    monkeypatch.setattr(timing, "MOST_PREFIXES", 2)
    measured = sample_frame(session(Spinner(), device), Sampling(samples=1, most=1, stage_samples=3))
    counts = [len(one["ms"]) for one in measured.passes]
    assert counts == ([3, 3, 3] if device == "cpu" else [0, 0, 0])
    assert len(measured.total_ms) == 1


@pytest.mark.parametrize("capturable", [True, False])
def test_passes_add_up_to_the_whole_frame(device, capturable, monkeypatch):
    if device == "cpu":  # a clock of its own: on a busy machine a sleep may last longer than it was asked to
        now = [time.perf_counter()]
        monkeypatch.setattr(time, "perf_counter", lambda: now[0])
        monkeypatch.setattr(time, "sleep", lambda seconds: now.__setitem__(0, now[0] + seconds))
    method = Spinner(trace=Work(2000, 6000, 4000))
    method.capturable = capturable
    measured = sample_frame(session(method, device), Sampling(samples=7, most=7, stage_samples=7))
    # The least of several samples is what a busy machine disturbs least.
    parts = [min(p["ms"]) for p in measured.passes]
    assert sum(parts) == pytest.approx(min(measured.total_ms), rel=0.15)
    assert parts[1] / parts[0] == pytest.approx(3.0, rel=0.3)
    assert parts[2] / parts[0] == pytest.approx(2.0, rel=0.3)


@pytest.mark.parametrize("capturable", [True, False])
@pytest.mark.parametrize(
    ("changed", "names"), [(set(), []), ({"light/0"}, ["light 0: shadow rays"])], ids=["nothing", "a light"]
)
def test_a_frame_in_part_is_sampled(changed, names, capturable, device):
    """Also one of no pass at all, which is an empty graph where frames are captured."""
    method = Spinner()
    method.capturable = capturable
    made = session(method, device)
    made.select(changed)
    measured = sample_frame(made, Sampling(samples=3, most=3, stage_samples=2))
    assert len(measured.total_ms) == 3
    assert [(p["name"], len(p["ms"])) for p in measured.passes] == [(name, 2) for name in names]


def test_whole_frames_and_passes_are_timed_apart():
    made = session()
    made.method.launches.clear()
    sample_frame(made, Sampling(samples=4, most=4, stage_samples=2))
    # One warm-up, four whole frames, two instrumented ones.
    assert made.method.launches == ["build", "trace", "shadow"] * 7


@pytest.mark.parametrize(
    ("times", "sampling", "in_time", "reason"),
    [
        ([1.0] * 5, Sampling(samples=5, most=5), True, "samples"),
        ([1.0] * 4, Sampling(samples=5, most=9), True, ""),
        ([1.0] * 4, Sampling(samples=5, most=9), False, "budget"),
        ([1.0, 2.0] * 5, Sampling(samples=10, most=40, deviation=0.01), True, ""),
        ([1.0, 1.001] * 5, Sampling(samples=10, most=40, deviation=0.01), True, "deviation"),
        ([1.0, 2.0] * 20, Sampling(samples=10, most=40, deviation=0.01), True, "most"),
        ([1.0], Sampling(samples=1, most=1, deviation=0.01), True, "most"),
    ],
)
def test_why_sampling_stops(times, sampling, in_time, reason):
    assert stop_reason(times, sampling, in_time) == reason


class Sleeper(Spinner):
    def build_structure(self, frame):
        time.sleep(0.02)


def test_a_round_has_spent_what_its_samples_took(monkeypatch):
    """Loading a frame and comparing its answers take no part of the budget."""
    prepared = triangle()
    moments, spec = {0: prepared.moment(0, 4, 4)}, {"device": "cpu", "runs": 2, "budget_s": 60.0}
    point = measured_point.MeasuredPoint(Spinner, prepared, moments, (4, 4), spec, None, lambda *answered: None)
    taken = [sample_frame(point.session, Sampling(samples=2, most=2, stage_samples=1))]
    monkeypatch.setattr(measured_point, "sample_frame", lambda *asked: taken[0])
    assert point.round(Sampling())["spent_s"] == taken[0].spent_s > 0.0


def test_the_budget_stops_a_slow_method_after_at_least_one_sample():
    measured = sample_frame(session(Sleeper()), Sampling(samples=1000, most=1000, stage_samples=1000, budget_s=0.1))
    assert measured.stopped_by == "budget"
    assert 1 <= len(measured.total_ms) < 10
    assert 1 <= len(measured.passes[0]["ms"]) < 10
    tiny = sample_frame(session(Sleeper()), Sampling(samples=5, most=5, budget_s=1e-9))
    assert len(tiny.total_ms) == 1
    assert tiny.stopped_by == "budget"


def test_no_garbage_is_collected_inside_samples():
    seen = []

    class Watcher(Spinner):
        def build_structure(self, frame):
            seen.append(gc.isenabled())

    made = session(Watcher())
    seen.clear()
    sample_frame(made, Sampling())
    assert seen
    assert not any(seen)
    assert gc.isenabled()


def test_a_compile_is_counted_and_the_clock_leaves_no_trace():
    before = type(wp.get_module(__name__)).load

    @wp.kernel(enable_backward=False, module="unique")
    def fresh(out: wp.array[wp.float32]):
        out[wp.tid()] = wp.float32(wp.static(time.time_ns() % 1000003))

    out = wp.zeros(1, dtype=wp.float32, device="cpu")
    with compile_clock() as clock:
        wp.launch(fresh, dim=1, inputs=[out], device="cpu")
    assert 0.0 < clock.seconds < 60.0
    compiled = clock.seconds
    with compile_clock() as clock:
        wp.launch(fresh, dim=1, inputs=[out], device="cpu")
    assert clock.seconds < compiled / 10
    assert type(wp.get_module(__name__)).load is before


def test_memory_counts_what_was_held_at_once():
    tracker = Memory()
    tracker.start()
    first = wp.zeros(1 << 18, dtype=wp.float32, device="cpu")
    second = wp.zeros(1 << 18, dtype=wp.float32, device="cpu")
    del first, second
    third = wp.zeros(1 << 10, dtype=wp.float32, device="cpu")
    tracker.pause()
    fourth = wp.zeros(1 << 22, dtype=wp.float32, device="cpu")
    assert 2 << 20 <= tracker.peak() < 3 << 20
    assert third.size < fourth.size


def test_peak_of_the_process_grows_with_what_it_holds():
    """In a process of its own: not every system lets the peak of a process that once was larger be reset."""
    code = (
        "import numpy as np\n"
        "from shadowbench.harness.runner.measuring import memory\n"
        "memory.reset_peak_resident()\n"
        "before = memory.peak_resident_bytes()\n"
        "block = np.ones(8 << 20)\n"
        "print(memory.peak_resident_bytes() - before, block.nbytes)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    growth, held = map(int, done.stdout.split())
    assert held // 2 < growth < 2 * held


def test_clock_state_of_a_cpu_has_no_gpu():
    state = environment.clock_state("cpu")
    assert state["gpu"] is None
    assert state["load"] >= 0


LIBRARY = SimpleNamespace(
    NVMLError=OSError, NVML_CLOCK_SM=1, NVML_CLOCK_MEM=2, NVML_TEMPERATURE_GPU=0,
    nvmlDeviceGetClockInfo=lambda card, kind: (None, 1200, 2619)[kind],
    nvmlDeviceGetPowerUsage=lambda card: 699123,
    nvmlDeviceGetTemperature=lambda card, kind: 41,
    nvmlDeviceGetCurrentClocksThrottleReasons=lambda card: 4,
    nvmlDeviceGetUtilizationRates=lambda card: SimpleNamespace(gpu=97),
)  # fmt: skip
"""NVML of a card that is slowed down by its power limit."""


def test_clocks_of_the_library_are_those_of_nvidia_smi(monkeypatch):
    """What is asked of the library reads like what nvidia-smi prints; where it refuses one, nvidia-smi is asked."""
    monkeypatch.setitem(sys.modules, "pynvml", LIBRARY)
    monkeypatch.setattr(environment, "card_of", str)
    monkeypatch.setattr(environment, "wp", SimpleNamespace(get_device=lambda name: SimpleNamespace(uuid="GPU-1")))
    monkeypatch.setattr(environment, "asked_of_driver", lambda *fields, device: [dict.fromkeys(fields, device)])
    state = environment.clock_state("cuda:0")
    values = ["1200", "2619", "699.123", "41", "0x4", "97"]
    assert state["gpu"] == dict(zip(environment.FIELDS, values, strict=True))
    assert throttled({"clock": state}, 1980.0) == "power limit"
    monkeypatch.setattr(LIBRARY, "nvmlDeviceGetUtilizationRates", refuse)
    assert environment.clock_state("cuda:0")["gpu"] == dict.fromkeys(environment.FIELDS, "GPU-1")


def refuse(card):
    raise LIBRARY.NVMLError("not supported")


def test_orders_are_balanced_random_and_repeatable():
    rows = orders(4, 8, seed=7)
    assert rows == orders(4, 8, seed=7)
    assert rows != orders(4, 8, seed=8)
    assert all(sorted(row) == [0, 1, 2, 3] for row in rows)
    for point in range(4):
        assert sorted(row.index(point) for row in rows) == [0, 0, 1, 1, 2, 2, 3, 3]
    assert orders(0, 2, seed=1) == [[], []]


@pytest.mark.parametrize(
    ("count", "wanted", "frames"), [(1, 3, [0]), (16, 3, [0, 8, 15]), (2, 5, [0, 1]), (16, 1, [8]), (21, 1, [10])]
)
def test_frames_are_spread_over_the_whole_length(count, wanted, frames):
    assert spread_frames(count, wanted) == frames
