"""A triangle's corners and weld indices in 48 contiguous bytes, for structures that find triangles in no order of the mesh.

Through the mesh, a test reads the triangle, then its points and their weld indices: thirteen addresses, most of them known
only after the first. A record takes three reads of 16 bytes. Tests of triangles (:mod:`..exact.ray_queries`) take either.
"""

import warp as wp

from ...harness.frame.geometry import Corners, Mesh, corners_of, weld_of
from ..gpu.entries import entry, set_entry

INVALID = wp.constant(-1)
"""In place of the first weld index: no ray hits the triangle."""


@wp.struct
class CornerRecords:
    """The triangles of a frame. ``corners``: vec4f [3 * triangle_count], each a position and its weld index."""

    corners: wp.array(dtype=wp.vec4f)


@wp.func
def position(corner: wp.vec4f) -> wp.vec3f:
    return wp.vec3f(corner[0], corner[1], corner[2])


@wp.func
def corner(at: wp.vec3f, weld: wp.int32) -> wp.vec4f:
    return wp.vec4f(at[0], at[1], at[2], wp.cast(weld, wp.float32))


@wp.func
def store_record(records: CornerRecords, i: wp.int32, corners: Corners, weld: wp.vec3i):
    """Write the record of triangle i."""
    set_entry(records.corners, 3 * i, corner(corners.a, weld[0]))
    set_entry(records.corners, 3 * i + 1, corner(corners.b, weld[1]))
    set_entry(records.corners, 3 * i + 2, corner(corners.c, weld[2]))


@wp.func
def store_invalid(records: CornerRecords, i: wp.int32):
    """Write that no ray hits triangle i."""
    set_entry(records.corners, 3 * i, corner(wp.vec3f(0.0, 0.0, 0.0), INVALID))


@wp.func
def valid_in(records: CornerRecords, i: wp.int32) -> wp.bool:
    return wp.cast(entry(records.corners, 3 * i)[3], wp.int32) != INVALID


@wp.func
def corners_in(mesh: Mesh, i: wp.int32) -> Corners:
    return corners_of(mesh, i)


@wp.func
def corners_in(records: CornerRecords, i: wp.int32) -> Corners:
    return Corners(
        position(entry(records.corners, 3 * i)),
        position(entry(records.corners, 3 * i + 1)),
        position(entry(records.corners, 3 * i + 2)),
    )


@wp.func
def weld_in(mesh: Mesh, i: wp.int32) -> wp.vec3i:
    return weld_of(mesh, i)


@wp.func
def weld_in(records: CornerRecords, i: wp.int32) -> wp.vec3i:
    return wp.vec3i(
        wp.cast(entry(records.corners, 3 * i)[3], wp.int32),
        wp.cast(entry(records.corners, 3 * i + 1)[3], wp.int32),
        wp.cast(entry(records.corners, 3 * i + 2)[3], wp.int32),
    )


@wp.func
def triangles_in(mesh: Mesh) -> wp.int32:
    """How many there are."""
    return mesh.triangles.shape[0]


@wp.func
def triangles_in(records: CornerRecords) -> wp.int32:
    return records.corners.shape[0] // 3
