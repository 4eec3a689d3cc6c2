"""Small scenes to try methods on."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from shadowbench.harness.scene.prepared import Prepared, prepare
from shadowbench.harness.scene.scene import Camera, Geometry, Light, Scene


def make_scene(
    vertices: NDArray,
    faces: NDArray,
    lights: list[tuple[float, float, float] | Light],
    eye: tuple[float, float, float] = (0.3, 0.2, 3.0),
    target: tuple[float, float, float] = (0.0, 0.0, 0.0),
    fov: float = 60.0,
    up: tuple[float, float, float] = (0.0, 1.0, 0.0),
    **more: Any,
) -> Prepared:
    """A static scene ready to trace. ``more``: other fields of :class:`Scene`."""
    points, triangles = (np.asarray(vertices, np.float64).reshape(-1, 3), np.asarray(faces, np.int32).reshape(-1, 3))
    return prepare(
        Scene(
            "test",
            "test",
            lambda: Geometry.static(points, triangles),
            Camera(eye, target, up, fov),
            tuple(at if isinstance(at, Light) else Light(at) for at in lights),
            **more,
        )
    )


def soup(seed: int, count: int, size: float = 0.4, spread: float = 1.0) -> tuple[NDArray, NDArray]:
    """Random triangles of mixed sizes around the origin."""
    random = np.random.default_rng(seed)
    centre = random.uniform(-spread, spread, (count, 1, 3))
    arms = random.normal(size=(count, 3, 3)) * size * np.exp(random.uniform(-3, 0.7, (count, 1, 1)))
    return (centre + arms).reshape(-1, 3), np.arange(3 * count).reshape(-1, 3)
