"""Meshes from which the procedural stand-ins are composed. Every function returns a :class:`Mesh`: float64 vertices in
metres, int32 faces, counter-clockwise seen from outside. y is up. Only :func:`noise` draws random numbers, and it takes
its seed: same call, same bytes.
"""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ...arrays import F64, I32, Ints


class Mesh(NamedTuple):
    """``vertices`` float64 [vertex_count, 3] in metres; ``faces`` int32 [triangle_count, 3]."""

    vertices: F64
    faces: I32


def join(meshes: Iterable[Mesh]) -> Mesh:
    """All meshes as one, in the order given; vertices are not merged."""
    parts = list(meshes)
    if not parts:
        return Mesh(np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int32))
    starts = np.cumsum([0] + [len(part.vertices) for part in parts])
    faces = [part.faces + start for part, start in zip(parts, starts, strict=False)]
    return Mesh(np.concatenate([part.vertices for part in parts]), np.concatenate(faces).astype(np.int32))


def flip(mesh: Mesh) -> Mesh:
    """The same surface facing the other way: a box becomes a room."""
    return Mesh(mesh.vertices, np.ascontiguousarray(mesh.faces[:, ::-1]))


def transform(
    mesh: Mesh, *, scale: float | Sequence[float] | None = None, rotate: tuple[Sequence[float], float] | None = None,
    translate: Sequence[float] | None = None,
) -> Mesh:  # fmt: skip
    """The mesh scaled, then rotated (axis, degrees; right-handed), then moved; mirrored faces are turned."""
    linear = np.eye(3)
    if scale is not None:
        linear = np.diag(np.broadcast_to(np.asarray(scale, dtype=np.float64), 3))
    if rotate is not None:
        linear = rotation(*rotate) @ linear
    shift = np.asarray((0.0, 0.0, 0.0) if translate is None else translate, dtype=np.float64)
    moved = Mesh(_dot(mesh.vertices, linear) + shift, mesh.faces)
    return flip(moved) if np.linalg.det(linear) < 0 else moved


def place(mesh: Mesh, x: float, y: float, z: float, turn: float = 0.0) -> Mesh:
    """The mesh turned about the vertical by degrees, then moved to (x, y, z)."""
    return transform(mesh, rotate=((0.0, 1.0, 0.0), turn), translate=(x, y, z))


def _dot(points: F64, linear: F64) -> F64:
    """``points @ linear.T`` term by term: a BLAS may order the sums differently on another machine."""
    x, y, z = points[:, 0:1], points[:, 1:2], points[:, 2:3]
    return x * linear[:, 0] + y * linear[:, 1] + z * linear[:, 2]


def rotation(axis: Sequence[float], degrees: float) -> F64:
    """The 3x3 matrix that turns column vectors about ``axis`` by the right-hand rule."""
    x, y, z = np.asarray(axis, dtype=np.float64) / np.linalg.norm(axis)
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    angle = np.radians(degrees)
    return np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * (cross @ cross)


def patch(points: ArrayLike, wrap_u: bool = False, wrap_v: bool = False) -> Mesh:
    """A surface through points [nu, nv, 3], facing along (d/du) x (d/dv); ``wrap_u``, ``wrap_v`` close it."""
    net = np.asarray(points, dtype=np.float64)
    nu, nv = net.shape[:2]
    i = np.arange(nu if wrap_u else nu - 1)[:, None]
    j = np.arange(nv if wrap_v else nv - 1)[None, :]
    i1, j1 = (i + 1) % nu, (j + 1) % nv
    a, b, c, d = i * nv + j, i1 * nv + j, i1 * nv + j1, i * nv + j1
    faces = np.stack([a, b, c, a, c, d], axis=-1).reshape(-1, 3)
    return Mesh(net.reshape(-1, 3).copy(), faces.astype(np.int32))


