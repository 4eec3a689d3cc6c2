"""A light's mask as numbers that a kernel reads: cone, rectangle, direction."""

import numpy as np

from ..arrays import F64
from ..errors import UserError
from .scene import Light, Spot

SPOT = 12  # number of values that describe a spot


DOUBT = 2.0**-40  # share of edge times edge times distance below which the side of a plane counts as uncertain


NO_SPOT, CONE, RECTANGLE = 0.0, 1.0, 2.0


def spot_row(spot: Spot | None) -> F64:
    """The values of a spot, float64 [12]. Raises :class:`UserError` for invalid angles or directions."""
    row = np.zeros(SPOT)
    if spot is None:
        return row
    forward = np.asarray(spot.direction, dtype=np.float64)
    up = np.asarray(spot.up, dtype=np.float64)
    size = np.abs(forward).max(initial=0.0)
    if not 0.0 < size < np.inf:
        raise UserError(f"spot: direction {spot.direction} must be finite and not zero")
    forward = forward / size
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, up)
    if not np.isfinite(up).all() or np.linalg.norm(right) <= 1e-9 * np.linalg.norm(up):
        if spot.rise is not None:
            raise UserError("spot: up must be finite and not parallel to the direction; choose another up")
        right = np.cross(forward, np.eye(3)[np.abs(forward).argmin()])  # a cone needs no up
    right /= np.linalg.norm(right)
    if not 0.0 < spot.angle <= 180.0:
        raise UserError(f"spot: angle {spot.angle} degrees must be more than 0 and at most 180")
    if spot.rise is not None and not 0.0 < spot.rise <= 90.0:
        raise UserError(f"spot: rise {spot.rise} degrees must be more than 0 and at most 90")
    row[1:10] = np.concatenate([forward, right, np.cross(right, forward)])
    if spot.rise is None:
        row[0], row[10] = CONE, np.cos(np.radians(spot.angle))
    else:
        row[0], row[10], row[11] = RECTANGLE, np.radians(spot.angle), np.radians(spot.rise)
    return row


def spot_rows(lights: tuple[Light, ...]) -> F64:
    """The values of every light's spot, float64 [light_count, 12]."""
    return np.array([spot_row(light.spot) for light in lights], dtype=np.float64).reshape(-1, SPOT)
