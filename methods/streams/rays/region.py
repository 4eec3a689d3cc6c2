"""The region of a light's rays from the triangles, before there are rays: places and cells in one pass.

What the triangles cover of the cube bounds what the hits on them do. It is found beside the camera's passes, so that the
pass that places the rays can count them in their cells, too. With few triangles that costs little.

Where only surfaces that face the light have shadow rays, the triangles say which pixels do: eye and light lie on one side
of a triangle's plane or not, whatever the pixel. The kernels' effect ``receivers`` means this; a spot's rays are placed
in :mod:`.cone`.
"""

from typing import Any

import warp as wp

from ....harness.frame.effects.receivers import faces_light
from ....harness.frame.effects.specialise import effects
from ....harness.frame.geometry import Camera, Corners, Mesh, Ray
from ...common.reads import corners_at
from ...exact.triangle import U32, largest, to_float32, to_float64, total
from ...gpu.entries import entry, set_entry
from ..camera.pixels import edge_planes, inverse_depth
from ..camera.stream import box_of
from ..cube.cells import RayCells
from ..cube.density import expect_triangles
from ..cube.faces import FACES, on_face
from ..cube.footprint import FINEST, beyond_face, corners_on, extent_from, in_cube_space, turned
from ..cube.lights import Cube, Light, cube_of_light
from ..cube.rectangle import FACE, HIGH_U, HIGH_V, LARGEST, LOW_U, LOW_V, ordered
from .hit_points import FAR

OFF = wp.constant(wp.float32(2.0**-7))
"""Share of the way from the eye that is added to the extent of a triangle: a hit point is off by at most 2^-29 of that way
(:mod:`.hit_points`), and 32 u of the share are eight times as much."""

LARGE_BOX = wp.constant(256)
"""Of a triangle with a box of more pixels only the part in view counts."""

LEAST_PIXEL = wp.constant(wp.float32(2.0**-19))
"""Least difference of the directions of neighbouring pixels for that. Directions are rounded by at most 8 u in each
coordinate, those beyond the image included: by half a pixel if the difference is so small."""


@wp.func
def lower(words: wp.array(dtype=wp.int32), k: wp.int32, x: wp.float32):
    """Lower a side of the rectangle to at most x."""
    word = ordered(x)
    if word < words[k]:
        wp.atomic_min(words, k, word)


@wp.func
def rectangle_of(a: wp.vec3f, b: wp.vec3f, c: wp.vec3f, d: wp.vec3f, extent: wp.float32, before: wp.vec4f) -> wp.vec4f:
    """The part of a rectangle of face 0 (least u and v, greatest u and v) that the convex hull of four points may cover.

    Points are (along, across, up), and ``extent`` bounds |p - middle|_1 of them; errors are those of
    :func:`..cube.footprint.on_bins`. Where a point lies behind the centre of projection or too near its plane, the
    rectangle is returned as it is.
    """
    nearest = wp.min(wp.min(a[0], b[0]), wp.min(c[0], d[0]))
    most = wp.max(wp.max(largest(a), largest(b)), wp.max(largest(c), largest(d)))
    if not (nearest > 0.01 * most and most < 1.0e30):
        return before
    u = wp.vec4f(a[1] / a[0], b[1] / b[0], c[1] / c[0], d[1] / d[0])
    v = wp.vec4f(a[2] / a[0], b[2] / b[0], c[2] / c[0], d[2] / d[0])
    least_u = wp.min(u)
    least_v = wp.min(v)
    most_u = wp.max(u)
    most_v = wp.max(v)
    widest = wp.max(wp.max(-least_u, most_u), wp.max(wp.max(-least_v, most_v), FINEST))
    pad = 32.0 * U32 * ((1.0 + widest) * extent / nearest + widest)
    return wp.vec4f(
        wp.max(before[0], least_u - pad),
        wp.max(before[1], least_v - pad),
        wp.min(before[2], most_u + pad),
        wp.min(before[3], most_v + pad),
    )


