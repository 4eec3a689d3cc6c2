"""Reports of single experiments, from made-up records: soft shadows, bits of a key, trees by age."""

import dataclasses
import re
from types import SimpleNamespace

import numpy as np
import pytest
from helpers.experiment_records import csv_of, record_of, report_of
from helpers.tiny_runs import write_scene
from shadowbench.experiments import soft_shadows
from shadowbench.experiments.kept_trees import FIRST, KEPT, LIGHTINGS, METHODS, REBUILT, STATIC
from shadowbench.experiments.key_bits import BITS, EXPERIMENT, Trial
from shadowbench.harness.commands.run import plan_run
from shadowbench.harness.commands.show import show
from shadowbench.harness.errors import CapacityRejected, UserError
from shadowbench.harness.frame.registry import make_method
from shadowbench.harness.hardcases.case import view
from shadowbench.harness.hardcases.shapes import ball, joined, plane
from shadowbench.harness.report.claims import collect
from shadowbench.harness.runner.measuring.timing import Sampling, sample_frame
from shadowbench.harness.runner.planning.experiment import Entry
from shadowbench.harness.runner.progress import Silent
from shadowbench.harness.runner.run import Run
from shadowbench.harness.scene.chosen_view import ChosenView

pytestmark = pytest.mark.usefixtures("unpainted")

OURS, TREE, LOOSE = soft_shadows.METHODS[:3]
COUNTS = (1, 4, 16)


def records(tree):
    """Times of our grids grow by 1 ms a target, those of a tree by ``tree`` from 3 ms on; the loose tree is faster yet."""
    made = []
    for scene in ("sibenik", "cloth"):
        for lighting in soft_shadows.targets(*COUNTS):
            n = lighting.samples
            for entry, ms in ((OURS, n), (TREE, 3.0 + tree * n), (LOOSE, 2.9 + tree * n)):
                one = record_of("soft_shadows", entry, scene, lighting, ms=float(ms))
                one["scene"]["lights"] = [{"samples": n}]
                if entry is LOOSE:
                    one["method"]["known_inexact"] = "float32"
                made.append(one)
    return made


@pytest.mark.parametrize("given", [{"light_size": 2.0}, {"light_samples": 8}, {"light_shape": "disc"}])
def test_an_area_that_the_experiment_sets_itself_is_refused(given):
    (name,) = given
    with pytest.raises(UserError, match=f"^--{name.replace('_', '-')}: soft_shadows gives lights their areas itself"):
        plan_run("soft_shadows", device="cpu", view=ChosenView(**given))
    plan_run("two_lights", "quick", "cpu", view=ChosenView(light_size=2.0))


@pytest.mark.parametrize(("tree", "words"), [(2.0, "not up to 16 on "), (-2.5, "at 1 already on "),
                                             (0.5, " (by 31 % of the frame at most) on ")])  # fmt: skip
def test_a_tree_that_never_or_always_or_later_wins_is_said(tmp_path, tree, words):
    if tree < 0:  # a tree that takes less than the grids from the beginning
        made = [r for r in records(0.0)]
        for one in made:
            if one["method"]["label"] == TREE.label:
                one["frames"][0]["total_ms"] = [0.5, 0.51]
    else:
        made = records(tree)
    assert words in report_of("soft_shadows", tmp_path, made)


def no_room(*given):
    raise CapacityRejected("needs more")


@pytest.mark.parametrize("without_room", [False, True])
def test_errors_of_pictures_fall_with_the_number_of_targets(monkeypatch, without_room):
    """An exact method's error falls; a filtered map, whose filter is too wide everywhere, keeps one."""
    trial = view(
        joined(ball(0.75, (0, 0, 0)), plane(2, -1, 4)), [(0.5, 0.75, 3.0)], (0, -4, 3), (0, 0.9, -0.85), 0.75, (16, 16)
    )
    wide = Entry("shadow_map", {"size": "512", "filter": "soft"}, "wide")
    preset = SimpleNamespace(width=24, height=24, methods=(TREE, wide), lightings=soft_shadows.targets(*COUNTS))
    options = SimpleNamespace(preset=preset, device="cpu", described=lambda name: trial.prepared.scene)
    if without_room:
        monkeypatch.setattr(type(make_method("bvh2")), "plan", no_room)
    pictures: list = []
    rows = list(soft_shadows.errors(options, "case", pictures))
    exact = [row["rmse"] for row in rows if row["picture"] == soft_shadows.EXACT]
    mapped = [row["rmse"] for row in rows if row["picture"] == "wide"]
    assert exact[0] > exact[1] > exact[2] > 0.0
    assert mapped[2] > exact[2]
    assert len(pictures) == 5
    sheet = soft_shadows.side_by_side(pictures)
    assert sheet.dtype == np.uint8
    assert sheet.shape[0] > 2 * 240


