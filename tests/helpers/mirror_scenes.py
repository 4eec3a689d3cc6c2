"""Scenes with mirrors, and the methods that are tried on them."""

import dataclasses

import numpy as np
import pytest
from helpers.method_trials import box
from helpers.small_scenes import make_scene, soup, trace
from shadowbench.harness.hardcases.shapes import Mesh, ball, joined, quad
from shadowbench.harness.judge.reference import embree_installed
from shadowbench.harness.scene.prepared import Prepared, prepare
from shadowbench.harness.scene.scene import Light, Spot

SIZE, FLOATING = 24, 40
EXACT = [("uniform_grid", {}), ("warp_bvh", {"update": "bvh_rebuild"})]
INEXACT = [("warp_bvh", {"update": "rebuild"}), ("warp_bvh", {"update": "refit"}), ("embree", {})]

needs_embree = pytest.mark.skipif(not embree_installed(), reason="the reference needs Embree")


def with_mirrors(prepared: Prepared, mirror: np.ndarray, bounces: int, **changes) -> Prepared:
    """The scene with mirrors: ``mirror`` [triangles] is 1 where a triangle is one."""
    scene = dataclasses.replace(prepared.scene, mirror=lambda g: mirror, bounces=bounces, **changes)
    return prepare(scene)


def plane_and_ball(bounces: int = 1) -> Prepared:
    """A mirror in the plane z = 0 that a camera looks down on, and a ball beside the camera that only it shows."""
    mesh = joined(quad((-4, -4, 0), (4, -4, 0), (4, 4, 0), (-4, 4, 0)), ball(0.7, (0.4, 0.3, 3.6), 8, 17))
    prepared = make_scene(*mesh, [(3.0, 2.0, 5.0)], (-1.0, -0.5, 2.0), (-0.3, -0.1, 0.0))
    return with_mirrors(prepared, (np.arange(len(mesh[1])) < 2).astype(np.uint8), bounces)


def seen_from_within(walls: Mesh, lights: list[Light]) -> Prepared:
    """A box with triangles floating in it, which come last: :data:`FLOATING` of them."""
    mesh = joined(walls, soup(5, FLOATING, size=0.15, spread=0.6))
    return make_scene(*mesh, lights, (0.21, 0.13, 0.83), (-0.1, 0.05, -0.3), 70.0)


def hall_of_mirrors(bounces: int = 3) -> Prepared:
    """A box of mirrors seen from within, with triangles floating in it that are none; lights of every kind."""
    lights = [
        Light((0.3, 0.5, 0.4)),
        Light((-0.4, 0.6, 0.2), spot=Spot((0.2, -1.0, 0.1), 50.0)),
        Light((1.0, 2.0, 0.5), directional=True),
        Light((0.1, 0.1, 0.7), shadows=False),
    ]
    prepared = seen_from_within(box(3), lights)
    number = np.arange(len(prepared.faces))
    return with_mirrors(prepared, (number < len(number) - FLOATING).astype(np.uint8), bounces, facing=True)


def answered(name, settings, prepared, device="cpu", size=SIZE):
    return trace(name, settings, prepared, size, size, device)[1:]
