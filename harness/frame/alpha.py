"""Triangles with holes: the texture lookup in kernels, shared by all methods."""

import numpy as np
import warp as wp
from numpy.typing import NDArray

from ..scene.scene import AlphaMask

OPAQUE, CLEAR = 1, 2  # bits of `texels_near`: an opaque texel, a transparent texel

ROUNDING = wp.constant(wp.float64(2.0**-50))

HALF = wp.constant(wp.float64(0.5))


@wp.struct
class Alpha:
    """The arrays of an :class:`..scene.scene.AlphaMask` on a device; empty arrays if the scene has no mask."""

    masked: wp.array(dtype=wp.uint8)
    coordinates: wp.array2d(dtype=wp.vec2f)
    opaque: wp.array2d(dtype=wp.uint8)


def device_alpha(mask: AlphaMask | None, device: str) -> Alpha:
    """A checked mask on ``device``; empty arrays for None."""
    alpha = Alpha()
    with wp.ScopedDevice(device):
        if mask is None:
            alpha.masked = wp.zeros(0, dtype=wp.uint8)
            alpha.coordinates = wp.zeros((0, 0), dtype=wp.vec2f)
            alpha.opaque = wp.zeros((0, 0), dtype=wp.uint8)
        else:
            # At least one element each, so that the arrays of an empty mesh have addresses too.
            alpha.masked = wp.array(_padded(mask.triangles), dtype=wp.uint8)
            alpha.coordinates = wp.array(_padded(mask.coordinates), dtype=wp.vec2f)
            alpha.opaque = wp.array(mask.opaque, dtype=wp.uint8)
    return alpha


def _padded(array: NDArray) -> NDArray:
    return array if len(array) else np.zeros((1, *array.shape[1:]), dtype=array.dtype)


@wp.func
def wrapped(texel: wp.float64, size: wp.int32) -> wp.int32:
    """Index of a texel in the repeating bitmap; ``texel`` is a whole number."""
    k = wp.int32(texel) % size
    if k < 0:
        k += size
    return k


@wp.func
def texels_near(alpha: Alpha, i: wp.int32, v: wp.float64, w: wp.float64, doubt: wp.float64) -> wp.int32:
    """The kinds of texel near the point of triangle i with weights v and w, each known with an error of ``doubt``.
    OPAQUE, CLEAR, or their sum; the sum wherever the error is half a texel or more.
    """
    c0 = alpha.coordinates[i, 0]
    c1 = alpha.coordinates[i, 1]
    c2 = alpha.coordinates[i, 2]
    rows = alpha.opaque.shape[0]
    columns = alpha.opaque.shape[1]
    x0 = wp.float64(c0[0])
    y0 = wp.float64(c0[1])
    x1 = wp.float64(c1[0]) - x0
    y1 = wp.float64(c1[1]) - y0
    x2 = wp.float64(c2[0]) - x0
    y2 = wp.float64(c2[1]) - y0
    x = (x0 + v * x1 + w * x2) * wp.float64(columns)
    y = (y0 + v * y1 + w * y2) * wp.float64(rows)
    wide = wp.abs(x1) + wp.abs(x2)
    high = wp.abs(y1) + wp.abs(y2)
    reach_x = (doubt * wide + ROUNDING * (wp.abs(x0) + wide)) * wp.float64(columns)
    reach_y = (doubt * high + ROUNDING * (wp.abs(y0) + high)) * wp.float64(rows)
    # NaN also ends here.
    if not (reach_x < HALF and reach_y < HALF and wp.abs(x) + wp.abs(y) < wp.float64(2.0e9)):
        return 3
    # Texels are closed sets: even with an error of zero, a border belongs to both its sides.
    left = wrapped(wp.ceil(x - reach_x) - wp.float64(1.0), columns)
    right = wrapped(wp.floor(x + reach_x), columns)
    low = wrapped(wp.ceil(y - reach_y) - wp.float64(1.0), rows)
    top = wrapped(wp.floor(y + reach_y), rows)
    found = wp.int32(2)
    if alpha.opaque[low, left] != wp.uint8(0):
        found = 1
    if left != right or low != top:
        if alpha.opaque[low, right] != wp.uint8(0):
            found |= 1
        else:
            found |= 2
        if alpha.opaque[top, left] != wp.uint8(0):
            found |= 1
        else:
            found |= 2
        if alpha.opaque[top, right] != wp.uint8(0):
            found |= 1
        else:
            found |= 2
    return found
