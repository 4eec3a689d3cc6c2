"""Lights with an area have no error on real meshes either: every target of every exact method, against the exact referee."""

import pytest
from helpers.judged_hard_cases import EVERYTHING, exact_methods
from helpers.real_scenes import MESHES, needs_real
from shadowbench.harness import api
from shadowbench.harness.scene.overrides import Lighting

QUICK = ("teapot", "cornell_box_water")
FEW = ("ray_grids", "bvh2", "visibility_buffer", "uniform_grid")
SOFT = {
    "a ball inside": Lighting("ball", count=1, size=0.2, samples=16 if EVERYTHING else 4, distance=0.3),
    "two balls": Lighting("balls", count=2, size=0.08, samples=4 if EVERYTHING else 2),
}
SIDE = 256 if EVERYTHING else 48


@needs_real
@pytest.mark.parametrize("soft", SOFT)
@pytest.mark.parametrize("path", [one for one in MESHES if EVERYTHING or one.stem in QUICK], ids=lambda path: path.stem)
def test_exact_methods_have_no_error_under_soft_lights(path, soft, device):
    prepared = SOFT[soft].applied(api.prepare(api.resolve(str(path))))
    moment = prepared.moment(0, SIDE, SIDE)
    judge = api.Judge.of(prepared, moment, device=device)
    targets = sum(light.samples for light in prepared.scene.lights)
    for name, settings in exact_methods():
        if device.split(":")[0] in api.make_method(name, settings).devices and (EVERYTHING or name in FEW):
            answers = api.Session(api.make_method(name, settings), prepared, SIDE, SIDE, device).answers(moment)
            score = api.score_answers(judge, answers).score
            assert (score.true_errors, len(score.shadow)) == (0, targets), (name, score.examples[:2])
    assert 0 < judge.reference.shadowed.sum() < judge.reference.shadowed.size
