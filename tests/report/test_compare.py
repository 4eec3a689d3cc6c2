"""What may be compared: points of one run, with one version of each method, over the frames that both have."""

import pytest
from helpers.experiment_records import record_of, write_records
from shadowbench.harness.report import compare, document
from shadowbench.harness.report.claims import collect
from shadowbench.harness.runner.planning.experiment import Entry, find_experiment
from shadowbench.harness.scene.overrides import Lighting

OURS, TREE = Entry("ray_grids", {}, "ours"), Entry("warp_bvh", {}, "tree")


def two(frames=1):
    return [record_of("frame_time", entry, ms=ms, frames=frames) for entry, ms in ((OURS, 1.0), (TREE, 2.0))]


def timed(record, *times):
    for frame, ms in zip(record["frames"], times, strict=True):
        frame["total_ms"] = [ms, ms]
    return record


def found(tmp_path, records):
    frames = document.frames(write_records(tmp_path, records))
    ratios = compare.ratios(frames, frames["label"] == "tree")
    return {key.split("-")[2]: row for key, row in ratios.to_dict("index").items()}


def test_only_frames_that_both_have_are_compared(tmp_path):
    """Means over unlike frames say 2.5; on the common frames it is 0.5."""
    ours, tree = two(frames=4)
    timed(ours, 1.0, 1.0, 9.0, 9.0)
    timed(tree, 2.0, 2.0, 2.0, 2.0)
    del tree["frames"][2:]
    ratios = found(tmp_path, [ours, tree])
    assert (ratios["ours"]["ratio"], ratios["ours"]["frames"]) == (pytest.approx(0.5), 2)
    assert ratios["tree"]["ratio"] == 1.0


@pytest.mark.parametrize("change", [
    lambda r: r.update(rounds=[{"round": 0, "run": "another"}]), lambda r: r.update(environment="another"),
    lambda r: r["point"].update(width=128), lambda r: r["scene"].update(lights=[{}, {}]),
    lambda r: r["scene"].update(arrays_sha256="another"), lambda r: r["scene"].update(title="another"),
    lambda r: r["method"].update(device="cpu"), lambda r: r["frames"][0].update(frame=7),
    lambda r: r["method"].update(name="warp_bvh", source_sha256="an older version"),
])  # fmt: skip
def test_what_is_not_alike_has_no_ratio(tmp_path, change):
    records = two()
    assert "ours" in found(tmp_path / "alike", records)
    change(records[0])
    assert "ours" not in found(tmp_path / "changed", records)


def test_runs_of_the_same_columns_are_counted_only(tmp_path):
    """Sizes that were measured one by one: each run had all methods, and the line named them three times."""
    records = [*two(), *two()]
    for record, run in zip(records, "aabb", strict=True):
        record["rounds"], record["point"]["width"] = [{"run": run}], 64 if run == "a" else 128
        record["key"] += run
    (line,) = compare.apart(document.read(write_records(tmp_path, records)))
    assert line == "Cloth (stand-in) was measured in 2 runs, which are not compared."


def test_a_method_of_several_runs_is_named_with_its_lightings(tmp_path):
    lights = [Lighting("one", count=1), Lighting("two", count=2)]
    records = [record_of("effects", entry, lighting=light) for light in lights for entry in (OURS, TREE)]
    for record, run in zip(records, "abbb", strict=True):
        record["rounds"] = [{"run": run}]
    (line,) = compare.apart(document.read(write_records(tmp_path, records)))
    assert line.endswith("2 runs, which are not compared: ours: one | ours: two; tree.")


def test_a_ratio_has_the_range_of_its_rounds(tmp_path):
    records = two()
    for record, times in zip(records, ([0.9, 1.1], [2.0, 2.0]), strict=True):
        record["frames"][0].update(total_ms=times, round=[0, 1])
    ours = found(tmp_path, records)["ours"]
    assert (ours["ratio"], ours["low"], ours["high"]) == pytest.approx((0.5, 0.45, 0.55))
    assert ours["spread"] == pytest.approx(0.05), "half the range between the rounds"


def test_any_measure_of_a_pair_is_over_the_common_frames(tmp_path):
    ours, tree = two(frames=2)
    ours["frames"][1] = {**ours["frames"][1], "passes": [{"name": "all rays", "part": "shadow", "ms": [40.0, 40.0]}]}
    del tree["frames"][1]
    frames = document.frames(write_records(tmp_path, [ours, tree]))
    one, other = compare.pairs(frames, frames["label"] == "tree")
    shadow = (one["shadow_ms"] / other["shadow_ms"])[one["label"] == "ours"]
    assert (list(shadow), list(one.index)) == (pytest.approx([0.5]), list(other.index))