@wp.func
def relative_point(ray: Ray, m: wp.vec3d, middle: wp.vec3f) -> wp.vec3f:
    """Where a ray meets a plane (1 / t = m . direction), relative to ``middle``; infinite where it does not."""
    inverse = wp.dot(m, to_float64(ray.direction))
    if not (inverse > wp.float64(0.0)):
        return wp.vec3f(wp.INF)
    return to_float32(to_float64(ray.direction) / inverse + (to_float64(ray.origin) - to_float64(middle)))


@wp.func
def beyond_pixel(camera: Camera, x: wp.int32, y: wp.int32) -> wp.vec3f:
    """The direction of a pixel that may lie outside the image."""
    across = (entry(camera.column, camera.width - 1) - entry(camera.column, 0)) / wp.float32(camera.width - 1)
    down = (entry(camera.row, camera.height - 1) - entry(camera.row, 0)) / wp.float32(camera.height - 1)
    return entry(camera.column, 0) + wp.float32(x) * across + entry(camera.row, 0) + wp.float32(y) * down


@wp.func
def part_is_known(box: wp.vec4i, o: wp.vec3f, corners: Corners, camera: Camera) -> wp.bool:
    """Whether only the part of a triangle in a box of pixels counts (:func:`part_in_view`).

    Pixels must be farther apart than their directions are rounded, and the distance to the triangle's plane must be known.
    """
    if (box[2] - box[0] + 1) * (box[3] - box[1] + 1) <= LARGE_BOX:
        return False
    across = largest(entry(camera.column, camera.width - 1) - entry(camera.column, 0))
    down = largest(entry(camera.row, camera.height - 1) - entry(camera.row, 0))
    # An image of one column or row has no neighbours: it is not known either.
    if not (across > LEAST_PIXEL * wp.float32(camera.width) and down > LEAST_PIXEL * wp.float32(camera.height)):
        return False
    return edge_planes(o, corners).steep


@wp.struct
class Part:
    """Four points in whose convex hull the hits of a triangle lie, in the space of the cube. extent: the largest
    |p - middle|_1 of them; infinite where there are none. size: at least their largest coordinate in the scene's space."""

    a: wp.vec3f
    b: wp.vec3f
    c: wp.vec3f
    d: wp.vec3f
    extent: wp.float32
    size: wp.float32


@wp.func
def part_in_view(box: wp.vec4i, o: wp.vec3f, corners: Corners, camera: Camera, cube: Cube) -> Part:
    """Where the hits of a box of pixels lie on the plane of a triangle: between those of the four pixels around it, one
    pixel farther, if these all see the plane. For what :func:`part_is_known` says."""
    m = inverse_depth(o, corners)
    a = relative_point(Ray(o, beyond_pixel(camera, box[0] - 1, box[1] - 1)), m, cube.middle)
    b = relative_point(Ray(o, beyond_pixel(camera, box[2] + 1, box[1] - 1)), m, cube.middle)
    c = relative_point(Ray(o, beyond_pixel(camera, box[0] - 1, box[3] + 1)), m, cube.middle)
    d = relative_point(Ray(o, beyond_pixel(camera, box[2] + 1, box[3] + 1)), m, cube.middle)
    way = wp.vec3f(cube.distance, 0.0, 0.0)
    part = Part()
    part.extent = wp.max(wp.max(total(a), total(b)), wp.max(total(c), total(d)))
    beyond = wp.max(
        wp.max(largest(a + cube.middle), largest(b + cube.middle)),
        wp.max(largest(c + cube.middle), largest(d + cube.middle)),
    )
    part.size = beyond + 8.0 * U32 * part.extent
    part.a = turned(a, cube) + way
    part.b = turned(b, cube) + way
    part.c = turned(c, cube) + way
    part.d = turned(d, cube) + way
    return part


