"""Corners and directions read as in :mod:`..gpu.entries`, without Warp's index arithmetic."""

import warp as wp

from ...harness.frame.geometry import Camera, Corners, Mesh, Ray
from ..gpu.entries import entry


@wp.func
def corners_at(mesh: Mesh, i: wp.int32) -> Corners:
    """:func:`...harness.frame.geometry.corners_of`."""
    face = entry(mesh.triangles, i)
    return Corners(entry(mesh.points, face[0]), entry(mesh.points, face[1]), entry(mesh.points, face[2]))


@wp.func
def weld_at(mesh: Mesh, i: wp.int32) -> wp.vec3i:
    """:func:`...harness.frame.geometry.weld_of`."""
    face = entry(mesh.triangles, i)
    return wp.vec3i(entry(mesh.weld, face[0]), entry(mesh.weld, face[1]), entry(mesh.weld, face[2]))


@wp.func
def direction_at(camera: Camera, x: wp.int32, y: wp.int32) -> wp.vec3f:
    """The direction of the pixel in column x and row y."""
    return entry(camera.column, x) + entry(camera.row, y)


@wp.func
def ray_at(camera: Camera, x: wp.int32, y: wp.int32) -> Ray:
    """The ray of the pixel in column x and row y."""
    return Ray(entry(camera.eye, 0), direction_at(camera, x, y))


@wp.func
def ray_of_pixel(camera: Camera, pixel: wp.int32) -> Ray:
    """The ray of a pixel by its number."""
    y = wp.int32(wp.uint32(pixel) // wp.uint32(camera.width))
    return ray_at(camera, pixel - y * camera.width, y)
