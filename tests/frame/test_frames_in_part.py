"""A pass runs again only where something that it reads has changed, and not where nothing receives its light."""

from dataclasses import replace

import pytest
import warp as wp
from helpers.devices import needs_gpu
from helpers.effect_scenes import (
    BEHIND,
    EYE,
    FEW_CELLS,
    GIVEN,
    LAMPS,
    POINT,
    SIZE,
    SPOT,
    all_mirrors,
    launches,
    scene,
    session_of,
    session_or_skip,
)
from helpers.small_scenes import answers_in, assert_same
from shadowbench.harness.frame.registry import make_method, method_names
from shadowbench.harness.frame.schedule import capture, passes
from shadowbench.harness.frame.schedule.needed import live, stale, steps
from shadowbench.harness.frame.schedule.passes import BUILD_PARTS, Hints, Pass, joined
from shadowbench.harness.frame.session import Session
from shadowbench.harness.scene.scene import Camera, Spot


@pytest.mark.parametrize("label", LAMPS)
def test_nothing_moved_launches_nothing(label, monkeypatch):
    prepared = scene()
    session = session_of(label, prepared)
    session.answers(prepared.moment(0, *SIZE))
    session.select(set())
    assert not session.passes
    assert not launches(session, monkeypatch)


@pytest.mark.parametrize("loops", [True, False])
def test_a_loop_waits_for_all_that_runs_at_the_same_time(loops, monkeypatch):
    """A graph cannot capture it while another stream is open."""
    steps = []
    monkeypatch.setattr(capture, "_join", lambda running: steps.extend(work.name for work, _ in running))
    work = Pass("divide", "build", ("pairs",), ("tree",), lambda: steps.append("divide"), loops=loops)
    running = [(early(), None)]
    capture._launch_overlapping([work], "cpu", running, set())
    assert steps == (["aim", "divide"] if loops else ["divide"])
    assert bool(running) != loops  # nothing after a loop can wait for what was before it


@pytest.mark.parametrize("hints", [Hints(parallel=(0,)), Hints(early=True), Hints(overlap=True)])
def test_nothing_runs_at_the_same_time_as_a_loop(hints):
    with pytest.raises(ValueError, match="pass 'divide': nothing can run at the same time as a loop"):
        make("divide", "pairs", "tree", "build", loops=True, hints=hints)


@pytest.mark.gpu
@needs_gpu
@pytest.mark.parametrize(("name", "captured"), [("warp_bvh", False), ("uniform_grid", True)])
def test_on_a_gpu_only_what_is_captured_has_conditions(name, captured):
    """Outside a graph the host would wait for each of them."""
    session = Session(make_method(name, {}), scene((SPOT, BEHIND)), *SIZE, "cuda:0")
    assert session.replays == captured
    assert any(work.only_if is not None for work in session.all_passes) == captured


def builds(passes):
    """The passes that build structures."""
    return [work for work in passes if work.part in BUILD_PARTS]


def make(name, reads, writes, part="trace", **more):
    """A pass that must not be launched."""
    return Pass(name, part, tuple(reads.split()), tuple(writes.split()), lambda: 1 / 0, **more)


def parallel(*branch, reads="hits", writes="", **more):
    return make(f"light {branch}", reads, writes or f"bits/{branch}", hints=Hints(parallel=branch), **more)


def early(reads="points", **more):
    return make("aim", reads, "table", hints=Hints(early=True, **more))


CONDITIONS = [wp.zeros(1, dtype=wp.int32, device="cpu") for _ in range(2)]
READS = "pass 'aim' cannot run early: it reads what another pass of the frame writes"
USES = "pass 'aim' cannot run early: 'other', which runs at the same time, uses table"
WRITES = "cannot run concurrently with .*, which writes bits"
REFUSED = [
    ([make("camera", "points", "rays"), early("points rays")], READS),
    ([make("camera", "points", "rays"), early("points late"), make("light", "points", "late")], READS),
    ([make("other", "table", "bits"), early()], USES),
    ([make("other", "points", "table"), early()], USES),
    (
        [make("other", "points", "table", hints=Hints(early=True, parallel=(1,))), early(parallel=(0,))],
        "cannot run (early|concurrently).*table",
    ),
    *(
        ([parallel(*place, 0, writes="bits"), parallel(*place, 1, **given)], WRITES)
        for place in ((), (3,))
        for given in ({"reads": "bits"}, {"writes": "bits"}, {"writes": "bits", "adds": True})
    ),
    # With one condition they fork inside their conditional branch.
    ([parallel(i, writes="bits", only_if=CONDITIONS[0]) for i in range(2)], WRITES),
]


@pytest.mark.parametrize(("passes", "said"), REFUSED)
def test_what_cannot_run_at_the_same_time_is_refused_by_name_before_anything_is_launched(passes, said):
    with pytest.raises(ValueError, match=said):
        capture.capture_passes(passes, "cpu")


