"""Axes of a light's space, given where it looks."""

from __future__ import annotations

import warp as wp


@wp.func
def axes_along(forward: wp.vec3d) -> wp.mat33d:
    """Rows: forward (of length 1), right and up.

    Any axis far from parallel to forward serves as "up"; world axes keep y up as the paper's figure does.
    """
    up = wp.vec3d(wp.float64(0.0), wp.float64(1.0), wp.float64(0.0))
    if wp.abs(forward[1]) > wp.float64(0.8):
        up = wp.vec3d(wp.float64(0.0), wp.float64(0.0), wp.float64(1.0))
    right = wp.normalize(wp.cross(forward, up))
    return wp.matrix_from_rows(forward, right, wp.cross(right, forward))