def tiny(out, **changes):
    options = plan_run("key_bits", preset="quick", device="cpu", out=out, size="16x16")
    return dataclasses.replace(options, preset=dataclasses.replace(options.preset, **changes))


@pytest.mark.parametrize("bits", BITS)
def test_a_trial_sorts_unsorted_keys_again_in_every_sample(bits, device):
    trial = Trial(3000, bits, device, seed=1)
    keys = trial.unsorted.view(np.uint32).astype(np.uint64)
    assert keys.max() < 2**bits
    assert keys.max() >= 2 ** (bits - 1), "the highest bit is used too"
    assert trial.wrong() > 0, "nothing is sorted yet"
    found = sample_frame(trial, Sampling(samples=3, most=3, stage_samples=2, budget_s=5.0))
    assert (trial.wrong(), len(found.total_ms)) == (0, 3)
    assert [(p["name"], len(p["ms"])) for p in found.passes] == [("copy pairs", 2), ("sort pairs", 2)]
    trial.passes[0].run()  # the copy puts the unsorted pairs back: no sample sorts what is sorted
    assert trial.wrong() > 0


def test_the_same_random_keys_and_pairs_for_all_numbers_of_bits():
    trials = [Trial(500, bits, "cpu", seed=2) for bits in (8, 18, 32)]
    whole = trials[2].unsorted.view(np.uint32)
    for trial in trials:
        assert (trial.unsorted.view(np.uint32) == whole >> np.uint32(32 - trial.bits)).all()


def test_key_bits_runs_draws_goes_on_and_is_read(tmp_path):
    options = tiny(tmp_path / "out", samples=2, most=2, stage_samples=1, rounds=2)
    measure = EXPERIMENT.measure
    records = measure(options, Silent())
    assert ([r.point["bits"] for r in records], {r.point["pairs"] for r in records}) == (list(BITS), {256})
    assert all(len(r.frames[0].total_ms) == 4 for r in records), "two rounds of two samples"
    orders = [[r.rounds[k]["place"] for r in records] for k in range(2)]
    assert orders[0] != orders[1], "rounds are interleaved in another order each"
    assert [r.key for r in measure(options, Silent())] == [r.key for r in records]
    assert len(list((tmp_path / "out" / "records").glob("*.json"))) == len(BITS), "nothing was measured again"
    files = show("key_bits", tmp_path / "out", quiet=True)
    assert {f.name for f in files} == {"key_bits.csv", "key_bits.svg", "key_bits.md"}
    text = (tmp_path / "out" / "key_bits.md").read_text()
    assert "| sorted | 8 bits | 12 bits | 16 bits | 18 bits | 20 bits | 24 bits | 32 bits |" in text
    assert "| 256 pairs | " in text
    assert re.search(r"A sort by 18 bits, the paper's, takes \S+ times as long for 256 pairs as one by 32\.", text)
    assert "Every answer behind these times was found right" in text
    assert len((tmp_path / "out" / "key_bits.csv").read_text().splitlines()) == 1 + len(BITS)
    (evidence,) = collect(tmp_path).evidence("key_bits")
    assert len(evidence.frames) == len(BITS)


def test_key_bits_takes_no_scene_and_no_method(tmp_path):
    for asked in ({"scenes": [write_scene(tmp_path / "tetra.obj")]}, {"methods": ["warp_bvh"]}):
        options = plan_run("key_bits", preset="quick", device="cpu", out=tmp_path / "out", **asked)
        with pytest.raises(UserError, match="takes no --scene and no --method"):
            EXPERIMENT.measure(options, Silent())


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
        record_of("kept_trees", entry, "conference", lighting, ms=2 * ms if entry is STATIC[0] else ms)
        for entry in STATIC
        for lighting, ms in zip(LIGHTINGS, (3.0, 1.0, 2.0), strict=True)
    ]
    text = report_of("kept_trees", tmp_path, [*trees(0.25), *made])
    assert "| Conference (stand-in) | BVH2 static | 3.03 | 1.01 | 2.02 |" in text
    assert "tree of frame 15: no record" not in text
    said = "A static tree's frame over a rebuilt one's, by what has moved: on Conference (stand-in) "
    said += "0.500 (everything), 0.500 (light) and 0.500 (camera)."
    assert said in text
    other = report_of("kept_trees", tmp_path / "still", made)
    assert said in other
    assert "A kept tree takes" not in other
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