def test_passes_that_may_run_at_the_same_time():
    capture.refuse_shared([parallel(i, writes="bits", adds=True) for i in range(2)])
    capture.refuse_shared([parallel(0), parallel(1)])  # both only read the hits
    capture.refuse_shared([parallel(0, writes="bits"), parallel(0, reads="bits")])  # one after the other
    capture.refuse_shared([parallel(i, writes="bits", only_if=one) for i, one in enumerate(CONDITIONS)])  # likewise


def test_branches_fork_where_passes_are_neighbours():
    """What has no branch, or a condition, parts those before it from those after it."""
    given = [
        make("trace", "camera", "hits"),
        *(parallel(0), parallel(1), parallel(0, 0), parallel(0, 1)),
        make("shade", "hits", "picture"),
        *(parallel(1), parallel(0, only_if=CONDITIONS[0])),
    ]
    groups = [(forked, [len(branch) for branch in branches]) for forked, branches in capture._forks(given, 0)]
    assert groups == [(False, [1]), (True, [3, 1]), (False, [1]), (True, [1]), (False, [1])]
    inner = [(forked, [len(b) for b in branches]) for forked, branches in capture._forks([given[1], *given[3:5]], 1)]
    assert inner == [(False, [1]), (True, [1, 1])]


@pytest.mark.parametrize("label", ["uniform_grid", "ray_grids"])
@pytest.mark.parametrize("interrupted", ["loaded", "selected", "planned anew"])
def test_a_frame_is_never_made_from_one_that_is_not_whole(label, interrupted):
    prepared = scene()
    before = prepared.moment(0, *SIZE)
    after = prepared.moment(0, *SIZE, lights=tuple(light.moved((1.0, 5.0, 2.0)) for light in (POINT, BEHIND)))
    session = session_of(label, prepared)
    session.answers(before)
    session.frame.answers.poison()
    if interrupted != "planned anew":
        session.load(after)
    if interrupted == "selected":
        session.select({"light/0"})
        session.run_complete()
    if interrupted == "planned anew":
        session._plan()
    session.advance(after)
    whole = session_of(label, prepared).answers(after)
    assert_same(answers_in(session), whole)
    assert session.advance(after) == frozenset()


@pytest.mark.parametrize("label", LAMPS)
def test_a_frame_in_part_replays_to_the_answers_of_a_whole_one(label, device):
    """As it is timed: on a GPU its passes are a graph of their own."""
    prepared = scene((POINT, SPOT))
    lights = (POINT.moved((1.0, 5.0, 2.0)), SPOT)
    session, whole = (session_of(label, prepared, device) for _ in range(2))
    session.answers(prepared.moment(0, *SIZE))
    moved = prepared.moment(0, *SIZE, lights=lights)
    away = prepared.moment(0, *SIZE, camera=Camera(EYE.eye, (0.1, 0.5, 0.0)), lights=lights)
    for changed, moment in (({"light/0"}, moved), ({"camera"}, away)):
        session.load(moment)
        session.select(changed)
        session.run_complete()
        session.poison()
        session.replay()
        wanted = whole.answers(moment)
        assert_same(answers_in(session), wanted, f"{changed}")
        session.passes = session.all_passes


@pytest.mark.parametrize("label", LAMPS)
def test_a_moving_light_rebuilds_its_own_grid_and_nothing_else(label):
    session = session_of(label, scene())
    run = stale(session.all_passes, {"light/1"})
    assert run
    assert {work.effect for work in run} <= {"shadows/1", "receivers"}
    assert not [work for work in builds(run) if work.part == "build"]


@pytest.mark.parametrize("label", ["uniform_grid", "warp_bvh", "bvh rebuilt in place", "embree"])
def test_a_moving_camera_rebuilds_no_world_structure(label):
    assert not builds(stale(session_of(label, scene()).all_passes, {"camera"}))


@pytest.mark.parametrize(("clamp", "stays"), [("scene", True), ("hits", False), ("view", False), ("none", False)])
def test_a_light_grid_stays_with_a_moving_camera_only_where_it_knows_no_view(clamp, stays):
    session = Session(make_method("perspective_spherical", {"clamp": clamp}), scene(), *SIZE, "cpu")
    built = builds(stale(session.all_passes, {"camera"}))
    assert (not [work for work in built if work.part == "light build"]) == stays


def test_pass_graph_on_a_small_frame():
    passes = [
        make("build", "points", "tree", "build"),
        make("trace", "tree camera", "hits"),
        make("clear", "light/0", "bits"),
        make("shadow", "tree hits light/0", "bits"),
        make("debug", "tree", "picture"),
    ]
    kept = live(passes, ("hits", "bits"))
    assert [p.name for p in kept] == ["build", "trace", "clear", "shadow"]
    assert [p.name for p in live(passes, ("hits",))] == ["build", "trace"]
    assert [p.name for p in stale(kept, {"camera"})] == ["trace", "clear", "shadow"]
    assert ([p.name for p in stale(kept, {"light/0"})], stale(kept, set())) == (["clear", "shadow"], [])
    reasons = {step.work.name: step.reason for step in steps(kept, {"camera"})}
    assert (reasons["shadow"], reasons["clear"]) == ("hits changed", "bits is written again")


