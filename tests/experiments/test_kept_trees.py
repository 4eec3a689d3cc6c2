"""Trees by age, from made-up records: when rebuilding pays, and the ways to have a tree."""

import dataclasses

import pytest
from helpers.experiment_records import csv_of, record_of, report_of
from shadowbench.experiments.kept_trees import FIRST, KEPT, LIGHTINGS, METHODS, REBUILT, STATIC
from shadowbench.harness.commands.run import plan_run
from shadowbench.harness.commands.show import show
from shadowbench.harness.runner.progress import Silent
from shadowbench.harness.runner.run import Run

pytestmark = pytest.mark.usefixtures("unpainted")

FRAMES = 12


def animated(entry, ms, sah, scene="cloth"):
    """A record of an animation; ``ms`` and ``sah`` of each frame."""
    record = record_of("kept_trees", entry, scene, frames=FRAMES)
    for k, frame in enumerate(record["frames"]):
        frame["total_ms"] = [ms(k), ms(k)]
        frame["counters"] = {"expected nodes a hundred rays": 0, "expected tests a hundred rays": round(100 * sah(k))}
    return record


def trees(slope, scene="cloth"):
    """A rebuilt tree and kept ones, which take 1 ms when they are new and ``slope`` ms more in each frame."""
    kept = [(int(entry.settings.get("tree_frame", 0)), entry) for entry in (FIRST, *KEPT[:2])]
    made = [
        animated(entry, lambda k, own=own: 1 + slope * abs(k - own), lambda k, own=own: 10 + abs(k - own), scene)
        for own, entry in kept
    ]
    return [animated(REBUILT, lambda k: 2.0, lambda k: 12.5, scene), *made]


def test_when_rebuilding_pays(tmp_path):
    text = report_of("kept_trees", tmp_path, [*trees(0.25), *trees(0.01, "fairy"), *trees(0.0, "buddha")[:1]])
    assert "Cloth (stand-in), until it is 4 frames old" in text
    assert "Fairy (stand-in), at every age measured (up to 11 frames)" in text
    rows = [row for row in csv_of("kept_trees", tmp_path) if row["scene"] == "cloth" and row["tree_frame"] == "5"]
    assert [float(row["age"]) for row in rows] == [k - 5 for k in range(FRAMES)]
    assert [float(row["ratio"]) for row in rows] == [(1 + 0.25 * abs(k - 5)) / 2 for k in range(FRAMES)]
    assert float(rows[7]["sah_ratio"]) == pytest.approx(12 / 12.5)


def test_ways_to_have_a_tree(tmp_path):
    text = report_of("kept_trees", tmp_path, trees(0.25))
    lines = [line.split(" | ")[1:] for line in text.splitlines() if line.startswith("| Cloth (stand-in) | ")]
    found = {line[0]: line[1:3] + line[4:] for line in lines}
    ages = {"a new tree every 5 frames": [k % 5 for k in range(FRAMES)], "one tree, of the first frame": range(FRAMES),
            "a new tree every 10 frames": [k % 10 for k in range(FRAMES)],
            "one tree, the best": [abs(k - 5) for k in range(FRAMES)]}  # fmt: skip
    assert set(found) == {*ages, "rebuilt each frame"}
    for name, own in ages.items():
        mean = sum(own) / FRAMES
        assert [float(x.removesuffix(" |")) for x in found[name]] == pytest.approx(
            [1 + mean / 4, (1 + mean / 4) / 2, 10 + mean, 10 + max(own)], abs=0.06
        ), name


def test_a_tree_that_does_not_move(tmp_path):
    made = [
        record_of("kept_trees", entry, "conference", lighting, ms=ms)
        for entry in STATIC
        for lighting, ms in zip(LIGHTINGS, (3.0, 1.0, 2.0), strict=True)
    ]
    text = report_of("kept_trees", tmp_path, [*trees(0.25), *made])
    assert "| Conference (stand-in) | BVH2 static | 3.03 | 1.01 | 2.02 |" in text
    assert "tree of frame 15: no record" not in text
    assert METHODS[-1].label in text


def test_no_tree_measured(tmp_path):
    text = report_of("kept_trees", tmp_path, [animated(METHODS[-1], lambda k: 1.0, lambda k: 1.0)])
    assert METHODS[-1].label in text


@pytest.mark.slow
def test_it_runs(tmp_path):
    """Ages and qualities come from real records: a tree is the best at its own frame."""
    options = plan_run(
        "kept_trees", preset="quick", device="cpu", out=tmp_path, size="8x8", scenes=["balls-300-swirl50"]
    )
    preset = dataclasses.replace(options.preset, methods=METHODS[:3])
    Run(dataclasses.replace(options, preset=preset, score=False), Silent()).go()
    show("kept_trees", tmp_path, quiet=True)
    rows = csv_of("kept_trees", tmp_path)
    assert [row["age"] for row in rows if row["label"] == KEPT[0].label] == [str(k) for k in range(-5, 16)]
    cost = {(row["label"], row["frame"]): float(row["sah_cost"]) for row in rows}
    assert cost[KEPT[0].label, "5"] < cost[FIRST.label, "5"]
    assert cost[KEPT[0].label, "0"] > cost[FIRST.label, "0"]