@pytest.mark.parametrize(("starts", "said"), [((1, 2, 3, 4), 1), ((1, 3, 2, 4), 0), ((0, 0, 0, 0), 0)])
def test_lightings_that_were_not_measured_in_turn_are_named(tmp_path, starts, said):
    lights = [Lighting("one", count=1), Lighting("two", count=2)]
    records = [record_of("effects", entry, lighting=light) for light in lights for entry in (OURS, TREE)]
    for record, start in zip(records, starts, strict=True):
        record["frames"][0]["started"] = [float(start)]
    frames = document.frames(write_records(tmp_path, records))
    assert compare.in_sequence(frames) == [compare.ONE_BY_ONE] * said
    assert compare.in_sequence(frames[frames["label"] == "ours"]) == [], "one method alone does not tell"
    assert compare.in_sequence(frames.assign(run="a+b")) == [], "what a run continued is in an order of its own"


ENTRIES = {e.label or e.method: e for e in find_experiment("frame_time").presets["paper"].methods}
GRIDS, MESH = ENTRIES["the paper's grids"], ENTRIES["mesh rebuilt"]


def changed(record, version="", started=0.0, title="", environment="e"):
    record["method"]["source_sha256"] = version
    record["scene"]["title"] = title or record["scene"]["title"]
    record["environment"] = environment
    for frame in record["frames"]:
        frame["started"] = [started]
    return record


def pair(ms, scene="cloth", frames=1, **changes):
    """Ours in ``ms`` and the tree in 2 ms."""
    return [
        changed(record_of("frame_time", entry, scene, ms=m, frames=frames), **changes)
        for entry, m in ((GRIDS, ms), (MESH, 2.0))
    ]


def total(table):
    return table["total_ms"]


def ours_over_tree(evidence):
    return evidence.ratios({"label": GRIDS.label}, {"label": MESH.label}, total)


def test_versions_of_a_method_in_one_folder_are_not_mixed(tmp_path):
    """A run that was gone on with after a change: what the last version did counts, and the rest is not compared."""
    old, new = pair(1.0, version="old", started=1.0), pair(1.0, "fairy", version="new", started=2.0)
    write_records(tmp_path / "a", old + new)
    (evidence,) = collect(tmp_path).evidence("frame_time")
    assert (list(ours_over_tree(evidence)), set(evidence.versions.values())) == (["fairy"], {"new"})


def test_the_last_version_comes_before_more_frames_and_runs_of_one_version_are_joined(tmp_path):
    write_records(tmp_path / "long", pair(1.0, frames=5, version="old", started=1.0))
    write_records(tmp_path / "short", pair(1.6, version="new", started=2.0))
    write_records(tmp_path / "more", pair(1.8, "fairy", version="new", started=3.0))
    data = collect(tmp_path)
    first, second = data.evidence("frame_time")
    assert ours_over_tree(first) == {"cloth": pytest.approx(0.8), "fairy": pytest.approx(0.9)}
    assert set(first.frames["folder"]) == {"more", "short"}
    assert ours_over_tree(second) == {"cloth": pytest.approx(0.5)}
    assert data.newest[GRIDS.method] == first.versions[GRIDS.method] == "new"


def test_experiments_of_one_version_come_in_the_order_asked_for(tmp_path):
    write_records(tmp_path / "a", pair(1.0, version="new", started=1.0))
    other = [dict(r, experiment="table1", key=r["key"] + "-t") for r in pair(1.0, version="new", started=9.0)]
    write_records(tmp_path / "b", other)
    for names in (("frame_time", "table1"), ("table1", "frame_time")):
        assert tuple(e.experiment for e in collect(tmp_path).evidence(*names)) == names


def test_a_stand_in_keeps_its_name_beside_a_real_mesh_of_that_name(tmp_path):
    write_records(tmp_path / "a", pair(1.2, "sibenik"))
    real = pair(1.8, "sibenik", title="sibenik.ply")
    for r in real:
        r["scene"]["stand_in"] = None
    write_records(tmp_path / "b", real)
    (evidence,) = collect(tmp_path).evidence("frame_time")
    assert ours_over_tree(evidence) == {"sibenik": pytest.approx(0.6), "sibenik.ply": pytest.approx(0.9)}
