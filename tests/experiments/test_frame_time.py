"""Ratios of the frame-time experiment, from made-up rows."""

import pytest
from helpers.experiment_records import record_of, report_of
from helpers.planned_for_cuda import plan_for_cuda
from helpers.small_scenes import make_scene, soup
from helpers.streams import trial
from shadowbench.experiments import _floor as floor
from shadowbench.experiments import frame_time
from shadowbench.experiments._floor import Machine, Work, ray_grids
from shadowbench.harness.frame.registry import make_method
from shadowbench.harness.frame.session import Session
from shadowbench.harness.report import panels
from shadowbench.harness.runner.planning.experiment import Entry

OURS, MESH = Entry("ray_grids", {}, "ray grids"), Entry("warp_bvh", {}, "mesh rebuilt")


def test_the_part_of_the_host_is_told_of_frames_that_are_no_graph(tmp_path):
    made = [record_of("frame_time", OURS, ms=1.0), record_of("frame_time", MESH, ms=10.0)]
    assert "the host launches" not in report_of("frame_time", tmp_path / "graphs", made)
    made[1]["frames"][0]["submitted_ms"] = [2.0, 3.0]
    text = report_of("frame_time", tmp_path / "launched", made)
    (row,) = [line for line in text[text.index("the host launches") :].splitlines() if "| 2.50 |" in line]
    assert "mesh rebuilt" in row


def test_a_floor_is_the_larger_of_moving_and_testing_and_the_launches():
    machine = Machine(bytes_per_s=1e12, tests_per_s=1e9, launch_ms=0.5)
    assert floor.least_ms(Work(2e9, 1e6, 1), machine) == pytest.approx(2.0 + 0.5)
    assert floor.least_ms(Work(2e9, 3e6, 2), machine) == pytest.approx(3.0 + 1.0)


@pytest.mark.parametrize("names", [("chunks", "undecided pairs"), ("parts", "doubtful pairs")])
def test_work_has_the_names_of_now_and_of_earlier_records(names):
    chunks, pairs = names
    row = {"pixels": 10, "shadow_rays": 9, "triangles": 8, "vertices": 7}
    counted = {f"counter.light 0 {chunks}": 3, f"counter.light 0 {pairs}": 5}
    assert ray_grids({**row, **counted}, f"light 0: further {chunks}").bytes == 3 * (8 + 128)
    assert ray_grids({**row, **counted}, f"light 0: {pairs}, share 2 of 2").bytes == 0.5 * 5 * 8
    both = {f"counter.camera {chunks}": 3, f"counter.camera {pairs}": 5}
    assert ray_grids({**row, **both}, f"camera: further {chunks}, {pairs}").bytes == 3 * (8 + 80) + 5 * 8


def floored(monkeypatch, folder, passes):
    monkeypatch.setitem(floor.MACHINES, "Imaginary GPU", Machine(1e12, 1e15, 0.01))
    record = record_of("frame_time", Entry("ray_grids", {}, "ray grids"), passes=passes, ms=1.0)
    record["scene"].update(triangles=1_000_000, vertices=500_000)
    record["frames"][0].update(shadow_rays=3000, counters={"camera items": 10, "light 0 items": 20})
    text = report_of("frame_time", folder, [record])
    return text, (folder / "frame_time-stages.csv").read_text().splitlines()


def test_the_floor_is_told_stage_by_stage(monkeypatch, tmp_path):
    passes = [("camera: resolve", "trace", 0.4), ("light 0: scatter rays", "light build", 0.6)]
    text, lines = floored(monkeypatch, tmp_path, passes)
    pixels = 64 * 64
    resolve, scatter = pixels * 24 / 1e9 + 0.01, 3000 * 40 / 1e9 + 0.01
    assert lines[0] == ",".join(floor.COLUMNS)
    assert f"camera: resolve,trace,0.4,{resolve:.6g},{0.4 / resolve:.6g}" in lines[1]
    assert f"| {resolve + scatter:.3f} |" in text
    assert "frame_time-stages.csv" in text


def test_shares_of_a_stage_are_one_stage_with_one_launch(monkeypatch, tmp_path):
    """They run beside each other: times, bytes and tests are summed, and one kernel's start is counted."""
    name = "light 0: queued rows, share {} of 2"
    _, lines = floored(monkeypatch, tmp_path, [(name.format(k), "shadow", ms) for k, ms in ((1, 0.7), (2, 0.2))])
    queued = 20 * 128 / 1e9 + 0.01
    assert lines[1].startswith(f"cloth,64,64,light 0: queued rows,shadow,0.9,{queued:.6g},")
    assert len(lines) == 2