def grid(origin: Sequence[float], u: Sequence[float], v: Sequence[float], nu: int = 1, nv: int = 1) -> Mesh:
    """A parallelogram from ``origin`` along edges ``u`` and ``v`` in nu x nv quads, facing along u x v."""
    s = np.linspace(0.0, 1.0, nu + 1)[:, None, None]
    t = np.linspace(0.0, 1.0, nv + 1)[None, :, None]
    return patch(np.asarray(origin, dtype=np.float64) + s * np.asarray(u, dtype=float) + t * np.asarray(v, dtype=float))


def box(low: Sequence[float], high: Sequence[float]) -> Mesh:
    """An axis-aligned box: 8 vertices, 12 triangles facing out."""
    (x0, y0, z0), (x1, y1, z1) = low, high
    corners = [[x, y, z] for x in (x0, x1) for y in (y0, y1) for z in (z0, z1)]
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = [triangle for a, b, c, d in quads for triangle in ((a, b, c), (a, c, d))]
    return Mesh(np.array(corners, dtype=np.float64), np.array(faces, dtype=np.int32))


def pairs(*values: float) -> F64:
    """A profile (radius, y), (radius, y), ... written in one row."""
    return np.array(values).reshape(-1, 2)


def lathe(profile: ArrayLike, segments: int, start: float = 0.0, sweep: float = 360.0) -> Mesh:
    """A profile [(radius, y), ...], listed upwards for a surface facing out, turned about the y axis. A first or last
    radius of 0 becomes one pole vertex, so the surface can be closed. ``start`` and ``sweep`` in degrees; less than a
    full sweep leaves an open surface (no poles are merged then).
    """
    line = np.asarray(profile, dtype=np.float64)
    full = sweep >= 360.0
    angle = np.radians(start + sweep * np.arange(segments + (not full)) / segments)
    bottom, top = full and line[0, 0] == 0.0, full and line[-1, 0] == 0.0
    rings = line[int(bottom) : len(line) - int(top)]
    radius, height = rings[:, 0, None], np.broadcast_to(rings[:, 1, None], (len(rings), len(angle)))
    net = np.stack([radius * np.sin(angle), height, radius * np.cos(angle)], axis=-1)
    # u runs around, v upwards: their cross product points away from the axis.
    body = patch(net.transpose(1, 0, 2), wrap_u=full)
    vertices, faces = [body.vertices], [body.faces]
    foot = np.arange(len(angle)) * len(rings)
    head = foot + len(rings) - 1
    if bottom:
        faces.append(_fan(np.roll(foot, -1), foot, len(body.vertices)))
        vertices.append(np.array([[0.0, line[0, 1], 0.0]]))
    if top:
        faces.append(_fan(head, np.roll(head, -1), len(body.vertices) + int(bottom)))
        vertices.append(np.array([[0.0, line[-1, 1], 0.0]]))
    return Mesh(np.concatenate(vertices), np.concatenate(faces))


def _fan(first: Ints, second: Ints, pole: int) -> I32:
    """Triangles from each edge (first, second) to one pole vertex."""
    return np.stack([first, second, np.full(len(first), pole)], axis=-1).astype(np.int32)


def cylinder(
    radius: float, height: float, segments: int, rings: int = 1, caps: bool = True, top: float | None = None
) -> Mesh:
    """A cylinder or a cone frustum of upper radius ``top``, from y = 0 to ``height``; closed if ``caps``."""
    end = radius if top is None else top
    side = list(zip(np.linspace(radius, end, rings + 1), np.linspace(0.0, height, rings + 1), strict=True))
    return lathe([(0.0, 0.0), *side, (0.0, height)] if caps else side, segments)


