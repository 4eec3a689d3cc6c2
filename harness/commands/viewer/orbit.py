"""A camera or a light that is turned about a point."""

from __future__ import annotations

import math

import numpy as np

from ...scene.light_paths import vector
from ...scene.scene import Vector

STEEPEST = math.radians(89.0)
"""Largest elevation, so that ``up`` is never parallel to the view."""


def turned(
    point: Vector, centre: Vector, up: Vector, azimuth: float, elevation: float, scale: float
) -> Vector:
    """``point`` turned about ``centre`` and moved to ``scale`` times its distance; unchanged if nothing is to change.

    azimuth    degrees about ``up``, counter-clockwise seen from above
    elevation  degrees towards ``up``; it ends :data:`STEEPEST` above and below
    """
    if azimuth == 0.0 and elevation == 0.0 and scale == 1.0:
        return point
    upward = np.asarray(up, dtype=np.float64) / np.linalg.norm(up)
    arm = np.subtract(point, centre)
    length = float(np.linalg.norm(arm)) or 1.0
    rise = float(arm @ upward)
    level = arm - rise * upward
    if np.linalg.norm(level) <= 1e-9 * length:  # straight above: any level direction
        level = np.cross(upward, np.eye(3)[np.abs(upward).argmin()])
    level /= np.linalg.norm(level)
    angle = math.radians(azimuth)
    level = level * math.cos(angle) + np.cross(upward, level) * math.sin(angle)
    before = math.asin(max(-1.0, min(1.0, rise / length)))
    most = max(STEEPEST, abs(before))
    above = max(-most, min(most, before + math.radians(elevation)))
    made = np.asarray(centre) + length * scale * (level * math.cos(above) + upward * math.sin(above))
    return vector(made)
