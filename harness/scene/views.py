"""A camera and a light for geometry without them: from its bounds, its walls, and its upward axis; and from within, where
the mesh is a room or a building whose inside is not visible from outside.

That is decided by points spread over the triangles by area, seen from a place: how much of the sphere of directions they
cover, which way the nearest ones face, and their distances. The same mesh always gives the same points.
"""

import itertools
import math
from dataclasses import dataclass

import numpy as np

from ..arrays import F64
from .light_paths import vector
from .scene import Camera, Light
from .shape import Shape

SAMPLES = 100_000  # number of points spread over a mesh, in addition to at most one per triangle

_ROWS, _COLUMNS = 16, 32
"""Fields of the sphere of directions: equal in the cosine of the angle to z, and in azimuth; so of equal area."""

_ENCLOSED = 0.97
_FACING, _SOME_FACING = 0.75, 0.25
_FURNISHED = 0.15
_FLOOR, _WALL = 0.5, 0.3  # least shares of the box's lower side, and of three upright ones, that triangles must cover

FOV, WITHIN_FOV = 40.0, 60.0
AZIMUTH, ELEVATION = 35.0, 20.0  # the three-quarter view, degrees: from the front turned to the right, and from above

_MARGIN = 1.04
_SIDE = 0.6
_OPEN = 0.25  # a side of the bounding box is a wall if triangles lie on this share of it, and open below the other
_EDGE_ON = 0.05  # share of the area that a view must see


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


def view(shape: Shape) -> tuple[Camera, tuple[Light, ...]]:
    """For any mesh: from within a closed room, into a box that is open on one side, else the whole thing from outside."""
    samples = interior(shape.corners, shape.low, shape.high, shape.sides, shape.up)
    if samples is not None:
        eye, target, light = standpoint(samples, shape.low, shape.high, shape.up)
        up = np.eye(3)[shape.up]
        return Camera(vector(eye), vector(target), vector(up), WITHIN_FOV), (Light(vector(light)),)
    opening = _opening(shape)
    return _into_box(shape, *opening) if opening else outside(shape)


def outside(shape: Shape, azimuth: float = AZIMUTH, elevation: float = ELEVATION) -> tuple[Camera, tuple[Light, ...]]:
    """The three-quarter view, all within a square image, turned if planes are seen edge-on; light high at the left."""
    turns = (azimuth, azimuth - 45.0, azimuth + 45.0, azimuth - 90.0)
    azimuth = next((turn for turn in turns if shape.facing(_direction(shape, turn, elevation)) > _EDGE_ON), azimuth)
    camera = _fitted(shape, _direction(shape, azimuth, elevation), shape.frame()[1])
    middle = (shape.low + shape.high) / 2
    place = middle + shape.radius * 2.2 * _direction(shape, azimuth - 60.0, 45.0)
    return camera, (Light(vector(place)),)


def _direction(shape: Shape, azimuth: float, elevation: float) -> F64:
    """Unit vector from the middle towards an azimuth (from the front, to the right) and an elevation in degrees."""
    right, up, front = shape.frame()
    a, e = math.radians(azimuth), math.radians(elevation)
    return math.cos(e) * (math.sin(a) * right + math.cos(a) * front) + math.sin(e) * up


def _fitted(shape: Shape, toward: F64, up: F64) -> Camera:
    """The camera in direction ``toward`` from the middle, as near as shows every point in a square image."""
    forward = -toward
    right = np.cross(forward, up)
    right /= np.linalg.norm(right)
    true_up = np.cross(right, forward)
    middle = (shape.low + shape.high) / 2
    offsets = (shape.points - middle) @ np.stack([right, true_up, forward], axis=1)
    half = math.tan(math.radians(FOV) / 2) / _MARGIN
    # Seen from (x, y, -d), a point needs |px - x| <= half (pz + d): two lines that meet at x and d.
    shift, distances = [], []
    for axis in (0, 1):
        most = float((offsets[:, axis] - half * offsets[:, 2]).max())
        least = float((offsets[:, axis] + half * offsets[:, 2]).min())
        shift.append((most + least) / 2)
        distances.append((most - least) / (2 * half))
    distance = max(*distances, 1e-3 * shape.radius)
    eye = middle + shift[0] * right + shift[1] * true_up - distance * forward
    return Camera(vector(eye), vector(eye + forward * max(distance, shape.radius)), vector(up), FOV)


def _opening(shape: Shape) -> tuple[int, int] | None:
    """The open side (axis, end) of a box with a floor whose other upright sides are walls, or None."""
    if shape.sides[shape.up, 0] < _SIDE:
        return None
    upright = [(axis, end) for axis in range(3) if axis != shape.up for end in (0, 1)]
    missing = [side for side in upright if shape.sides[side] < _OPEN]
    walls = [side for side in upright if shape.sides[side] >= _SIDE]
    return missing[0] if len(missing) == 1 and len(walls) == 3 else None


def _into_box(shape: Shape, axis: int, end: int) -> tuple[Camera, tuple[Light, ...]]:
    """Straight through the open side; the light inside, under the ceiling, a little off the middle."""
    toward = np.eye(3)[axis] * (1.0 if end else -1.0)
    extent = shape.high - shape.low
    light = shape.low + extent * 0.5
    light[shape.up] = shape.low[shape.up] + 0.88 * extent[shape.up]
    side = 3 - shape.up - axis
    light[side] += 0.12 * extent[side]
    return _fitted(shape, toward, np.eye(3)[shape.up]), (Light(vector(light)),)


def inside(shape: Shape, along: float = 0.08, height: float = 0.3) -> tuple[Camera, tuple[Light, ...]]:
    """From within a building along its longest level axis; one light high in the middle. ``along``: the eye's place as
    a share of that axis. ``height``: its share of the upward axis.
    """
    extent = shape.high - shape.low
    axis = max({0, 1, 2} - {shape.up}, key=lambda i: extent[i])
    eye, target, light = (shape.low + 0.5 * extent for _ in range(3))
    eye[axis] = shape.low[axis] + along * extent[axis]
    eye[shape.up] = target[shape.up] = shape.low[shape.up] + height * extent[shape.up]
    target[axis] = shape.low[axis] + 0.6 * extent[axis]
    light[shape.up] = shape.low[shape.up] + 0.6 * extent[shape.up]
    return Camera(vector(eye), vector(target), vector(np.eye(3)[shape.up]), WITHIN_FOV), (Light(vector(light)),)