def test_a_stage_without_a_floor_leaves_the_frame_without_one(monkeypatch, tmp_path):
    text, lines = floored(monkeypatch, tmp_path, [("camera: resolve", "trace", 0.4), ("a new stage", "trace", 0.1)])
    assert "floor" not in text.lower()
    assert lines[2].startswith("cloth,64,64,a new stage,trace,0.1,,")


@pytest.mark.parametrize("groups", ["split", "stream"])
@pytest.mark.parametrize("shares", [1, 2])
def test_every_stage_of_the_method_has_its_work(groups, shares, monkeypatch):
    """Whoever adds or renames a pass says what it must move."""
    vertices, faces = soup(3, 20)
    prepared = make_scene(vertices, faces, [(2.0, 3.0, 4.0), (1.0, 2.0, 3.0)])
    method = make_method("ray_grids", trial(groups=groups, shares=shares))
    plan_for_cuda(method, monkeypatch)
    session = Session(method, prepared, 16, 16, "cpu")
    row = {"triangles": 20, "vertices": 60, "pixels": 256, "shadow_rays": 100}
    works = {work.name: ray_grids(row, work.name) for work in session.all_passes}
    assert not [name for name, work in works.items() if work is None]
    stages = {work.stage for work in works.values() if work.stage}
    steps = 5 if groups == "split" else 4
    assert len(stages) == 3 + 2 * steps  # of the camera three, and of each light
    assert sum(bool(work.stage) for work in works.values()) == shares * len(stages)


def test_a_bar_says_three_digits_and_what_is_wrong_of_it():
    """No time without its error: a mark and a count where answers are wrong, a word where nothing is known."""
    right = {"label": "fast", "ms": "6.68", "times": 6.68, "times_spread": 0.01, "error": "✓"}
    assert frame_time.beside(right) == "6.68 ms, 6.68x"
    assert frame_time.beside({**right, "error": "✗ 4 wrong"}) == "6.68 ms, 6.68x  ✗ 4"
    assert frame_time.beside({**right, "error": "unscored", "times": 1.0}) == "6.68 ms  unscored"


def test_the_picture_marks_wrong_answers_and_explains_its_parts(tmp_path):
    wrong = record_of("frame_time", Entry("warp_bvh", {}, "mesh rebuilt"), ms=3.0)
    wrong["frames"][0]["score"] = {**wrong["frames"][0]["score"], "true_errors": 4}
    report_of("frame_time", tmp_path, [record_of("frame_time", Entry("ray_grids", {}, "ray grids"), ms=1.0), wrong])
    text = (tmp_path / "frame_time.svg").read_text()
    assert "✗ 4" in text
    assert "n wrong pixels and shadow bits" in text
    assert "twice the time of the fastest exact method" in text
    assert all(f">{part}<" in text for part in ("build", "trace", "light build", "shadow"))


def test_two_sizes_in_one_folder_have_rows_panels_and_sentences_of_their_own(tmp_path):
    times = ((64, OURS, 1.0), (64, MESH, 3.0), (128, OURS, 2.0), (128, MESH, 10.0))
    made = [record_of("frame_time", entry, ms=ms, size=size) for size, entry, ms in times]
    text = report_of("frame_time", tmp_path, made)
    for size, ours, ratio in (("64x64", "1.01", "3.00"), ("128x128", "2.02", "5.00")):
        assert f"## Cloth (stand-in), {size}, fastest first" in text
        assert f"Cloth (stand-in), {size}: the fastest exact method is ray grids with {ours} ms a frame" in text
        assert f"takes {ratio} times as long" in text
    svg = (tmp_path / "frame_time.svg").read_text()
    assert all(f"Cloth (stand-in), {size}" in svg for size in ("64x64", "128x128"))


@pytest.mark.parametrize("scenes", [1, 4])
def test_what_stands_below_the_bars_is_within_the_picture(tmp_path, scenes):
    size = (3.4 if scenes == 1 else 5.6, 2.5)
    with panels.sheet(
        tmp_path / "a.svg", size, below=f"{panels.WHOLE}\n2.0x: twice the time of the fastest exact method"
    ) as (figure, _):
        pass
    figure.draw_without_rendering()
    box = figure._supxlabel.get_window_extent()
    assert box.x0 >= 0
    assert box.x1 <= figure.bbox.width
