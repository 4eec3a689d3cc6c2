"""A camera and a light for geometry without them: from its bounds, its walls, and its upward axis."""

import math

import numpy as np

from ..arrays import F64
from .interiors import interior, standpoint
from .light_paths import vector
from .scene import Camera, Light
from .shape import Shape

FOV, WITHIN_FOV = 40.0, 60.0
AZIMUTH, ELEVATION = 35.0, 20.0  # the three-quarter view, degrees: from the front turned to the right, and from above

_MARGIN = 1.04
_WALL = 0.6
_OPEN = 0.25  # a side of the bounding box is a wall if triangles lie on this share of it, and open below the other
_EDGE_ON = 0.05  # share of the area that a view must see


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
    """The three-quarter view from outside, everything just inside a square image; the light high at its left. Where
    that sees planes edge-on, it is turned."""
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
    if shape.sides[shape.up, 0] < _WALL:
        return None
    upright = [(axis, end) for axis in range(3) if axis != shape.up for end in (0, 1)]
    missing = [side for side in upright if shape.sides[side] < _OPEN]
    walls = [side for side in upright if shape.sides[side] >= _WALL]
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
    a share of that axis. ``height``: its share of the upward axis."""
    extent = shape.high - shape.low
    axis = max({0, 1, 2} - {shape.up}, key=lambda i: extent[i])
    eye, target, light = (shape.low + 0.5 * extent for _ in range(3))
    eye[axis] = shape.low[axis] + along * extent[axis]
    eye[shape.up] = target[shape.up] = shape.low[shape.up] + height * extent[shape.up]
    target[axis] = shape.low[axis] + 0.6 * extent[axis]
    light[shape.up] = shape.low[shape.up] + 0.6 * extent[shape.up]
    return Camera(vector(eye), vector(target), vector(np.eye(3)[shape.up]), WITHIN_FOV), (Light(vector(light)),)
