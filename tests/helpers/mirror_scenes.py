"""Scenes with mirrors, and the methods that are tried on them."""

import dataclasses

import numpy as np
import pytest
from helpers import brute_force
from helpers.method_trials import box
from shadowbench.harness.frame.registry import make_method
from shadowbench.harness.frame.session import Session
from shadowbench.harness.judge.reference import embree_installed
from shadowbench.harness.scene.prepared import Prepared, prepare
from shadowbench.harness.scene.scene import Light, Spot

SIZE = 24
EXACT = [("uniform_grid", {}), ("warp_bvh", {"update": "bvh_rebuild"})]
INEXACT = [("warp_bvh", {"update": "rebuild"}), ("warp_bvh", {"update": "refit"}), ("embree", {})]

needs_embree = pytest.mark.skipif(not embree_installed(), reason="the reference needs Embree")


def with_mirrors(prepared: Prepared, mirror: np.ndarray, bounces: int, **changes) -> Prepared:
    """The scene with mirrors: ``mirror`` [triangles] is 1 where a triangle is one."""
    scene = dataclasses.replace(prepared.scene, mirror=lambda g: mirror, bounces=bounces, **changes)
    return prepare(scene)


def ball(centre, radius: float, rings: int = 9) -> tuple[np.ndarray, np.ndarray]:
    """A sphere of 4 rings^2 triangles or so, its corners nowhere special."""
    u, v = np.meshgrid(np.linspace(0, np.pi, rings), np.linspace(0, 2 * np.pi, 2 * rings) + 0.1)
    vertices = np.stack([np.sin(u) * np.cos(v), np.cos(u), np.sin(u) * np.sin(v)], -1).reshape(-1, 3)
    index = np.arange(u.size).reshape(u.shape)
    a, b, c, d = index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]
    faces = np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)])
    return vertices * radius + centre, faces


def plane_and_ball(bounces: int = 1) -> Prepared:
    """A mirror in the plane z = 0 that a camera looks down on, and a ball beside the camera that only it shows."""
    vertices, faces = ball((0.4, 0.3, 3.6), 0.7)
    ground = np.array([[-4.0, -4, 0], [4, -4, 0], [4, 4, 0], [-4, 4, 0]])
    prepared = brute_force.make_scene(
        np.concatenate([ground, vertices]),
        np.concatenate([[[0, 1, 2], [0, 2, 3]], faces + 4]),
        [(3.0, 2.0, 5.0)],
        eye=(-1.0, -0.5, 2.0),
        target=(-0.3, -0.1, 0.0),
    )
    return with_mirrors(prepared, (np.arange(len(faces) + 2) < 2).astype(np.uint8), bounces)


def hall_of_mirrors(bounces: int = 3) -> Prepared:
    """A box of mirrors seen from within, with triangles floating in it that are none; lights of every kind."""
    walls, sides = box(3)
    vertices, faces = brute_force.soup(5, 40, size=0.15, spread=0.6)
    lights = [
        Light((0.3, 0.5, 0.4)),
        Light((-0.4, 0.6, 0.2), spot=Spot((0.2, -1.0, 0.1), 50.0)),
        Light((1.0, 2.0, 0.5), directional=True),
        Light((0.1, 0.1, 0.7), shadows=False),
    ]
    prepared = brute_force.make_scene(
        np.concatenate([walls, vertices]),
        np.concatenate([sides, faces + len(walls)]),
        lights,
        eye=(0.21, 0.13, 0.83),
        target=(-0.1, 0.05, -0.3),
        fov=70.0,
    )
    mirror = (np.arange(len(sides) + len(faces)) < len(sides)).astype(np.uint8)
    return with_mirrors(prepared, mirror, bounces, facing=True)


def answered(name, settings, prepared, device="cpu", size=SIZE):
    moment = prepared.moment(0, size, size)
    return moment, Session(make_method(name, settings), prepared, size, size, device).answers(moment)
