"""Closed interiors: whether a mesh is a room or a building whose inside is not visible from outside, and a view from
within.

The decision uses points spread over the triangles by area, seen from a place: how much of the sphere of directions they
cover, which way the nearest ones face, and their distances. The same mesh always gives the same points.
"""

import itertools
from dataclasses import dataclass

import numpy as np

from ..arrays import F64

SAMPLES = 100_000  # number of points spread over a mesh, in addition to at most one per triangle

_ROWS, _COLUMNS = 16, 32
"""Fields of the sphere of directions: equal in the cosine of the angle to z, and in azimuth; so of equal area."""

_ENCLOSED = 0.97
_FACING, _SOME_FACING = 0.75, 0.25
_FURNISHED = 0.15
_FLOOR, _WALL = 0.5, 0.3  # least shares of the box's lower side, and of three upright ones, that triangles must cover


@dataclass(frozen=True, eq=False)
class Samples:
    """Points on triangles: ``points`` float64 [n, 3], unit ``normals`` of their triangles float64 [n, 3]."""

    points: F64
    normals: F64


@dataclass(frozen=True, eq=False)
class Surroundings:
    """The surroundings of a place.

    covered    share of the sphere of directions in which there is a point
    facing     share of those in which the nearest triangle faces the place
    furnished  share of those with another point well behind the nearest triangle
    distance   float64 [fields]: of the nearest point in each direction; infinite where there is none
    """

    covered: float
    facing: float
    furnished: float
    distance: F64


def spread_points(corners: F64) -> Samples:
    """Points on triangles [n, 3, 3], in proportion to area, at least one on each triangle that has any."""
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(normal, axis=1)
    corners, normal, area = corners[area > 0], normal[area > 0], area[area > 0]
    counts = np.ceil(SAMPLES * area / area.sum()).astype(np.int64)
    owner = np.repeat(np.arange(len(corners)), counts)
    index = np.arange(len(owner)) - np.repeat(np.cumsum(counts) - counts, counts)
    # The R2 sequence (Roberts 2018) fills a square evenly; folded over its diagonal, a triangle.
    u, v = (0.5 + (index + 1) * step for step in (0.7548776662466927, 0.5698402909980532))
    u, v = u % 1.0, v % 1.0
    folded = u + v > 1.0
    u, v = np.where(folded, 1.0 - u, u)[:, None], np.where(folded, 1.0 - v, v)[:, None]
    a, b, c = (corners[owner, i] for i in range(3))
    return Samples(a + u * (b - a) + v * (c - a), (normal / area[:, None])[owner])


def surroundings(samples: Samples, place: F64) -> Surroundings:
    """The surroundings of ``place``, from the samples."""
    way = samples.points - place
    distance = np.maximum(np.linalg.norm(way, axis=1), 1e-300)
    row = np.clip(((way[:, 2] / distance + 1.0) / 2.0 * _ROWS).astype(int), 0, _ROWS - 1)
    azimuth = np.arctan2(way[:, 1], way[:, 0]) / (2.0 * np.pi) + 0.5
    field = row * _COLUMNS + np.minimum((azimuth * _COLUMNS).astype(int), _COLUMNS - 1)
    nearest, farthest = np.full(_ROWS * _COLUMNS, np.inf), np.zeros(_ROWS * _COLUMNS)
    np.minimum.at(nearest, field, distance)
    np.maximum.at(farthest, field, distance)
    first = distance <= nearest[field]
    towards = (way[first] * samples.normals[first]).sum(axis=1) < 0.0
    seen = farthest > 0.0
    behind = farthest[seen] > 1.3 * nearest[seen]
    return Surroundings(float(seen.mean()), float(towards.mean()), float(behind.mean()), nearest)


def interior(corners: F64, low: F64, high: F64, sides: F64, up: int) -> Samples | None:
    """Points of a mesh that encloses the middle of its box as a room does; None for any other mesh.

    A room has a floor and three walls at the sides of the box (``sides``: shares of each side that triangles lie on,
    [axis, low or high]), and surfaces all around, which face the middle. In files that do not orient their triangles
    consistently some must, and there must be things in the room. The surface of a solid faces away.
    """
    upright = [sides[axis, end] >= _WALL for axis in range(3) if axis != up for end in (0, 1)]
    if sides[up, 0] < _FLOOR or sum(upright) < 3:
        return None
    samples = spread_points(corners)
    seen = surroundings(samples, (low + high) / 2)
    furnished = seen.facing >= _SOME_FACING and seen.furnished >= _FURNISHED
    return samples if seen.covered >= _ENCLOSED and (seen.facing >= _FACING or furnished) else None


def standpoint(samples: Samples, low: F64, high: F64, up: int) -> tuple[F64, F64, F64]:
    """Eye, target and light within a closed room.

    The eye stands near one end of the longer level axis, at the place of a few from which the median distance of what
    lies ahead is largest. The light hangs high near the middle, where the target sees it. Neither is closer to a
    surface than a fiftieth of the room, where such a place is found.
    """
    extent = high - low
    along, across = sorted((axis for axis in range(3) if axis != up), key=lambda axis: -extent[axis])
    least = 0.02 * float(np.linalg.norm(extent))

    def place(of_along: float, of_across: float, of_up: float) -> F64:
        shares = np.empty(3)
        shares[[along, across, up]] = of_along, of_across, of_up
        return low + shares * extent

    def free(point: F64) -> Surroundings | None:
        seen = surroundings(samples, point)
        return seen if seen.covered >= _ENCLOSED and seen.distance.min() >= least else None

    target = place(0.5, 0.5, 0.4)
    best, eye = 0.0, place(0.06, 0.5, 0.5)
    for shares in itertools.product((0.06, 0.94, 0.15, 0.85, 0.25, 0.75), (0.5, 0.25, 0.75), (0.5, 0.35)):
        seen = free(place(*shares))
        if seen is not None:
            ahead = float(np.median(seen.distance[_directions() @ (target - place(*shares)) > 0.0]))
            if ahead > 1.02 * best:
                best, eye = ahead, place(*shares)
    beneath = surroundings(samples, target).distance
    for height, of_along, of_across in itertools.product((0.85, 0.7, 0.55), (0.5, 0.4, 0.6), (0.5, 0.4, 0.6)):
        light = place(of_along, of_across, height)
        way = light - target
        if free(light) is not None and beneath[np.argmax(_directions() @ way)] > np.linalg.norm(way):
            break  # else it might hang above a vault
    return eye, target, light


def _directions() -> F64:
    """The middle of each field of the sphere of directions, float64 [fields, 3]."""
    z = (np.arange(_ROWS) + 0.5) / _ROWS * 2.0 - 1.0
    azimuth = ((np.arange(_COLUMNS) + 0.5) / _COLUMNS - 0.5) * 2.0 * np.pi
    z, azimuth = np.repeat(z, _COLUMNS), np.tile(azimuth, _ROWS)
    flat = np.sqrt(1.0 - z * z)
    return np.stack([flat * np.cos(azimuth), flat * np.sin(azimuth), z], axis=1)
