"""The DataFrame of a results folder: one row a point and frame, every column as documented."""

import subprocess
import sys

import numpy as np
import pytest
from helpers.experiment_records import METHODS, SCENES, record, score, write_records
from shadowbench.harness.errors import UserError
from shadowbench.harness.results import points, samples, tidy
from shadowbench.harness.results.table import COUNTS, NUMBERS, TEXTS, stage_ms


@pytest.fixture
def records():
    return [record(scene, method) for scene in SCENES for method in METHODS]


def test_a_row_a_point_and_frame(records, tmp_path):
    records[0].update(status="rejected", reason="needs 9 pairs", frames=[])
    table = tidy(write_records(tmp_path, records))
    assert len(table) == 1 + sum(len(r["frames"]) for r in records)
    (row,) = table[table["key"] == records[0]["key"]].to_dict("records")
    assert (row["status"], row["reason"], row["unscored"]) == ("rejected", "needs 9 pairs", "not measured")
    assert np.isnan(row["total_ms"])
    for made in records[1:]:
        own = table[table["key"] == made["key"]]
        assert list(own["frame"]) == [f["frame"] for f in made["frames"]]
        assert list(own["total_ms"]) == [np.median(f["total_ms"]) for f in made["frames"]]
        assert list(own["q1_ms"]) == [np.percentile(f["total_ms"], 25) for f in made["frames"]]
        assert list(own["round.1"]) == [np.median(f["total_ms"][5:]) for f in made["frames"]]
        assert set(own["scene"]) == {made["scene"]["name"]}


def test_the_columns_and_their_types_are_those_declared(records, tmp_path):
    table = tidy(write_records(tmp_path, records))
    assert {c for c in table if "." not in c} == {*COUNTS, *NUMBERS, *TEXTS}
    assert {str(table[c].dtype) for c in COUNTS} == {"Int64"}
    assert {str(table[c].dtype) for c in NUMBERS} == {"float64"}
    assert all(isinstance(value, str) for c in TEXTS for value in table[c])


def test_errors_are_missing_where_nothing_was_judged(records, tmp_path):
    records[2]["frames"][1].update(score=None, unscored="no reference here")
    records[2]["frames"][0]["score"] = score(256, wrong=2)
    records[3]["frames"][1].update(score=None, unscored="no reference here")
    table = tidy(write_records(tmp_path, records)).set_index("key")
    assert list(table.loc[records[2]["key"], "true_errors"].isna()) == [False, True, False]
    found = points(table.reset_index()).set_index("key")
    assert found.loc[records[2]["key"], "true_errors"] == 2, "a known error counts"
    assert found["true_errors"].isna()[records[3]["key"]], "none found needs all frames"
    assert found.loc[records[3]["key"], "unscored"] == "2 of 3 frames scored: no reference here"
    assert found.loc[records[4]["key"], "true_errors"] == 0
    assert found.loc[records[4]["key"], "reference_errors"] == 3
    assert (table["shadow.scored"].dropna() == 256 * 256 // 2).all()


def test_a_stage_is_the_passes_that_a_pattern_names(records, tmp_path):
    table = tidy(write_records(tmp_path, records))
    np.testing.assert_allclose(stage_ms(table, "shadow"), table["shadow_ms"])
    assert (stage_ms(table, "shadow", "nothing") == 0).all()
    np.testing.assert_allclose(stage_ms(table, "light build", "the l"), table["light_build_ms"])


def test_parts_are_missing_where_their_times_contradict_each_other(records, tmp_path):
    records[0]["method"]["device"] = "cuda:0"  # there alone a pass is a difference
    steps = records[0]["frames"][0]["passes"]
    late = next(step for step in steps if step["part"] == "trace")
    early = next(step for step in steps if step["part"] == "build")
    whole = records[0]["frames"][0]["total_ms"][0]
    for step, by in ((early, 30 * whole), (late, -30 * whole)):
        step["ms"] = [ms + by for ms in step["ms"]]
    table = tidy(write_records(tmp_path, records)).set_index("key")
    disturbed = table.loc[[records[0]["key"]]].query("frame == @records[0]['frames'][0]['frame']")
    assert disturbed[["build_ms", "trace_ms", "light_build_ms", "shadow_ms", "build_iqr_ms"]].isna().all(axis=None)
    assert disturbed.filter(like="pass.").isna().all(axis=None)
    assert stage_ms(disturbed, "trace").isna().all()
    assert disturbed["total_ms"].notna().all()
    assert table.drop(index=records[0]["key"])["trace_ms"].notna().all()


def test_parts_are_missing_where_no_pass_was_timed(records, tmp_path):
    """A frame of very many passes; they are not 0, and its own time stands."""
    frame = records[0]["frames"][0]
    frame["passes"] = [{**step, "ms": []} for step in frame["passes"]]
    frame["stage_round"] = []
    place = write_records(tmp_path, records)
    table = tidy(place)
    (row,) = table[(table["key"] == records[0]["key"]) & (table["frame"] == frame["frame"])].to_dict("records")
    assert all(np.isnan(row[f"{part}_ms"]) for part in ("build", "trace", "light_build", "shadow"))
    assert (row["total_ms"], stage_ms(table, "trace").isna().sum()) == (np.median(frame["total_ms"]), 1)
    own = samples(place).query("key == @records[0]['key'] and frame == @frame['frame']")
    assert set(own["part"]) == {"frame", "wall"}


def test_samples_in_long_form(records, tmp_path):
    found = samples(write_records(tmp_path, records[:1]))
    frames = records[0]["frames"]
    steps = sum(len(step["ms"]) for f in frames for step in f["passes"])
    assert len(found) == sum(2 * len(f["total_ms"]) for f in frames) + steps
    whole = found[(found["part"] == "frame") & (found["frame"] == 1)]
    assert (list(whole["ms"]), list(whole["round"])) == (frames[1]["total_ms"], frames[1]["round"])
    assert set(found["part"]) == {"frame", "wall", "build", "trace", "light build", "shadow"}


def test_only_the_newest_record_of_an_entry_counts(tmp_path):
    old = record("bunny", "warp_bvh", key="old", rounds=[{"round": 0, "noted": 100.0, "run": "a"}])
    new = record("bunny", "warp_bvh", seed=1, key="new", rounds=[{"round": 0, "noted": 200.0, "run": "b"}])
    table = tidy(write_records(tmp_path, [new, old]))
    assert (set(table["key"]), set(table["run"]), table.attrs["older"]) == ({"new"}, {"b"}, 1)


def test_an_empty_folder_is_refused(tmp_path):
    with pytest.raises(UserError, match="no records in it"):
        tidy(tmp_path)


def test_pandas_is_not_loaded_before_a_table_is_made():
    """A run needs no table before its end: neither the package nor the declaration of an experiment loads pandas."""
    code = (
        "import sys; from shadowbench.harness.results import tidy\n"
        "import shadowbench.harness.runner.planning.experiment as e\n"
        "[e.find_experiment(name) for name in e.experiment_names()]; sys.exit('pandas' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
