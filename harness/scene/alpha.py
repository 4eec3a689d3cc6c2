"""Triangles with holes: which hits count, in one rule for methods and for truth.

A hit on a masked triangle counts only where the bitmap of the scene's :class:`.scene.scene.AlphaMask` is opaque, at the
texture coordinates interpolated with the barycentric weights of the hit. Texel (row, column) covers
[column, column + 1] x [row, row + 1] of the coordinates times the bitmap's size, and the bitmap repeats. The opaque
part is closed, as triangles are: a hit exactly on the border of two texels counts if either is opaque. So rounding
never decides on a border, where float64 in another order would say something else: methods look to both sides by the
bound of their own rounding, and count the hit if anything there is opaque.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields

import numpy as np
import warp as wp
from numpy.typing import NDArray

from ..errors import UserError
from .scene import AlphaMask, Geometry, Scene

MOST_TEXELS = 2.0**30
"""Coordinates times the bitmap's size stay below this, so that a texel's number fits 32 bits."""

OPAQUE, CLEAR = 1, 2
"""Bits of :func:`texels_near`: something opaque, something transparent."""

ROUNDING = wp.constant(wp.float64(2.0**-50))
HALF = wp.constant(wp.float64(0.5))


# --- on the host ----------------------------------------------------------------------------------------------


def checked(mask: AlphaMask, triangle_count: int, name: str) -> AlphaMask:
    """The mask with every array contiguous and of its own type (1 for anything that is not 0).

    Raises :class:`UserError` for shapes that do not fit the mesh, coordinates that are not finite or so large that
    texels cannot be numbered, and a bitmap without texels. ``name``: of the scene, for the message.
    """
    masked, coordinates = np.asarray(mask.triangles), np.asarray(mask.coordinates)
    opaque = np.asarray(mask.opaque)
    if masked.shape != (triangle_count,):
        raise UserError(
            f"{name}: alpha mask flags {masked.shape} for {triangle_count} triangles; give one flag a triangle"
        )
    if coordinates.shape != (triangle_count, 3, 2):
        raise UserError(
            f"{name}: texture coordinates have shape {coordinates.shape}; give ({triangle_count}, 3, 2)"
        )
    if opaque.ndim != 2 or not opaque.size:
        raise UserError(
            f"{name}: the alpha bitmap has shape {opaque.shape}; give at least one texel, rows first"
        )
    rounded = np.ascontiguousarray(coordinates, dtype=np.float32)
    if not np.isfinite(rounded).all():
        raise UserError(f"{name}: a texture coordinate is not finite; mend the mask")
    if np.abs(rounded).max(initial=0.0) * max(opaque.shape) >= MOST_TEXELS:
        raise UserError(f"{name}: texture coordinates repeat the bitmap too often; bring them nearer to zero")
    return AlphaMask(
        np.ascontiguousarray(masked != 0, dtype=np.uint8),
        rounded,
        np.ascontiguousarray(opaque != 0, dtype=np.uint8),
    )


def alpha_of(scene: Scene, geometry: Geometry) -> AlphaMask | None:
    """The checked mask of a scene's geometry; None where every triangle is opaque."""
    if scene.alpha is None:
        return None
    return checked(scene.alpha(geometry), len(np.reshape(geometry.faces, (-1, 3))), scene.name)


def arrays_of(mask: AlphaMask | None) -> dict[str, NDArray]:
    """The arrays of a mask under names for a file; {} for none. :func:`from_arrays` reads them back."""
    if mask is None:
        return {}
    return {f"alpha_{field.name}": getattr(mask, field.name) for field in fields(mask)}


def from_arrays(arrays: Mapping[str, NDArray]) -> AlphaMask | None:
    """The mask among ``arrays`` of a file, or None."""
    if "alpha_opaque" not in arrays:
        return None
    return AlphaMask(**{field.name: arrays[f"alpha_{field.name}"] for field in fields(AlphaMask)})


def perforated(geometry: Geometry, every: int = 2, holes: int = 4) -> AlphaMask:
    """A mask for any mesh: triangle 0 and every ``every``-th after it become a chequerboard, ``holes`` fields a side.

    The fields lie along two edges of the triangle itself, so that the pattern follows it as it moves. ``every`` = 1
    masks them all. Raises ValueError unless both are at least 1.
    """
    if every < 1 or holes < 1:
        raise ValueError("every and holes must be at least 1")
    count = len(geometry.faces)
    masked = (np.arange(count) % every == 0).astype(np.uint8)
    corners = np.array([[0, 0], [holes / 2, 0], [0, holes / 2]], dtype=np.float32)
    coordinates = np.broadcast_to(corners, (count, 3, 2)).copy()
    return AlphaMask(masked, coordinates, np.array([[1, 0], [0, 1]], dtype=np.uint8))


# --- on the device --------------------------------------------------------------------------------------------


@wp.struct
class Alpha:
    """A mask on a device: :class:`.scene.scene.AlphaMask`'s arrays, or arrays without elements where there is none."""

    masked: wp.array(dtype=wp.uint8)
    coordinates: wp.array2d(dtype=wp.vec2f)
    opaque: wp.array2d(dtype=wp.uint8)


def device_alpha(mask: AlphaMask | None, device: str) -> Alpha:
    """A checked mask on ``device``; None: arrays without elements, which take no memory."""
    alpha = Alpha()
    with wp.ScopedDevice(device):
        if mask is None:
            alpha.masked = wp.zeros(0, dtype=wp.uint8)
            alpha.coordinates = wp.zeros((0, 0), dtype=wp.vec2f)
            alpha.opaque = wp.zeros((0, 0), dtype=wp.uint8)
        else:
            # At least one element each, so that an empty mesh has addresses too.
            alpha.masked = wp.array(_padded(mask.triangles), dtype=wp.uint8)
            alpha.coordinates = wp.array(_padded(mask.coordinates), dtype=wp.vec2f)
            alpha.opaque = wp.array(mask.opaque, dtype=wp.uint8)
    return alpha


def _padded(array: NDArray) -> NDArray:
    return array if len(array) else np.zeros((1, *array.shape[1:]), dtype=array.dtype)


@wp.func
def wrapped(texel: wp.float64, size: wp.int32) -> wp.int32:
    """A texel's number in the bitmap, which repeats; ``texel`` is a whole number."""
    k = wp.int32(texel) % size
    if k < 0:
        k += size
    return k


@wp.func
def texels_near(alpha: Alpha, i: wp.int32, v: wp.float64, w: wp.float64, doubt: wp.float64) -> wp.int32:
    """What lies where vertices 1 and 2 of triangle i have weights v and w, each known to ``doubt``.

    OPAQUE, CLEAR, or both added; both wherever half a texel or more is in doubt.
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
    # Not a number comes out here too.
    if not (reach_x < HALF and reach_y < HALF and wp.abs(x) + wp.abs(y) < wp.float64(2.0e9)):
        return 3
    # Texels are closed: where nothing is in doubt, a border still belongs to both its sides.
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
