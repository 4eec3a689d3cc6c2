"""Float64 brute force in numpy, written apart from the kernels, and small scenes to try methods on."""

import numpy as np
from numpy.typing import NDArray
from shadowbench.harness.scene.moment import Moment
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
) -> Prepared:
    """A static scene ready to trace."""
    points, triangles = (np.asarray(vertices, np.float64).reshape(-1, 3), np.asarray(faces, np.int32).reshape(-1, 3))
    return prepare(
        Scene(
            "test",
            "test",
            lambda: Geometry.static(points, triangles),
            Camera(eye, target, up, fov),
            tuple(at if isinstance(at, Light) else Light(at) for at in lights),
        )
    )


def soup(seed: int, count: int, size: float = 0.4, spread: float = 1.0) -> tuple[NDArray, NDArray]:
    """Random triangles of mixed sizes around the origin."""
    random = np.random.default_rng(seed)
    centre = random.uniform(-spread, spread, (count, 1, 3))
    arms = random.normal(size=(count, 3, 3)) * size * np.exp(random.uniform(-3, 0.7, (count, 1, 1)))
    return (centre + arms).reshape(-1, 3), np.arange(3 * count).reshape(-1, 3)


def closest(prepared: Prepared, moment: Moment) -> tuple[NDArray, NDArray]:
    """Triangle (-1 at a miss) and float64 t of every pixel, by all triangles; t within 2^-29 is a tie."""
    pixels = np.arange(moment.width * moment.height)
    o = moment.eye.astype(np.float64)
    d = moment.directions(pixels).astype(np.float64)
    best = np.full(len(pixels), -1)
    best_t = np.full(len(pixels), np.inf)
    for i, face in enumerate(prepared.faces):
        if not moment.valid[i]:
            continue
        a, b, c = (moment.points[v].astype(np.float64) for v in face)
        e = np.stack([d @ np.cross(b - o, c - o), d @ np.cross(c - o, a - o), d @ np.cross(a - o, b - o)])
        inside = (e >= 0).all(axis=0) | (e <= 0).all(axis=0)
        n = np.cross(b - a, c - a)
        det = d @ n
        with np.errstate(divide="ignore", invalid="ignore"):
            t = np.where(inside & (det != 0), (n @ (a - o)) / det, np.inf)
        t[~(t > 0)] = np.inf
        with np.errstate(divide="ignore"):
            nearer = (1 / t).view(np.uint64) >> 23 > (1 / best_t).view(np.uint64) >> 23
        best[nearer], best_t[nearer] = i, t[nearer]
    return best, best_t


def shadowed(prepared: Prepared, moment: Moment, light: int, best: NDArray, t: NDArray) -> NDArray:
    """Shadow bit of every pixel: does a triangle meet the open segment from the hit point to the light."""
    pixels = np.nonzero(best >= 0)[0]
    d = moment.directions(pixels).astype(np.float64)
    h = moment.eye.astype(np.float64) + d * t[pixels, None]
    to = moment.lights[light].astype(np.float64) - h
    bits = np.zeros(len(best), dtype=np.uint8)
    size = np.abs(h).max(initial=0) + np.abs(moment.eye).max()
    for i, face in enumerate(prepared.faces):
        if not moment.valid[i]:
            continue
        a, b, c = (moment.points[v].astype(np.float64) for v in face)
        n = np.cross(b - a, c - a)
        unit = n / np.linalg.norm(n)
        det = to @ n
        with np.errstate(divide="ignore", invalid="ignore"):
            s = ((a - h) @ n) / det
            p = h + to * s[:, None]
            w = np.stack([np.cross(c - b, p - b) @ n, np.cross(a - c, p - c) @ n, np.cross(b - a, p - a) @ n])
        off_plane = np.abs((a - h) @ unit) > 1e-13 * size
        bits[pixels[(w >= 0).all(axis=0) & (s > 0) & (s < 1 - 1e-15) & off_plane & (det != 0)]] = 1
    return bits
