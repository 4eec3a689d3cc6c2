"""Triangles with holes: the rule for which hits count, the same for methods and for the reference.

A hit on a masked triangle counts only where the bitmap of the scene's :class:`.scene.scene.AlphaMask` is opaque, at the
texture coordinates interpolated with the barycentric weights of the hit. Texel (row, column) covers
[column, column + 1] x [row, row + 1] of the coordinates times the bitmap's size, and the bitmap repeats. The opaque
part is closed, as triangles are: a hit exactly on the border of two texels counts if either is opaque. On a border,
float64 operations in another order could give another answer. Therefore methods test the texels within the bound of their
own rounding on both sides, and count the hit if any of them is opaque.
"""

from collections.abc import Mapping
from dataclasses import fields, replace

import numpy as np
from numpy.typing import NDArray

from ..arrays import I32
from ..errors import UserError
from .corner_order import follow
from .scene import AlphaMask, Geometry, Scene

MOST_TEXELS = 2.0**30  # coordinates times the bitmap's size stay below this, so that a texel's number fits 32 bits


def checked(mask: AlphaMask, triangle_count: int, name: str) -> AlphaMask:
    """The mask with contiguous arrays of the declared types; every value that is not 0 becomes 1. Raises
    :class:`UserError` for shapes that do not fit the mesh, coordinates that are not finite or so large that texels
    cannot be numbered, and a bitmap without texels. ``name``: of the scene, for the message.
    """
    masked, coordinates = np.asarray(mask.triangles), np.asarray(mask.coordinates)
    opaque = np.asarray(mask.opaque)
    if masked.shape != (triangle_count,):
        raise UserError(
            f"{name}: alpha mask flags {masked.shape} for {triangle_count} triangles; give one flag a triangle"
        )
    if coordinates.shape != (triangle_count, 3, 2):
        raise UserError(f"{name}: texture coordinates have shape {coordinates.shape}; give ({triangle_count}, 3, 2)")
    if opaque.ndim != 2 or not opaque.size:
        raise UserError(f"{name}: the alpha bitmap has shape {opaque.shape}; give at least one texel, rows first")
    rounded = np.ascontiguousarray(coordinates, dtype=np.float32)
    if not np.isfinite(rounded).all():
        raise UserError(f"{name}: a texture coordinate is not finite; mend the mask")
    if np.abs(rounded).max(initial=0.0) * max(opaque.shape) >= MOST_TEXELS:
        raise UserError(f"{name}: texture coordinates repeat the bitmap too often; bring them nearer to zero")
    return AlphaMask(
        np.ascontiguousarray(masked != 0, dtype=np.uint8), rounded, np.ascontiguousarray(opaque != 0, dtype=np.uint8)
    )


def alpha_of(scene: Scene, geometry: Geometry, faces: I32) -> AlphaMask | None:
    """The checked mask of a geometry, its coordinates in the corners' order of ``faces``; None if all is opaque."""
    if scene.alpha is None:
        return None
    mask = checked(scene.alpha(geometry), len(faces), scene.name)
    own = np.reshape(geometry.faces, (-1, 3))
    return replace(mask, coordinates=follow(mask.coordinates, own, faces))


def arrays_of(mask: AlphaMask | None) -> dict[str, NDArray]:
    """The arrays of a mask by their names in a file; {} for no mask. :func:`from_arrays` reads them."""
    if mask is None:
        return {}
    return {f"alpha_{field.name}": getattr(mask, field.name) for field in fields(mask)}


def from_arrays(arrays: Mapping[str, NDArray]) -> AlphaMask | None:
    """The mask among ``arrays`` of a file, or None."""
    if "alpha_opaque" not in arrays:
        return None
    return AlphaMask(**{field.name: arrays[f"alpha_{field.name}"] for field in fields(AlphaMask)})
