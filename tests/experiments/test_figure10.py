"""Figure 10's stages, from made-up records: every pass is counted once, and rearrangement is compared across sizes."""

import pytest
from helpers.experiment_records import csv_of, record_of, report_of
from shadowbench.experiments import _paper
from shadowbench.harness.runner.planning.experiment import find_experiment

SCENES = ("fairy", "sibenik", "cloth")


def staged(scene, rearranged):
    passes = [("camera grid: sort pairs", "build", 1.0), ("primary rays", "trace", 2.0),
              ("light 0: map rays", "shadow", rearranged / 2), ("light 0: sort rays", "shadow", rearranged / 2),
              ("light 0: count", "light build", 1.5), ("light 0: shadow rays", "shadow", 3.0)]  # fmt: skip
    entry = _paper.faithful("paper-faithful")
    return record_of("figure10", entry, scene, ms=7.5 + rearranged, passes=passes, counters={"light 0 rays": 1000})


def test_every_pass_is_counted_once_and_the_spread_is_told(tmp_path):
    text = report_of("figure10", tmp_path, [staged(scene, 1.0 + 0.01 * i) for i, scene in enumerate(SCENES)])
    rows = csv_of("figure10", tmp_path)
    assert "takes 1.01 ms, the mean over 3 scenes; its coefficient of variation is 1%" in text
    assert [float(r["other_ms"]) for r in rows] == pytest.approx([0.0] * 3, abs=1e-9)
    assert [float(r["shadow_traversal_ms"]) for r in rows] == pytest.approx([3.0] * 3)
    assert {r["shadow_rays"] for r in rows} == {"1000"}
    assert "| grid build | 1.00 | 1.00 | 1.00 | 0% |" in text
    text = report_of("figure10", tmp_path, [staged(scene, 1.0 + 4.0 * i) for i, scene in enumerate(SCENES)])
    assert "coefficient of variation is 65%" in text
    assert "holds" not in text, "whether the paper is right is for `show claims` to judge"


def test_the_largest_size_is_drawn_and_rearrangement_is_compared_over_the_same_frames(tmp_path):
    small = [staged(scene, 1.0) for scene in SCENES]
    for r in small:
        r["point"].update(width=32, height=32)
        r["key"] += "-small"
    text = report_of("figure10", tmp_path, [*(staged(scene, 1.6) for scene in SCENES), *small])
    assert "takes 1.60 ms, the mean over 3 scenes" in text
    assert "1.6 times as long at the larger size, same frames" in text
    assert "| primary traversal | 2.00 | 2.00 | 2.00 | 0% | 1.0 |" in text
    assert (tmp_path / "figure10.svg").read_text().count("Cloth (stand-in)") == 1
    # Other frames at the other size: nothing is said of it.
    for r in small:
        r["frames"][0]["frame"] = 5
    text = report_of("figure10", tmp_path, small)
    assert "larger" not in text.split("## ")[0]


@pytest.mark.filterwarnings("error::UserWarning")
def test_stages_that_add_up_to_more_than_the_frame_stay_within_the_drawing(tmp_path):
    (entry,) = find_experiment("figure10").presets["quick"].methods
    passes = [("build", "build", 400.0), ("primary rays", "trace", 900.0), ("light 0: shadow rays", "shadow", 900.0)]
    record = record_of("figure10", entry, "cloth", ms=10.0, passes=passes, counters={"light 0 rays": 9})
    report_of("figure10", tmp_path, [record])
    assert (tmp_path / "figure10.svg").stat().st_size > 0
