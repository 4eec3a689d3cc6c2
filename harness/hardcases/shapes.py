"""Meshes of hard cases: points [n, 3] and faces [m, 3] from plain numbers."""

from typing import Any

import numpy as np

from ..arrays import F64, I64

Mesh = tuple[F64, I64]

Point = Any  # three numbers: a tuple or an array


def pixel_centres(count: int, half: float = 1.0) -> F64:
    """The pixel centres on the image plane at distance 1, from -half to half: odd multiples of half / count."""
    return (2 * np.arange(count) + 1 - count) / count * half


def float32_of(values: object) -> F64:
    """Numbers that float32 holds exactly."""
    return np.asarray(values, dtype=np.float32).astype(np.float64)


def triangles(*corners: Any) -> Mesh:
    """Triangles from their corners, without shared vertices."""
    points = np.asarray(corners, dtype=np.float64).reshape(-1, 3)
    return points, np.arange(len(points)).reshape(-1, 3)


def quad(a: Any, b: Any, c: Any, d: Any) -> Mesh:
    """Two triangles that share the edge ac."""
    return np.asarray([a, b, c, d], dtype=np.float64), np.array([(0, 1, 2), (0, 2, 3)])


def plane(axis: int, at: float, half: float) -> Mesh:
    """A square perpendicular to ``axis`` about its point ``at``."""
    sides = half * np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)])
    return quad(*np.roll(np.insert(sides, 0, at, axis=1), axis, axis=1))


def joined(*meshes: Mesh) -> Mesh:
    """Several meshes as one; faces keep their order."""
    points, faces, first = [], [], 0
    for vertices, own in meshes:
        points.append(np.asarray(vertices, dtype=np.float64).reshape(-1, 3))
        faces.append(np.asarray(own, dtype=np.int64).reshape(-1, 3) + first)
        first += len(points[-1])
    return np.concatenate(points), np.concatenate(faces)


def box(low: Any, high: Any) -> Mesh:
    """A closed box of twelve triangles that face outwards."""
    low, high = np.broadcast_to(low, 3), np.broadcast_to(high, 3)
    corners = np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)])
    sides = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = [t for a, b, c, d in sides for t in ((a, b, c), (a, c, d))]
    return low + corners * (high - low), np.array(faces)


def sheet(x: Any, y: Any, depth: Any) -> Mesh:
    """A welded grid of triangles in front of the origin, seen along -z. ``x`` [m], ``y`` [n]: coordinates on the image
    plane at distance 1. ``depth``: a number, or [n, m]. A vertex is depth * (x, y, -1), so it lies on the ray through
    (x, y) at any depth.
    """
    x, y = np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)
    across, along = np.meshgrid(x, y)
    depth = np.broadcast_to(np.asarray(depth, dtype=np.float64), across.shape)
    points = np.stack([across * depth, along * depth, -depth], axis=-1).reshape(-1, 3)
    index = np.arange(across.size).reshape(across.shape)
    a, b, c, d = index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]
    faces = np.concatenate([np.stack(f, axis=-1).reshape(-1, 3) for f in ((a, b, c), (a, c, d))])
    return points, faces


def lattice(x: Any, z: Any) -> Mesh:
    """A welded grid of triangles over ``x`` [n] by ``x``, at heights ``z``: a number, or [n, n]."""
    points, faces = sheet(x, x, 1.0)
    points[:, 2] = np.broadcast_to(z, (len(x), len(x))).ravel()
    return points, faces


def closed_behind(mesh: Mesh, tip: Any) -> Mesh:
    """A mesh whose border is closed by a cone to ``tip``; an eye between mesh and tip sees the surface all around."""
    points, faces = mesh
    edges = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    count = len(points)
    border = edges[~np.isin(edges[:, 0] * count + edges[:, 1], edges[:, 1] * count + edges[:, 0])]
    cone = np.concatenate([border[:, ::-1], np.full((len(border), 1), count)], axis=1)
    return np.concatenate([points, [tip]]), np.concatenate([faces, cone])


