"""The report of soft shadows, from made-up records: who overtakes whom, fronts, errors; and the errors of a small scene."""

from types import SimpleNamespace

import numpy as np
import pytest
from helpers.experiment_records import record_of, report_of
from shadowbench.experiments import soft_shadows
from shadowbench.harness.commands.run import plan_run
from shadowbench.harness.errors import CapacityRejected, UserError
from shadowbench.harness.frame.registry import make_method
from shadowbench.harness.hardcases.case import view
from shadowbench.harness.hardcases.shapes import ball, joined, plane
from shadowbench.harness.runner.planning.experiment import Entry
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


@pytest.mark.parametrize(("tree", "words"), [(2.0, "not up to 16 on "), (-2.5, "at 1 already on ")])
def test_a_tree_that_never_or_always_wins_is_said(tmp_path, tree, words):
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
