"""What mirrors add, a mirrored ray beside a primary one, grids beside trees, and the paper's sentence on them."""

import pytest
from helpers.experiment_records import record_of, report_of, write_records
from shadowbench.experiments import claims, reflection
from shadowbench.harness.report.claims import FAILS, HOLDS, collect
from shadowbench.harness.runner.planning.experiment import Entry

BOUNCE = ("primary", "shadow", "true_errors")
GRID, TREE = reflection.GRIDS[0], reflection.TREES[0]


def point(entry: Entry, lighting, mirrored_ms: float = 0.0):
    """64x64 pixels; a primary ray takes 1000 ns; 2048 mirrored rays."""
    passes = [
        ("build", "build", 1.0),
        ("primary rays, share 1 of 1", "trace", 4.096),
        ("light 0: shadow rays", "shadow", 2.0),
    ]
    if mirrored_ms:
        passes += [("bounce 1: rays", "trace", 0.5), ("bounce 1: mirrored rays", "trace", mirrored_ms)]
    made = record_of("reflection", entry, "cloth", lighting, ms=sum(p[2] for p in passes) / 1.01, passes=passes)
    one = made["frames"][0]["score"]
    if mirrored_ms:
        one["bounces"] = [{**{name: one[name] for name in BOUNCE}, "bounce": 1, "rays": 2048, "rays_wrong": 0}]
    return made


def records(grid_ms: float, tree_ms: float):
    plain, _, four = reflection.LIGHTINGS
    made = [point(entry, plain) for entry in (GRID, TREE)]
    return [*made, point(GRID, four, grid_ms), point(TREE, four, tree_ms)]


def test_added_time_and_the_time_of_a_mirrored_ray(tmp_path):
    table = reflection.read(write_records(tmp_path, records(8.192, 2.048)))
    bounced = table[table["light_label"] == "4 bounces"].set_index("label")
    assert bounced.loc[GRID.label, "mirrored_ns"] == pytest.approx(4000.0)
    assert bounced.loc[GRID.label, "primary_ns"] == pytest.approx(1000.0)
    assert bounced.loc[GRID.label, "loss"] == pytest.approx(4.0)
    assert bounced.loc[TREE.label, "added_ms"] == pytest.approx(2.548)
    assert reflection.best_ratio(bounced.reset_index())["ratio"].tolist() == pytest.approx([4.0])
    text = report_of("reflection", tmp_path)
    assert (tmp_path / "reflection.svg").exists()
    assert "the fastest grid takes 4.00 times as long for a mirrored ray as the fastest tree" in text
    assert "| Cloth (stand-in) | 4 bounces |" in text
    assert "(x4.00)" in text


@pytest.mark.parametrize(("grid", "tree", "verdict"), [(8.0, 2.0, FAILS), (2.0, 8.0, HOLDS)])
def test_the_papers_sentence_is_judged_by_the_passes_of_mirrored_rays(tmp_path, grid, tree, verdict):
    (evidence,) = collect(write_records(tmp_path, records(grid, tree))).evidence("reflection")
    assert claims.reflected(evidence).verdict == verdict


def test_the_fastest_tree_stands_for_the_trees(tmp_path):
    four = reflection.LIGHTINGS[2]
    faster = point(reflection.TREES[1], four, 1.0)
    (evidence,) = collect(write_records(tmp_path, [*records(2.0, 8.0), faster])).evidence("reflection")
    found = claims.reflected(evidence)
    assert found.verdict == FAILS
    assert f"{GRID.label} over {reflection.TREES[1].label}" in found.numbers


def test_no_mirrors_measured_is_said(tmp_path):
    text = report_of("reflection", tmp_path, [point(GRID, reflection.LIGHTINGS[0])])
    assert "No grid and tree were measured with mirrors." in text
