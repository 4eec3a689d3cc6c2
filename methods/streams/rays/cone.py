"""The region of a spot's rays: that of the triangles in view (:mod:`.region`), without what lies outside its cone.

So a spot's rays, too, are counted in their cells by the pass that places them and marks the receivers.

Whether a hit point lies in the cone the harness decides, in plain float64. On a triangle seen edge-on, or next to the
light, that may be off by more than the slack. Such a ray may lie outside the region. It is then an outside ray, and is
tested against every triangle in float64 instead (:mod:`..occlusion.undecided`). All other rays are placed to 2^-18 of their
direction.
"""

from __future__ import annotations

import math
from typing import Any

import warp as wp

from ....harness.frame.geometry import Camera, Mesh
from ...common.pixels import tile_pixel
from ...gpu.entries import entry, set_entry
from ...gpu.reserve import number_among
from ..cube.aim import CONE, EMPTY, FACE, FACES, HIGH_U, HIGH_V, LOW_U, LOW_V, from_ordered, ordered
from ..cube.cells import RayCells
from ..cube.faces import on_face
from ..cube.spacing import BINS
from .hit_points import Words, placed, placed_exactly, point_of
from .receivers import REGISTERS, mark_receiver
from .sort import count_exactly, count_quickly, set_row_edges

SLACK = 1.0e-4
"""Added to the angle of a cone: a ray that the camera's words place is right to 2^-18 of its direction
(:mod:`.hit_points`), and the proxy turns it by less."""

COS_SLACK, SIN_SLACK = wp.constant(wp.float64(math.cos(SLACK))), wp.constant(wp.float64(math.sin(SLACK)))

WIDEST = wp.constant(wp.float64(-0.999))
"""A cone with a lesser cosine leaves nothing out: its angle with the slack must stay below 180 degrees."""


@wp.func
def edge_cosine(p: wp.float64, q: wp.float64) -> wp.float64:
    """The greatest cosine of an axis and the directions of an edge of a face: (p + q b) / sqrt(2 + b^2) for b in -1..1."""
    corner = wp.max(p + q, p - q) / wp.sqrt(wp.float64(3.0))
    if p > wp.float64(0.0):
        b = wp.clamp(wp.float64(2.0) * q / p, wp.float64(-1.0), wp.float64(1.0))
        corner = wp.max(corner, (p + q * b) / wp.sqrt(wp.float64(2.0) + b * b))
    return corner


@wp.func
def face_cosine(a: wp.vec3d) -> wp.float64:
    """The cosine of the least angle between an axis (unit length; in the frame of a face) and a direction on the face.

    Where the axis does not meet the face, the nearest direction lies on one of its edges.
    """
    if a[0] > wp.float64(0.0) and wp.abs(a[1]) <= a[0] and wp.abs(a[2]) <= a[0]:
        return wp.float64(1.0)
    across = wp.max(edge_cosine(a[0] + a[1], a[2]), edge_cosine(a[0] - a[1], a[2]))
    up = wp.max(edge_cosine(a[0] + a[2], a[1]), edge_cosine(a[0] - a[2], a[1]))
    return wp.max(across, up)


@wp.func
def cone_sides(f: wp.float64, r: wp.float64, sine: wp.float64) -> wp.vec2d:
    """What a cone that lies before a face's centre (f > sine) covers of one coordinate of the face: the planes r / f = k
    that touch it, which are at the angle of the cone from its axis."""
    before = f * f - sine * sine
    half = sine * wp.sqrt(before + r * r)
    return wp.vec2d((f * r - half) / before, (f * r + half) / before)


@wp.func
def raise_side(rectangle: wp.array(dtype=wp.int32), k: wp.int32, x: wp.float64):
    """Move a side of the rectangle inwards to x, if it is not there yet."""
    rectangle[k] = wp.max(rectangle[k], ordered(wp.float32(x)))


