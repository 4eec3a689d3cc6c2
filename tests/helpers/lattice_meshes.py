"""Meshes for the examples of :mod:`lattice_examples`, decoded from bytes: soups, sheets, and closed bodies."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

BOX = np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)])
BOX_SIDES = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
BOX_FACES = np.array([t for a, b, c, d in BOX_SIDES for t in ((a, b, c), (a, c, d))])
TETRAHEDRON_FACES = np.array([(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)])


class Bytes:
    """Reads numbers from bytes; zeros beyond the end."""

    def __init__(self, data: bytes):
        self.data, self.place = data, 0

    def take(self, count: int) -> NDArray[np.int64]:
        part = self.data[self.place : self.place + count]
        self.place += count
        return np.frombuffer(part.ljust(count, b"\0"), dtype=np.uint8).astype(np.int64)

    def below(self, limit: int) -> int:
        return int(self.take(1)[0]) % limit

    def choice(self, values: Sequence[Any]) -> Any:
        return values[self.below(len(values))]

    def coordinates(self, count: int) -> NDArray[np.int64]:
        """Lattice points [count, 3], |k| < 2^15: multiples of a coarse step, with a finer part now and then."""
        step, fine = self.choice((2048, 4096, 1024, 512, 8192, 256)), self.below(8)
        coarse = (self.take(3 * count) + 128) % 256 - 128  # 0 stays 0
        points = coarse.reshape(count, 3) * step
        if fine == 7:
            points += self.take(3 * count).reshape(count, 3) - 128
        return (points + 2**15 - 1) % (2**16 - 1) - (2**15 - 1)


@dataclass(frozen=True, eq=False)
class Mesh:
    """``points`` float64 [n, 3], ``faces`` [m, 3].

    ``bodies``: for a mesh of closed convex bodies, all wound outwards, the body of each triangle, -1 for what has no
    area; None for any other mesh.
    """

    points: NDArray[np.float64]
    faces: NDArray[np.int32]
    bodies: NDArray[np.int32] | None = None

    def ahead(self, source: Bytes, eye: NDArray, axis: int, sign: float) -> Mesh:
        """Most meshes are folded to lie before the eye, where it sees more of them; the others may surround it."""
        if not source.below(4):
            return self
        points = self.points.copy()
        points[:, axis] = eye[axis] + sign * np.abs(points[:, axis] - eye[axis])
        return replace(self, points=points)

    def twisted(self, source: Bytes) -> Mesh:
        """Half of the meshes get an oddity that changes no surface, or flattens it."""
        points, faces = self.points, self.faces
        bodies = np.zeros(len(faces), dtype=np.int32) if self.bodies is None else self.bodies
        twist = source.below(8)
        if twist == 1:  # duplicates, in another vertex order
            faces, bodies = np.concatenate([faces, faces[:, [1, 2, 0]]]), np.tile(bodies, 2)
        elif twist == 2:  # every triangle has vertices of its own
            points, faces = points[faces].reshape(-1, 3), np.arange(3 * len(faces)).reshape(-1, 3)
        elif twist == 3:  # points and lines among them
            faces = np.concatenate([faces[:, [0, 0, 1]], faces, faces[:, [2, 2, 2]]])
            none = np.full(len(bodies), -1, dtype=np.int32)
            bodies = np.concatenate([none, bodies, none])
        elif twist == 4:  # slivers: all but flattened along one axis
            points = points.copy()
            points[:, source.below(3)] /= 4096.0
        elif twist == 5:
            faces, bodies = faces[::-1], bodies[::-1]
        faces = np.ascontiguousarray(faces, dtype=np.int32)
        return Mesh(points.astype(np.float64), faces, None if self.bodies is None else bodies.copy())

    def outwards(self) -> Mesh:
        """The bodies wound outwards, as their volumes say."""
        assert self.bodies is not None
        faces = self.faces.copy()
        for body in range(self.bodies.max() + 1):
            own = self.bodies == body
            a, b, c = (self.points[self.faces[own, i]] for i in range(3))
            if np.einsum("ij,ij->i", a - a[0], np.cross(b - a[0], c - a[0])).sum() < 0:
                faces[own] = faces[own][:, ::-1]
        return replace(self, faces=faces)


def draw_mesh(
    source: Bytes, eye: NDArray, axis: int, sign: float, half: float, size: tuple[int, int], closed: bool
) -> Mesh:
    """A mesh before an eye that looks along ``axis``; ``closed``: of closed bodies."""
    kind = source.below(8)
    if closed:
        mesh = _bodies(source).ahead(source, eye, axis, sign).outwards()
    elif kind in (0, 1):
        mesh = _soup(source).ahead(source, eye, axis, sign)
    elif kind in (2, 3, 4):
        mesh = _sheet(source, eye, axis, sign, half, size)
    elif kind == 5:
        mesh = _boxes(source).ahead(source, eye, axis, sign).outwards()
    else:
        one = _soup(source).ahead(source, eye, axis, sign)
        two = _sheet(source, eye, axis, sign, half, size)
        mesh = joined([one, two])
    return mesh.twisted(source)


def joined(meshes: Sequence[Mesh]) -> Mesh:
    """Meshes as one."""
    first = np.cumsum([0, *(len(mesh.points) for mesh in meshes)])
    faces = [mesh.faces + start for mesh, start in zip(meshes, first, strict=False)]
    return Mesh(np.concatenate([mesh.points for mesh in meshes]), np.concatenate(faces))


def _soup(source: Bytes) -> Mesh:
    """A few lattice vertices, and triangles among them: they share vertices and edges, and cross."""
    vertices = 3 + source.below(14)
    points = source.coordinates(vertices).astype(np.float64)
    faces = source.take(3 * (1 + source.below(20))).reshape(-1, 3)
    return Mesh(points, (faces + [0, 1, 2]) % vertices)


def _sheet(source: Bytes, eye: NDArray, axis: int, sign: float, half: float, size: tuple[int, int]) -> Mesh:
    """A grid whose vertices lie on rays of pixels, at mixed depths: seen from the eye it has no holes."""
    every, across, along = 1 + source.below(4), 2 + source.below(4), 2 + source.below(4)
    width, height = size
    start = source.below(max(1, width // 2)), source.below(max(1, height // 2))
    pixel = half / height
    x = (2 * (start[0] + every * np.arange(across)) + 1 - width) * pixel
    y = (2 * (start[1] + every * np.arange(along)) + 1 - height) * pixel
    depth = 4096.0 * (1 + source.take(across * along).reshape(along, across) % 8)
    up = np.zeros(3)
    up[(axis + 1) % 3] = 1.0
    forward = np.zeros(3)
    forward[axis] = sign
    right = np.cross(forward, up)
    rays = forward + x[None, :, None] * right - y[:, None, None] * up
    points = (eye + rays * depth[..., None]).reshape(-1, 3)
    index = np.arange(across * along).reshape(along, across)
    a, b, c, d = index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]
    faces = np.concatenate([np.stack(f, axis=-1).reshape(-1, 3) for f in ((a, b, c), (a, c, d))])
    return Mesh(points.astype(np.float32).astype(np.float64), faces)


def _boxes(source: Bytes) -> Mesh:
    """One or two closed boxes on the lattice, which may touch or cross."""
    bodies = []
    for _ in range(1 + source.below(2)):
        low, high = source.coordinates(2)
        bodies.append(Mesh((low + BOX * (high - low)).astype(np.float64), BOX_FACES))
    return _labelled(bodies)


def _bodies(source: Bytes) -> Mesh:
    """One to four boxes and tetrahedra on the lattice, which may touch, cross, or lie in one another."""
    bodies: list[Mesh] = []
    for _ in range(1 + source.below(4)):
        kind = source.below(4)
        if kind == 3 and bodies:  # half as large, inside or at the wall of the one before
            last = bodies[-1]
            held = last.points[source.below(len(last.points))] if source.below(2) else last.points.mean(axis=0)
            bodies.append(Mesh((last.points + held) / 2, last.faces))
        elif kind == 1:
            bodies.append(Mesh(source.coordinates(4).astype(np.float64), TETRAHEDRON_FACES))
        else:
            low, high = source.coordinates(2)
            bodies.append(Mesh((low + BOX * (high - low)).astype(np.float64), BOX_FACES))
    return _labelled(bodies)


def _labelled(bodies: list[Mesh]) -> Mesh:
    labels = np.repeat(np.arange(len(bodies)), [len(body.faces) for body in bodies])
    return replace(joined(bodies), bodies=labels.astype(np.int32))


def is_outside(points: NDArray, faces: NDArray, bodies: NDArray, at: NDArray) -> bool:
    """Whether a place lies strictly outside every closed convex body, decided exactly.

    It is where it lies strictly before the plane of some triangle of the body: so of a flat body's plane nothing is.
    """
    place = [Fraction(float(x)) for x in at]
    corners = [[Fraction(float(x)) - y for x, y in zip(point, place, strict=True)] for point in points]
    out = {
        int(body)
        for body, (a, b, c) in zip(bodies, faces.tolist(), strict=True)
        if _volume(corners[a], corners[b], corners[c]) < 0
    }
    return all(int(body) in out for body in np.unique(bodies) if body >= 0)


def _volume(a: list[Fraction], b: list[Fraction], c: list[Fraction]) -> Fraction:
    """Positive where the origin lies behind the triangle."""
    x = b[1] * c[2] - b[2] * c[1], b[2] * c[0] - b[0] * c[2], b[0] * c[1] - b[1] * c[0]
    return a[0] * x[0] + a[1] * x[1] + a[2] * x[2]
