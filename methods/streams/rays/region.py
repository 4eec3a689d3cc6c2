"""The region of a light's rays from the triangles, before there are rays: places and cells in one pass.

What the triangles cover of the cube bounds what the hits on them do. It is found beside the camera's passes, so that the
pass that places the rays can count them in their cells, too. With few triangles that costs little.

Where only surfaces that face the light have shadow rays, the triangles say which pixels do: eye and light lie on one side
of a triangle's plane or not, whatever the pixel. The kernels' effect ``receivers`` means this.

Of a spot's region what lies outside its cone is left out. Whether a hit point lies in the cone the harness decides, in
plain float64. On a triangle seen edge-on, or next to the light, that may be off by more than the slack. Such a ray may lie
outside the region. It is then an outside ray, and is tested against every triangle in float64 instead
(:mod:`..occlusion.undecided`). All other rays are placed to 2^-18 of their direction.
"""

import math
from typing import Any

import warp as wp

from ....harness.frame.effects.receivers import faces_light
from ....harness.frame.effects.specialise import effects
from ....harness.frame.geometry import Camera, Corners, Mesh, Ray
from ...common.reads import corners_at
from ...exact.planes import farthest_corner
from ...exact.triangle import U32, largest, to_float32, to_float64, total
from ...gpu.entries import entry, set_entry
from ..camera.pixels import edge_planes, inverse_depth, largest_of
from ..camera.stream import box_of
from ..cube.cells import FACES, RayCells, on_face
from ..cube.footprint import FINEST, beyond_face, corners_on, depth_slack, extent_from, in_cube_space
from ..cube.lights import CONE, Cube, Light, cube_of_light, turned
from ..cube.rectangle import EMPTY, FACE, HIGH_U, HIGH_V, LARGEST, LOW_U, LOW_V, from_ordered, ordered
from .hit_points import FAR

OFF = wp.constant(wp.float32(2.0**-7))
"""Share of the way from the eye that is added to the extent of a triangle: a hit point is off by at most 2^-29 of that way
(:mod:`.hit_points`), and 32 u of the share are eight times as much.
"""

LARGE_BOX = wp.constant(256)
"""Of a triangle with a box of more pixels only the part in view counts."""

LEAST_PIXEL = wp.constant(wp.float32(2.0**-19))
"""Least difference of the directions of neighbouring pixels for that. Directions are rounded by at most 8 u in each
coordinate, those beyond the image included: by half a pixel if the difference is so small.
"""

SLACK = 1.0e-4
"""Added to the angle of a cone: a ray that the camera's words place is right to 2^-18 of its direction
(:mod:`.hit_points`), and the proxy turns it by less.
"""

COS_SLACK, SIN_SLACK = wp.constant(wp.float64(math.cos(SLACK))), wp.constant(wp.float64(math.sin(SLACK)))

WIDEST = wp.constant(wp.float64(-0.999))
"""A cone with a lesser cosine leaves nothing out: its angle with the slack must stay below 180 degrees."""


@wp.func
def rectangle_of(a: wp.vec3f, b: wp.vec3f, c: wp.vec3f, d: wp.vec3f, extent: wp.float32, before: wp.vec4f) -> wp.vec4f:
    """The part of a rectangle of face 0 (least u and v, least -u and -v) that the convex hull of four points may cover.

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
    return wp.max(before, wp.vec4f(least_u - pad, least_v - pad, -most_u - pad, -most_v - pad))


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
    |p - middle|_1 of them; infinite where there are none. size: at least their largest coordinate in the scene's space.
    """

    a: wp.vec3f
    b: wp.vec3f
    c: wp.vec3f
    d: wp.vec3f
    extent: wp.float32
    size: wp.float32


