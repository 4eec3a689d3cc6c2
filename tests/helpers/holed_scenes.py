"""Scenes whose triangles have holes, and what answers them exactly."""

from functools import cache

from helpers.judged_hard_cases import exact_methods
from helpers.small_scenes import make_scene, trace
from shadowbench.harness.frame.registry import make_method
from shadowbench.harness.hardcases.shapes import ball_on_floor
from shadowbench.harness.judge.context import Judge
from shadowbench.harness.scene.moment import Moment
from shadowbench.harness.scene.overrides import perforated
from shadowbench.harness.scene.prepared import Prepared

SIZE = (24, 18)
EXACT = [
    *((name, given) for name, given in exact_methods() if "alpha" in make_method(name, given).simulates),
    ("hybrid", {}),
    ("ray_grids", {"trial": "inline_cells=0"}),
    ("visibility_buffer", {"trial": "inline_pixels=0+inline_cells=0"}),
    ("perspective_spherical", {"light_map": "cube", "clamp": "none", "triangle_chunk": "3"}),
]
NAMES = ["-".join([name, *(f"{k}={v}" for k, v in settings.items())]) for name, settings in EXACT]


def make(mesh, alpha, lights=((1.0, 2.5, 0.5), (0.1, 0.7, 0.05)), eye=(0.3, 1.7, 3.1), target=(0.2, 0.25, 0.1)):
    return make_scene(*mesh, list(lights), eye, target, 45.0, alpha=alpha)


@cache
def holed() -> tuple[Prepared, Moment, Judge]:
    """A chequered ball on a half chequered floor, one light outside, one inside the ball."""
    prepared = make(ball_on_floor(), lambda geometry: perforated(geometry, 2, 6))
    moment = prepared.moment(0, *SIZE)
    return prepared, moment, Judge.of(prepared, moment)


def answers_of(name: str, settings: dict, prepared: Prepared, size=SIZE, device="cpu"):
    return trace(name, settings, prepared, *size, device)[2]


def same(one, other) -> list[str]:
    return [name for name in one if one[name].tobytes() != other[name].tobytes()]
