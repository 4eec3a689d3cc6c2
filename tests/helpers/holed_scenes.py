"""Scenes whose triangles have holes, and what answers them exactly."""

from functools import cache

import numpy as np
from shadowbench.harness.frame.registry import make_method
from shadowbench.harness.frame.session import Session
from shadowbench.harness.hardcases.shapes import ball_on_floor
from shadowbench.harness.judge.context import Judge
from shadowbench.harness.scene.moment import Moment
from shadowbench.harness.scene.prepared import Prepared, prepare
from shadowbench.harness.scene.scene import Camera, Geometry, Light, Scene
from shadowbench.harness.scene.surface_rules import perforated

SIZE = (24, 18)
EXACT = [
    ("uniform_grid", {}),
    ("two_level_grid", {}),
    ("kdtree", {}),
    ("warp_bvh", {"update": "bvh_rebuild"}),
    ("bvh2", {}),
    ("two_level_bvh", {}),
    ("hybrid", {}),
    ("hybrid", {"shadows": "tree"}),
    ("perspective_spherical", {}),
    ("ray_grids", {}),
    ("ray_grids", {"trial": "inline_cells=0"}),
    ("coherent_grid", {}),
    ("visibility_buffer", {}),
    ("visibility_buffer", {"trial": "inline_pixels=0+inline_cells=0"}),
    ("perspective_spherical", {"light_map": "cube", "clamp": "none", "triangle_chunk": "3"}),
]
NAMES = ["-".join([name, *(f"{k}={v}" for k, v in settings.items())]) for name, settings in EXACT]


def make(mesh, alpha, lights=((1.0, 2.5, 0.5), (0.1, 0.7, 0.05)), eye=(0.3, 1.7, 3.1), target=(0.2, 0.25, 0.1)):
    points, faces = np.asarray(mesh[0], dtype=np.float64), np.asarray(mesh[1], dtype=np.int32)
    return prepare(
        Scene(
            "holes", "Holes", lambda: Geometry.static(points, faces), Camera(eye, target),
            tuple(Light(tuple(light)) for light in lights), alpha=alpha,
        )
    )  # fmt: skip


@cache
def holed() -> tuple[Prepared, Moment, Judge]:
    """A chequered ball on a half chequered floor, one light outside, one inside the ball."""
    prepared = make(ball_on_floor(), lambda geometry: perforated(geometry, 2, 6))
    moment = prepared.moment(0, *SIZE)
    return prepared, moment, Judge.of(prepared, moment)


def answers_of(name: str, settings: dict, prepared: Prepared, size=SIZE, device="cpu"):
    moment = prepared.moment(0, *size)
    return Session(make_method(name, settings), prepared, *size, device).answers(moment)


def same(one, other) -> list[str]:
    return [name for name in one if one[name].tobytes() != other[name].tobytes()]
