"""A light's space and the grid in it, as kernels take them.

Light's frame: x forward, y right, z up. The grid has one rectangle, or six for the faces of a cube (:mod:`.light.mapping`).
"""

from __future__ import annotations

import warp as wp

EXTENT = wp.constant(8)
"""Length of a face's extent: two coordinates and distance, lowest then highest, and two unused."""


@wp.struct
class LightSpace:
    """Light ``index`` and its axes.

    lights, proxy_positions  vec3f [light_count]: the lights, and what their grids look from (:class:`.frame.frame.Frame`)
    axes          mat33d [1], rows: forward, right, up
    pads          float64 [2]: error bound of a ray's direction, relative to its length; see ``frame.aim_kernel``
    distance_pad  relative error bound of a ray's distance
    eye           vec3f [1]: bounds the coordinates of the eye
    box           float64 [6]: of the hit points, or of the scene where the rectangle is the scene's
    """

    index: wp.int32
    lights: wp.array(dtype=wp.vec3f)
    proxy_positions: wp.array(dtype=wp.vec3f)
    axes: wp.array(dtype=wp.mat33d)
    pads: wp.array(dtype=wp.float64)
    distance_pad: wp.float64
    eye: wp.array(dtype=wp.vec3f)
    box: wp.array(dtype=wp.float64)


@wp.struct
class LightTiles:
    """The grid: rectangles, tiles along a side of one, slices; edges of the tiles (:mod:`.light.tile_edges`).

    spans       lists in every slice that a triangle spans, not only in the first
    skip_empty  no pair where no ray lies: ``deepest`` is the last slice that a ray of the tile reaches
    extent      float64 [faces, 8]: lowest then highest coordinates and distance of each rectangle
    """

    faces: wp.int32
    tiles: wp.int32
    slices: wp.int32
    spans: wp.bool
    skip_empty: wp.bool
    extent: wp.array(dtype=wp.float64)
    columns: wp.array(dtype=wp.vec4d)
    rows: wp.array(dtype=wp.vec4d)
    stretch: wp.array(dtype=wp.vec2d)
    deepest: wp.array(dtype=wp.int32)


@wp.func
def tile_of(angle: wp.float64, low: wp.float64, high: wp.float64, tiles: wp.int32) -> wp.int32:
    """Index of the tile along one axis. Monotone, and the same function for rays and triangles."""
    if not (high > low):
        return 0
    share = (angle - low) / (high - low)
    return wp.int32(wp.clamp(share * wp.float64(tiles), wp.float64(0.0), wp.float64(tiles) - wp.float64(0.5)))


@wp.func
def distance_slice(distance: wp.float64, grid: LightTiles, face: wp.int32) -> wp.int32:
    """Slice between the nearest and the farthest ray of a face; nearer triangles fall into the first."""
    return tile_of(distance, grid.extent[face * EXTENT + 2], grid.extent[face * EXTENT + 5], grid.slices)
