"""What may be compared: rows of one run, with one version of each method, over the same frames."""

import pytest
from helpers.experiment_records import record_of, write_records
from shadowbench.harness.report.claims import collect
from shadowbench.harness.runner.planning.experiment import find_experiment

ENTRIES = {e.label or e.method: e for e in find_experiment("frame_time").presets["paper"].methods}
OURS, TREE = ENTRIES["the paper's grids"], ENTRIES["mesh rebuilt"]


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
        for entry, m in ((OURS, ms), (TREE, 2.0))
    ]


def total(table):
    return table["total_ms"]


def ours_over_tree(evidence):
    return evidence.ratios({"label": OURS.label}, {"label": TREE.label}, total)


def test_points_of_two_runs_are_never_compared(tmp_path):
    """Two folders are two runs; so are two environments in one folder."""
    write_records(tmp_path / "a", pair(1.0)[:1])
    write_records(tmp_path / "b", pair(1.0)[1:])
    assert [ours_over_tree(e) for e in collect(tmp_path).evidence("frame_time")] == [{}, {}]
    write_records(tmp_path / "c", [changed(r, environment=e) for r, e in zip(pair(1.0, "fairy"), "ef", strict=True)])
    assert [ours_over_tree(e) for e in collect(tmp_path / "c").evidence("frame_time")] == [{}, {}]


def test_versions_of_a_method_in_one_folder_are_not_mixed(tmp_path):
    """A run that was gone on with after a change: what the last version did counts, and the rest is not compared."""
    old, new = pair(1.0, version="old", started=1.0), pair(1.0, "fairy", version="new", started=2.0)
    write_records(tmp_path / "a", old + new)
    (evidence,) = collect(tmp_path).evidence("frame_time")
    assert list(ours_over_tree(evidence)) == ["fairy"]
    assert set(evidence.versions.values()) == {"new"}


def test_the_last_version_comes_before_more_frames_and_runs_of_one_version_are_joined(tmp_path):
    write_records(tmp_path / "long", pair(1.0, frames=5, version="old", started=1.0))
    write_records(tmp_path / "short", pair(1.6, version="new", started=2.0))
    write_records(tmp_path / "more", pair(1.8, "fairy", version="new", started=3.0))
    data = collect(tmp_path)
    first, second = data.evidence("frame_time")
    assert ours_over_tree(first) == {"cloth": pytest.approx(0.8), "fairy": pytest.approx(0.9)}
    assert set(first.frames["folder"]) == {"more", "short"}
    assert ours_over_tree(second) == {"cloth": pytest.approx(0.5)}
    assert data.newest[OURS.method] == first.versions[OURS.method] == "new"


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