@wp.kernel(enable_backward=False, grid_stride=False)
def cone_kernel(
    light: wp.int32,
    axes: wp.array(dtype=wp.mat33d),
    spots: wp.array2d(dtype=wp.float64),
    rectangle: wp.array(dtype=wp.int32),
    outside_rays: wp.array(dtype=wp.int32),
):
    """Take from what the triangles cover the faces that a light's cone does not meet, and of face 0 what lies beside a cone
    that is wholly before its centre. One thread. A spot of another kind, or of nearly all directions, keeps all. Empties
    the list of ``outside_rays``."""
    outside_rays[0] = 0
    cosine = spots[light, 10]
    if spots[light, 0] != CONE or cosine < WIDEST:
        return
    sine = wp.sqrt(wp.max(wp.float64(1.0) - cosine * cosine, wp.float64(0.0)))
    wider = cosine * COS_SLACK - sine * SIN_SLACK
    axis = axes[light] * wp.vec3d(spots[light, 1], spots[light, 2], spots[light, 3])
    for face in range(FACES):
        if face_cosine(on_face(axis, face)) < wider:
            rectangle[FACE + face] = EMPTY
    sine = sine * COS_SLACK + cosine * SIN_SLACK
    if cosine > wp.float64(0.0) and axis[0] > sine and rectangle[FACE] == 0:
        across = cone_sides(axis[0], axis[1], sine)
        up = cone_sides(axis[0], axis[2], sine)
        raise_side(rectangle, LOW_U, across[0])
        raise_side(rectangle, HIGH_U, -across[1])
        raise_side(rectangle, LOW_V, up[0])
        raise_side(rectangle, HIGH_V, -up[1])
        wide = from_ordered(rectangle[LOW_U]) < -from_ordered(rectangle[HIGH_U])
        if not (wide and from_ordered(rectangle[LOW_V]) < -from_ordered(rectangle[HIGH_V])):
            rectangle[FACE] = EMPTY  # the cone misses what the triangles cover


@wp.func
def in_region(place: wp.vec4f, cells: Any) -> wp.bool:
    """Whether a place lies in the region; a face without rays has no bins per unit."""
    r = entry(cells.table, wp.int32(place[2]))
    x = (place[0] - r[0]) * r[2]
    y = (place[1] - r[1]) * r[3]
    return r[2] > 0.0 and wp.min(x, y) >= 0.0 and wp.max(x, y) <= wp.float32(BINS)


@wp.kernel(enable_backward=False, grid_stride=False, cuda_max_registers=REGISTERS)
def place_kernel(
    first: wp.int32,
    light: wp.int32,
    camera: Camera,
    mesh: Mesh,
    lights: wp.array(dtype=wp.vec3f),
    spots: wp.array2d(dtype=wp.float64),
    front_facing: wp.array2d(dtype=wp.uint8),
    cones: wp.array(dtype=wp.vec4f),
    proxy_positions: wp.array(dtype=wp.vec3f),
    axes: wp.array(dtype=wp.mat33d),
    rays: Words,
    cells: RayCells,
    receivers: wp.array2d(dtype=wp.uint8),
    reached: wp.array(dtype=wp.int32),
    shadowed: wp.array2d(dtype=wp.uint8),
    outside_rays: wp.array(dtype=wp.int32),
):
    """:func:`.region.place_kernel` of a spot: :func:`.receivers.map_kernel` and :func:`.sort.count_kernel` in one.

    outside_rays: int32 [1 + pixels]: the number of rays outside the region, and their pixels. They get no slot."""
    set_row_edges(first + wp.tid(), camera, cells)
    at = tile_pixel(first + wp.tid(), camera.width, camera.height)
    if at[0] < 0:
        return
    pixel = at[1] * camera.width + at[0]
    set_entry(shadowed, light, pixel, wp.uint8(0))
    point = point_of(rays, pixel, at, camera, mesh)
    if not mark_receiver(
        light, False, pixel, at, point, camera, mesh, lights, spots, front_facing, cones, receivers, reached
    ):
        return
    proxy = entry(proxy_positions, light)
    axis = entry(axes, light)
    found = placed(point, True, proxy, axis)
    if found.place[2] >= 0.0:
        count_quickly(pixel, point.triangle, found, cells)
        return
    found = placed_exactly(rays, pixel, at, camera, mesh, proxy, axis)
    if in_region(found.place, cells):
        count_exactly(pixel, point.triangle, found, cells)
        return
    set_entry(cells.slot, pixel, -1)
    set_entry(cells.triangle, pixel, point.triangle)
    set_entry(outside_rays, 1 + number_among(outside_rays, 0), pixel)
