"""What a frame costs besides its time: sums of energy, two frames in flight, and what stands where there is neither."""

import math
import sys
from types import SimpleNamespace

import numpy as np
import pytest
import warp as wp
from helpers.devices import needs_gpu
from helpers.experiment_records import record_of, write_records
from helpers.tiny_runs import go, options, write_scene
from shadowbench.harness.frame.registry import make_method
from shadowbench.harness.frame.session import Session
from shadowbench.harness.results import tidy
from shadowbench.harness.results.costs import latencies
from shadowbench.harness.results.means import points
from shadowbench.harness.results.schema import read_records
from shadowbench.harness.runner.measuring import costs
from shadowbench.harness.runner.measuring.costs import MissingError, Used, above_idle, energy_counter, used
from shadowbench.harness.runner.planning.experiment import Entry
from shadowbench.harness.scene.catalogue import resolve
from shadowbench.harness.scene.prepared import prepare


class Card:
    """A card that draws ``watts``, whose counter steps every 0.1 s from 0.03 s on; each piece of work lasts 7 ms."""

    def __init__(self, watts: float):
        self.watts, self.now = watts, 0.0

    def work(self) -> None:
        self.now += 0.007

    def counter(self) -> float:
        return self.watts * (math.floor((self.now - 0.03) / 0.1) * 0.1 + 0.03)

    def clock(self) -> float:
        return self.now


def test_energy_is_taken_from_step_to_step_of_the_counter():
    card = Card(300.0)
    busy = used(card.counter, card.work, 0.95, card.clock)
    assert busy.watts == pytest.approx(300.0, rel=0.01)
    assert busy.calls * 0.007 == pytest.approx(busy.seconds)
    assert 0.95 <= busy.seconds <= 1.06


def test_energy_above_idle():
    busy, idle = Used(300.0, 1.0, 50), Used(50.0, 0.5, 9)
    assert above_idle(busy, idle, 4) == pytest.approx((300.0 - 100.0) / 200)
    with pytest.raises(MissingError, match="no more energy than while it was idle"):
        above_idle(Used(99.0, 1.0, 50), idle, 4)


def test_a_counter_that_stands_still_is_no_energy():
    card = Card(0.0)
    with pytest.raises(MissingError, match=r"did not move twice in 2\.5 s"):
        used(card.counter, card.work, 0.5, card.clock)
    assert card.now < 3.0


def test_what_is_missing_says_why(monkeypatch):
    with pytest.raises(MissingError, match=r"^it runs on a CPU: energy is counted on NVIDIA GPUs only$"):
        energy_counter(wp.get_device("cpu"))
    card = SimpleNamespace(is_cuda=True, uuid="GPU-none")
    monkeypatch.setitem(sys.modules, "pynvml", None)
    with pytest.raises(MissingError, match=r"^no package nvidia-ml-py; .*pip install nvidia-ml-py$"):
        energy_counter(card)

    def refuse(*_):
        raise fake.NVMLError("Not Supported")

    fake = SimpleNamespace(nvmlInit=lambda: None, nvmlDeviceGetHandleByUUID=lambda uuid: uuid, NVMLError=ValueError,
                           nvmlDeviceGetTotalEnergyConsumption=refuse)  # fmt: skip
    monkeypatch.setitem(sys.modules, "pynvml", fake)
    with pytest.raises(MissingError, match=r"^NVML does not count the energy of this card \(Not Supported\)$"):
        energy_counter(card)
    fake.nvmlDeviceGetTotalEnergyConsumption = lambda card: 1500
    assert energy_counter(card)() == 1.5


def test_a_run_that_asks_for_costs_says_what_it_could_not_measure(tmp_path):
    """On a CPU there is neither; tests of rays and the quality of the tree are counted there too."""
    scene = write_scene(tmp_path / "t.obj")
    found = go(options(tmp_path / "with", [scene], [Entry("bvh2", {}, "tree")], costs_s=0.1, rounds=2))
    assert found["tree"].status == "ok", found["tree"].reason
    (record,) = read_records(tmp_path / "with")
    assert [sorted(one.missing) for one in record.frames[0].costs] == [["energy", "in flight"]] * 2
    row = points(tidy(tmp_path / "with")).iloc[0]
    assert row["energy_missing"].startswith("it runs on a CPU")
    assert row["flight_missing"] == "it runs on a CPU, which has no streams"
    assert math.isnan(row["energy_mj"])
    assert math.isnan(row["pair_ms"])
    assert row["primary_tests"] > 0
    assert row["sah_cost"] == pytest.approx(1.2 * row["expected_nodes"] + row["expected_tests"])


def test_costs_of_records(tmp_path):
    """Medians over the rounds; records without them, as older ones are, have none."""
    old, new = record_of("costs", Entry("bvh2", {}, "old")), record_of("costs", Entry("bvh2", {}, "new"))
    new["frames"][0] |= {
        "costs": [{"energy_j": j, "idle_w": 80.0, "alone_ms": 2.0, "pair_ms": 1.5, "missing": {}} for j in (0.1, 0.3, 0.2)],
        "counters": {"primary tests a hundred rays": 250, "shadow tests": 700}, "memory_bytes": 41960,
    }  # fmt: skip
    table = tidy(write_records(tmp_path, [old, new])).set_index("label")
    columns = ["energy_mj", "idle_w", "alone_ms", "pair_ms", "primary_tests", "shadow_tests"]
    assert table.loc["new", columns].tolist() == pytest.approx([200.0, 80.0, 2.0, 1.5, 2.5, 7.0])
    assert table.loc["new", "bytes_per_ray"] == 41960 / (64 * 64 + 100)
    assert table.loc["old", columns].isna().all()
    assert table["energy_missing"].tolist() == ["", ""]


def test_percentiles_count_every_frame_equally():
    """However many samples each has; one frame has none."""
    frames = [SimpleNamespace(total_ms=[float(k)] * (1 + 3 * (k % 2))) for k in range(1, 101)]
    assert list(latencies(frames).values()) == [50.0, 95.0, 99.0]
    assert np.isnan(list(latencies(frames[:1]).values())).all()


@pytest.mark.gpu
@needs_gpu
def test_energy_and_two_frames_in_flight_on_a_gpu():
    device = "cuda:0"
    prepared = prepare(resolve("balls-30k"))
    pair = [Session(make_method("bvh2"), prepared, 256, 256, device) for _ in range(2)]
    moment = prepared.moment(0, 256, 256)
    right = [session.answers(moment)["triangle"] for session in pair]
    alone, both = (costs.in_flight(pair[:n], 0.2, 0.2) for n in (1, 2))
    assert 0 < both < 2 * alone
    for session, triangles in zip(pair, right, strict=True):
        np.testing.assert_array_equal(session.frame.answers.to_host()["triangle"], triangles)
    pytest.importorskip("pynvml", reason="the package nvidia-ml-py is not installed")
    try:
        energy_counter(wp.get_device(device))
    except MissingError as error:
        pytest.skip(str(error))
    found = costs.energy(pair[0], alone, 0.5)
    assert 0 < found["energy_j"] < 1
    assert 5 < found["idle_w"] < 1000