def sphere(radius: float, segments: int, rings: int | None = None) -> Mesh:
    """A closed sphere about the origin; ``rings`` bands from pole to pole (default: half of ``segments``)."""
    bands = rings or max(2, segments // 2)
    angle = np.pi * np.arange(bands + 1) / bands
    profile = np.stack([radius * np.sin(angle), -radius * np.cos(angle)], axis=-1)
    profile[[0, -1], 0] = 0.0
    return lathe(profile, segments)


def cushion(size: Sequence[float], segments: int, rings: int | None = None, power: float = 0.5) -> Mesh:
    """A closed box of the given outer size with round edges; power 1: an ellipsoid, towards 0: a box."""
    ball = sphere(1.0, segments, rings)
    soft = np.sign(ball.vertices) * np.abs(ball.vertices) ** power
    # Poles and near-zero coordinates keep their sign and order, so no triangle turns over.
    return Mesh(soft / np.abs(soft).max(axis=0) * np.asarray(size, dtype=np.float64) / 2, ball.faces)


def tube(path: ArrayLike, radius: float | ArrayLike, segments: int, closed: bool = False, caps: bool = True) -> Mesh:
    """A tube along a path [n, 3] without repeats and reversals; ``radius`` may be [n]; ``closed``: a loop."""
    line = np.asarray(path, dtype=np.float64)
    if closed:
        ahead = np.roll(line, -1, axis=0) - np.roll(line, 1, axis=0)
    else:
        ahead = np.gradient(line, axis=0)
    ahead = ahead / np.linalg.norm(ahead, axis=1, keepdims=True)
    side = np.zeros_like(line)
    least = np.eye(3)[np.argmin(np.abs(ahead[0]))]
    side[0] = least - ahead[0] * (least * ahead[0]).sum()
    side[0] /= np.linalg.norm(side[0])
    for k in range(1, len(line)):
        # Turn the side by the smallest rotation from one direction to the next, so that the tube does not twist.
        old, new, bent = ahead[k - 1], ahead[k], side[k - 1]
        side[k] = bent - (bent * new).sum() / (1.0 + (old * new).sum()) * (old + new)
    other = np.cross(ahead, side)
    angle = 2 * np.pi * np.arange(segments)[:, None, None] / segments
    reach = np.broadcast_to(np.asarray(radius, dtype=np.float64), len(line))[None, :, None]
    mesh = patch(line + reach * (np.cos(angle) * side + np.sin(angle) * other), wrap_u=True, wrap_v=closed)
    if closed or not caps:
        return mesh
    foot, count = np.arange(segments) * len(line), len(mesh.vertices)
    head = foot + len(line) - 1
    ends = [_fan(np.roll(foot, -1), foot, count), _fan(head, np.roll(head, -1), count + 1)]
    faces = np.concatenate([mesh.faces, *ends])
    return Mesh(np.concatenate([mesh.vertices, line[[0, -1]]]), faces)


def noise(points: ArrayLike, seed: int, octaves: int = 1) -> F64:
    """Smooth value noise at points [..., 3], float64 [...], within -1..1; lattice spacing 1, period 32. Each further
    octave has twice the frequency and half the amplitude of the one before.
    """
    where = np.asarray(points, dtype=np.float64)
    table = np.random.default_rng(seed).uniform(-1.0, 1.0, 32**3)
    total, weight = np.zeros(where.shape[:-1]), 0.0
    for octave in range(octaves):
        place = where * 2.0**octave + 7.31 * octave
        cell = np.floor(place)
        part = place - cell
        part = part * part * (3.0 - 2.0 * part)
        low = cell.astype(np.int64) & 31
        high = (low + 1) & 31
        value = np.zeros(where.shape[:-1])
        for corner in range(8):
            picked, share = [], np.ones(where.shape[:-1])
            for axis in range(3):
                upper = corner >> axis & 1
                picked.append((high if upper else low)[..., axis])
                share = share * (part[..., axis] if upper else 1.0 - part[..., axis])
            value += share * table[(picked[0] * 32 + picked[1]) * 32 + picked[2]]
        total += 0.5**octave * value
        weight += 0.5**octave
    return total / weight