def test_a_pass_that_does_what_several_do_makes_way_for_those_that_are_needed():
    build, trace = make("build", "points", "tree", "build"), make("trace", "tree camera", "hits")
    shadow = make("shadow", "tree hits light/0", "bits")
    both = joined("both", (trace, shadow), lambda: None)
    assert (both.reads, both.writes) == (("tree", "camera", "light/0"), ("hits", "bits"))
    passes = [build, both]
    assert (live(passes, ("bits",)), stale(passes, {"points"})) == (passes, passes)
    assert (stale(passes, {"camera"}), stale(passes, {"light/0"})) == ([both], [shadow])
    assert stale(passes, set()) == []
    assert [step.reason for step in steps(passes, {"light/0"})][1] == "light/0 changed (shadow alone)"


# --- what a captured graph leaves out ------------------------------------------------------------------------------

VARIANTS = [
    *((name, GIVEN.get(name, {})) for name in method_names()),
    ("hybrid", {"shadows": "grid"}),
    ("warp_bvh", {"update": "bvh_rebuild"}),
    ("perspective_spherical", {"sort": "radix", "balancing": "algorithm-1", **FEW_CELLS}),
    ("perspective_spherical", {"sort": "radix", "triangle_chunk": "3", **FEW_CELLS}),
    ("perspective_spherical", {"triangle_chunk": "2", "clamp": "scene", **FEW_CELLS}),
    ("perspective_spherical", {"staging": "none", "light_map": "cube", **FEW_CELLS}),
    ("ray_grids", {"trial": "region=triangles"}),
]


@pytest.mark.parametrize("given", [{"facing": True}, {"mirror": all_mirrors, "bounces": 1}], ids=["facing", "mirrors"])
@pytest.mark.parametrize(("name", "settings"), VARIANTS)
def test_what_runs_in_any_case_leaves_no_bit_where_nothing_receives(name, settings, given, device, monkeypatch):
    """Passes that take scratch memory run, in a captured graph, on what the last traced frame left behind; so do passes of a
    light whose rays may come from mirrors.
    """
    prepared = scene((SPOT, BEHIND), **given)
    if device == "cpu":  # where nothing is captured, plain launches do as a graph would
        monkeypatch.setattr(passes, "condition", lambda work: None if work.scratch else work.only_if)
    gone = (replace(SPOT, spot=Spot((0.0, 1.0, 0.0), 1.0)), BEHIND)
    moments = [prepared.moment(0, *SIZE, lights=lights) for lights in ((SPOT, BEHIND), gone)]
    wanted = [session_or_skip(name, settings, prepared, device).answers(moment) for moment in moments]
    for order in ((0, 1, 0), (1, 0, 1)):
        session = session_or_skip(name, settings, prepared, device)
        for k in order:
            session.answers(moments[k])
        for k in order:
            session.load(moments[k])
            session.frame.answers.poison()
            session.replay()
            assert not session.overflowed()
            if any(work.reached is not None and "receivers/0" in work.writes for work in session.passes):
                assert session.frame.reached.numpy()[0] == (k == 0)
            session.method.counters()
            assert_same(answers_in(session), wanted[k], f"{k} of {order}")
    assert wanted[0]["shadowed"][0].any()


@pytest.mark.parametrize(("name", "settings"), VARIANTS)
def test_no_pass_depends_on_receivers_that_are_counted_after_it(name, settings):
    """The condition would be that of the last frame, and the graph would leave out what this frame needs."""
    made, conditional = set(), 0
    for work in session_or_skip(name, settings, scene((SPOT, BEHIND), facing=True)).all_passes:
        if work.only_if is not None:
            conditional += 1
            light = (work.effect or "").removeprefix("shadows/")
            masks = {name for name in work.reads if name.startswith("receivers/")} or {f"receivers/{light}"}
            assert masks <= made, work.name
        made.update(work.writes)
    assert conditional


@pytest.mark.parametrize(("name", "settings"), VARIANTS)
def test_what_a_graph_may_leave_out_takes_no_scratch_memory(name, settings, monkeypatch):
    """A branch of a captured graph holds kernels, fills and copies alone: scans and sorts allocate inside."""
    prepared = scene((SPOT, BEHIND), facing=True)
    session = session_or_skip(name, settings, prepared)
    session.answers(prepared.moment(0, *SIZE))
    given = [work for work in session.all_passes if work.only_if is not None and not work.scratch]
    assert given
    if (
        name == "ray_grids" or settings.get("shadows") == "grid"
    ):  # its scan is its own on a GPU; on a CPU nothing is captured
        given = [work for work in given if "count and scan" not in work.name]

    def refuse(*args, **kwargs):
        raise AssertionError("scratch memory within a branch")

    for routine in ("array_scan", "radix_sort_pairs", "segmented_sort_pairs", "runlength_encode"):
        monkeypatch.setattr(wp.utils, routine, refuse)
    for maker in ("zeros", "empty", "full", "array", "zeros_like", "empty_like", "clone"):
        monkeypatch.setattr(wp, maker, refuse)
    if not session.method.capturable:
        pytest.skip(f"{name} is not captured")
    for work in given:
        work.launch()