@wp.func
def part_in_view(box: wp.vec4i, o: wp.vec3f, corners: Corners, camera: Camera, cube: Cube) -> Part:
    """Where the hits of a box of pixels lie on the plane of a triangle: between those of the four pixels around it, one
    pixel farther, if these all see the plane. For what :func:`part_is_known` says.
    """
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
def part_beyond_face(part: Part, face: wp.int32, cube: Cube) -> wp.bool:
    """Whether the hull lies certainly behind a face's centre or beyond its sides: both triangles that it consists of."""
    slack = depth_slack(part.extent, cube)
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
    far = farthest_corner(o, corners)
    extent += OFF * far
    slack = depth_slack(extent, cube)
    size = largest_of(corners)
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
            beyond = part_beyond_face(part, face, cube)
        if not beyond:
            if cells.rectangle[FACE + face] != 0:
                cells.rectangle[FACE + face] = 0
            if face == 0:
                sides = rectangle_of(q.a, q.b, q.c, q.c, extent, wp.vec4f(-1.0, -1.0, -1.0, -1.0))
                if in_part:
                    sides = rectangle_of(part.a, part.b, part.c, part.d, part.extent, sides)
                for k in range(4):
                    word = ordered(sides[k])
                    if word < cells.rectangle[k]:
                        wp.atomic_min(cells.rectangle, k, word)


@wp.kernel(enable_backward=False, grid_stride=False)
def bounds_kernel(
    threads: wp.int32,
    empties: wp.bool,
    light: Light,
    camera: Camera,
    mesh: Mesh,
    cells: RayCells,
    facing: wp.array(dtype=wp.uint8),
):
    """What the triangles in view cover of face 0, with the error of a corner; the faces they touch; the largest coordinate
    of them, of a large one that of the part in view. Empties ``farthest`` if it ``empties``. One thread per triangle or
    more.

    facing: uint8 [triangles]: of those in view, whether their hits have a ray. Only those that do are counted.
    """
    i = wp.tid()
    if empties:
        for tile in range(i, cells.farthest.shape[0], threads):
            cells.farthest[tile] = 0
    o = entry(camera.eye, 0)
    cube = cube_of_light(light)
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
    that touch it, which are at the angle of the cone from its axis.
    """
    before = f * f - sine * sine
    half = sine * wp.sqrt(before + r * r)
    return wp.vec2d((f * r - half) / before, (f * r + half) / before)


@wp.kernel(enable_backward=False, grid_stride=False)
def cone_kernel(light: Light, rectangle: wp.array(dtype=wp.int32), outside_rays: wp.array(dtype=wp.int32)):
    """Take from what the triangles cover the faces that a light's cone does not meet, and of face 0 what lies beside a cone
    that is wholly before its centre. One thread. A spot of another kind, or of nearly all directions, keeps all. Empties
    the list of ``outside_rays``.
    """
    outside_rays[0] = 0
    cosine = light.spot[light.index, 10]
    if light.spot[light.index, 0] != CONE or cosine < WIDEST:
        return
    sine = wp.sqrt(wp.max(wp.float64(1.0) - cosine * cosine, wp.float64(0.0)))
    wider = cosine * COS_SLACK - sine * SIN_SLACK
    axis = light.axes[light.index] * wp.vec3d(
        light.spot[light.index, 1], light.spot[light.index, 2], light.spot[light.index, 3]
    )
    for face in range(FACES):
        if face_cosine(on_face(axis, face)) < wider:
            rectangle[FACE + face] = EMPTY
    sine = sine * COS_SLACK + cosine * SIN_SLACK
    if cosine > wp.float64(0.0) and axis[0] > sine and rectangle[FACE] == 0:
        across = cone_sides(axis[0], axis[1], sine)
        up = cone_sides(axis[0], axis[2], sine)
        sides = wp.vec4d(across[0], up[0], -across[1], -up[1])
        for k in range(4):  # moved inwards, where they are not yet
            rectangle[k] = wp.max(rectangle[k], ordered(wp.float32(sides[k])))
        wide = from_ordered(rectangle[LOW_U]) < -from_ordered(rectangle[HIGH_U])
        if not (wide and from_ordered(rectangle[LOW_V]) < -from_ordered(rectangle[HIGH_V])):
            rectangle[FACE] = EMPTY  # the cone misses what the triangles cover