def split(mesh: Mesh) -> Mesh:
    """The same triangles without shared vertices, as from a file that does not share them."""
    return triangles(mesh[0][mesh[1]])


def welded(points: F64, faces: I64) -> Mesh:
    """The same triangles with shared vertices."""
    found, of = np.unique(points, axis=0, return_inverse=True)
    return found, of.reshape(-1)[faces]


def moved(mesh: Mesh, by: Any, scale: float = 1.0) -> Mesh:
    return mesh[0] * scale + np.asarray(by, dtype=np.float64), mesh[1]


def fan(tip: Any, ring: Any) -> Mesh:
    """Triangles from a tip to each side of a closed ring of points, without shared vertices."""
    ring = np.asarray(ring, dtype=np.float64)
    return triangles(np.stack([np.broadcast_to(tip, ring.shape), ring, np.roll(ring, -1, axis=0)], axis=1))


def ball(radius: float, centre: Any, rings: int = 6, sectors: int = 9) -> Mesh:
    across, around = np.pi * np.arange(1, rings) / rings, 2 * np.pi * np.arange(sectors) / sectors
    level = np.repeat(np.cos(across)[:, None], sectors, axis=1)
    circles = [np.outer(np.sin(across), np.cos(around)), level, np.outer(np.sin(across), np.sin(around))]
    belt = np.stack(circles, axis=-1).reshape(-1, 3)
    points = np.concatenate([[(0.0, 1.0, 0.0)], belt, [(0.0, -1.0, 0.0)]]) * radius + np.asarray(centre)
    last, top = len(points) - 1, 1 + (rings - 2) * sectors
    sides = [(j, (j + 1) % sectors) for j in range(sectors)]
    faces = [(0, 1 + k, 1 + j) for j, k in sides]
    for first in range(1, top, sectors):
        for p, q in ((first + j, first + k) for j, k in sides):
            faces += [(p, q, p + sectors), (q, q + sectors, p + sectors)]
    faces += [(last, top + j, top + k) for j, k in sides]
    return points, np.array(faces)


FLOOR = quad((-3, 0, -3), (3, 0, -3), (3, 0, 3), (-3, 0, 3))


def ball_on_floor() -> Mesh:
    return joined(FLOOR, ball(0.5, (0, 0.6, 0)))


def icosphere(times: int) -> Mesh:
    """The unit sphere as an icosahedron whose triangles are repeatedly split into four."""
    g = (1 + 5**0.5) / 2
    points = [p for a in (-1.0, 1.0) for b in (-g, g) for p in ((0, a, b), (a, b, 0), (b, 0, a))]
    corners = np.array(points) / np.hypot(1, g)
    near = np.linalg.norm(corners[:, None] - corners, axis=-1) < 1.1  # an edge is 1.05 long
    faces = [
        (i, j, k) if np.linalg.det(corners[[i, j, k]]) > 0 else (i, k, j)
        for i in range(12) for j in range(i + 1, 12) for k in range(j + 1, 12) if near[i, j] and near[j, k] and near[k, i]
    ]  # fmt: skip
    whole, triangles = corners, np.array(faces)
    for _ in range(times):
        edges = np.sort(triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
        unique, middle = np.unique(edges, axis=0, return_inverse=True)
        middles = whole[unique].sum(axis=1)
        ab, bc, ca = (middle.reshape(-1, 3) + len(whole)).T
        whole = np.concatenate([whole, middles / np.linalg.norm(middles, axis=1, keepdims=True)])
        a, b, c = triangles.T
        parts = ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))
        triangles = np.concatenate([np.stack(part, axis=-1) for part in parts])
    return whole, triangles


def soup(seed: int, count: int, size: float = 0.4, spread: float = 1.0) -> Mesh:
    """Random triangles of mixed sizes around the origin."""
    random = np.random.default_rng(seed)
    centre = random.uniform(-spread, spread, (count, 1, 3))
    arms = random.normal(size=(count, 3, 3)) * size * np.exp(random.uniform(-3, 0.7, (count, 1, 1)))
    return triangles(centre + arms)