@wp.func
def part_beyond_face(part: Part, face: wp.int32, distance: wp.float32) -> wp.bool:
    """Whether the hull lies certainly behind a face's centre or beyond its sides: both triangles that it consists of."""
    slack = 32.0 * U32 * (part.extent + distance)
    b = on_face(part.b, face)
    c = on_face(part.c, face)
    one = Corners(on_face(part.a, face), b, c)
    return beyond_face(one, slack) and beyond_face(Corners(on_face(part.d, face), b, c), slack)


@wp.func
def bound_rays(corners: Corners, box: wp.vec4i, o: wp.vec3f, camera: Camera, cube: Cube, cells: Any):
    """Enlarge the region by what a triangle with such a ``box`` on the image covers."""
    q = in_cube_space(corners, cube)
    extent = extent_from(cube.middle, corners)
    # What a hit point may be off (:mod:`.hit_points`), in the units of the slack and of a corner's error.
    far = wp.max(largest(corners.a - o), wp.max(largest(corners.b - o), largest(corners.c - o)))
    extent += OFF * far
    slack = 32.0 * U32 * (extent + cube.distance)
    size = wp.max(largest(corners.a), wp.max(largest(corners.b), largest(corners.c)))
    part = Part()
    part.extent = wp.INF
    if part_is_known(box, o, corners, camera):
        part = part_in_view(box, o, corners, camera, cube)
        part.extent += OFF * far
    in_part = part.extent < 1.0e30
    if in_part:
        size = wp.min(size, part.size)
    most = wp.cast(1.0001 * wp.max(size, FAR * wp.min(far, size + largest(o))), wp.int32)
    if most > cells.rectangle[LARGEST]:
        wp.atomic_max(cells.rectangle, LARGEST, most)
    for face in range(FACES):
        beyond = beyond_face(corners_on(q, face), slack)
        if in_part and not beyond:
            beyond = part_beyond_face(part, face, cube.distance)
        if not beyond:
            if cells.rectangle[FACE + face] != 0:
                cells.rectangle[FACE + face] = 0
            if face == 0:
                sides = rectangle_of(q.a, q.b, q.c, q.c, extent, wp.vec4f(-1.0, -1.0, 1.0, 1.0))
                if in_part:
                    sides = rectangle_of(part.a, part.b, part.c, part.d, part.extent, sides)
                lower(cells.rectangle, LOW_U, sides[0])
                lower(cells.rectangle, LOW_V, sides[1])
                lower(cells.rectangle, HIGH_U, -sides[2])
                lower(cells.rectangle, HIGH_V, -sides[3])


@wp.kernel(enable_backward=False, grid_stride=False)
def bounds_kernel(
    threads: wp.int32,
    lanes: wp.int32,
    empties: wp.bool,
    light: Light,
    camera: Camera,
    mesh: Mesh,
    cells: RayCells,
    facing: wp.array(dtype=wp.uint8),
):
    """What the triangles in view cover of face 0, with the error of a corner; the faces they touch; the largest coordinate
    of them, of a large one that of the part in view; and the rays that are expected. Empties ``farthest`` if it ``empties``.
    One thread per triangle or more, in whole blocks; ``lanes`` of a warp: 32, or 1 on a CPU.

    facing: uint8 [triangles]: of those in view, whether their hits have a ray. Only those that do are counted.
    """
    i = wp.tid()
    if empties:
        for tile in range(i, cells.farthest.shape[0], threads):
            cells.farthest[tile] = 0
    o = entry(camera.eye, 0)
    cube = cube_of_light(light)
    box = wp.vec4i(0, 0, -1, -1)
    if i < mesh.triangles.shape[0] and mesh.valid[i] != wp.uint8(0):
        corners = corners_at(mesh, i)
        box = box_of(corners, o, camera)
        wanted = box[2] >= box[0] and box[3] >= box[1]
        if wp.static(effects.receivers):
            if wanted:
                wanted = faces_light(light.index, o, corners, light.position)
                set_entry(facing, i, wp.uint8(wanted))
        if wanted:
            bound_rays(corners, box, o, camera, cube, cells)
        else:
            box = wp.vec4i(0, 0, -1, -1)
    expect_triangles(i, lanes, box, o, camera, cube, mesh, cells)
