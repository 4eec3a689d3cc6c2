"""The region of a light's rays from the triangles, before there are rays: places and cells in one pass.

What the triangles cover of the cube bounds what the hits on them do. It is found beside the camera's passes, so that the
pass that places the rays can count them in their cells, too. With few triangles that costs little.
"""

from __future__ import annotations

import warp as wp

from ....harness.frame.geometry import Camera, Corners, Hits, Mesh, Ray
from ...common.entries import entry, set_entry
from ...common.pixels import tile_pixel
from ...common.reserve import number_in
from ...common.triangle import U32, largest, to_float32, to_float64, total
from ..aim import EMPTY, FACE, FACES, HIGH_U, HIGH_V, LOW_U, LOW_V, Cube, ordered
from ..camera.pixels import inverse_depth
from ..camera.stream import box_of
from ..cube import on_face, place_of, record_rays
from ..fetch import corners_at
from ..queues import RAYS
from ..warps import scan_row
from .bins import SPARE, RayCells, cell_along, cell_index, face_rectangle, set_table
from .cells import FINEST, beyond_face, cube_space, reach_from, turned
from .reach import raise_farthest

LARGE_BOX = wp.constant(256)
"""Of a triangle with a box of more pixels only the part in view counts."""


@wp.func
def lower(words: wp.array(dtype=wp.int32), k: wp.int32, x: wp.float32):
    """Lower a side of the rectangle to at most x."""
    word = ordered(x)
    if word < words[k]:
        wp.atomic_min(words, k, word)


@wp.func
def rectangle_of(
    a: wp.vec3f, b: wp.vec3f, c: wp.vec3f, d: wp.vec3f, reach: wp.float32, before: wp.vec4f
) -> wp.vec4f:
    """The part of a rectangle of face 0 (least u and v, greatest u and v) that the convex hull of four points may cover.

    Points are (along, across, up), and ``reach`` bounds |p - middle|_1 of them; errors are those of :func:`.cells.on_cells`.
    Where a point lies behind the centre of projection or too near its plane, the rectangle is returned as it is.
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
    pad = 32.0 * U32 * ((1.0 + widest) * reach / nearest + widest)
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


@wp.struct
class Part:
    """Four points in whose convex hull the hits of a triangle lie, in the space of the cube. reach: the largest
    |p - middle|_1 of them; infinite where there are none."""

    a: wp.vec3f
    b: wp.vec3f
    c: wp.vec3f
    d: wp.vec3f
    reach: wp.float32


@wp.func
def part_in_view(box: wp.vec4i, o: wp.vec3f, corners: Corners, camera: Camera, cube: Cube) -> Part:
    """Where the hits of a box of pixels lie on the plane of a triangle: between those of the four pixels around it, one
    pixel farther, if these all see the plane."""
    m = inverse_depth(o, corners)
    a = relative_point(Ray(o, beyond_pixel(camera, box[0] - 1, box[1] - 1)), m, cube.middle)
    b = relative_point(Ray(o, beyond_pixel(camera, box[2] + 1, box[1] - 1)), m, cube.middle)
    c = relative_point(Ray(o, beyond_pixel(camera, box[0] - 1, box[3] + 1)), m, cube.middle)
    d = relative_point(Ray(o, beyond_pixel(camera, box[2] + 1, box[3] + 1)), m, cube.middle)
    way = wp.vec3f(cube.distance, 0.0, 0.0)
    part = Part()
    part.reach = wp.max(wp.max(total(a), total(b)), wp.max(total(c), total(d)))
    part.a = turned(a, cube) + way
    part.b = turned(b, cube) + way
    part.c = turned(c, cube) + way
    part.d = turned(d, cube) + way
    return part


@wp.func
def part_beyond_face(part: Part, face: wp.int32, distance: wp.float32) -> wp.bool:
    """Whether the hull lies certainly behind a face's centre or beyond its sides: both triangles that it consists of."""
    slack = 32.0 * U32 * (part.reach + distance)
    b = on_face(part.b, face)
    c = on_face(part.c, face)
    return beyond_face(on_face(part.a, face), b, c, slack) and beyond_face(on_face(part.d, face), b, c, slack)


@wp.kernel(enable_backward=False, grid_stride=False)
def bounds_kernel(
    threads: wp.int32,
    light: wp.int32,
    camera: Camera,
    cubes: wp.array(dtype=Cube),
    mesh: Mesh,
    touched: wp.array(dtype=wp.int32),
    cells: RayCells,
):
    """What the triangles in view cover of face 0, with the error of a corner; the faces they touch. Empties ``farthest``.

    touched: int32 [6]: set to 1, 0 before. One thread per triangle or more.
    """
    i = wp.tid()
    for tile in range(i, cells.farthest.shape[0], threads):
        cells.farthest[tile] = 0
    if i >= mesh.triangles.shape[0]:
        return
    if mesh.valid[i] == wp.uint8(0):
        return
    corners = corners_at(mesh, i)
    o = entry(camera.eye, 0)
    box = box_of(corners, o, camera)
    if box[2] < box[0] or box[3] < box[1]:
        return
    cube = cubes[light]
    qa = cube_space(corners.a, cube)
    qb = cube_space(corners.b, cube)
    qc = cube_space(corners.c, cube)
    reach = reach_from(cube.middle, corners)
    slack = 32.0 * U32 * (reach + cube.distance)
    part = Part()
    part.reach = wp.INF
    if (box[2] - box[0] + 1) * (box[3] - box[1] + 1) > LARGE_BOX and camera.width > 1 and camera.height > 1:
        part = part_in_view(box, o, corners, camera, cube)
    in_part = part.reach < 1.0e30
    for face in range(FACES):
        beyond = beyond_face(on_face(qa, face), on_face(qb, face), on_face(qc, face), slack)
        if in_part and not beyond:
            beyond = part_beyond_face(part, face, cube.distance)
        if not beyond:
            if touched[face] == 0:
                touched[face] = 1
            if face == 0:
                sides = rectangle_of(qa, qb, qc, qc, reach, wp.vec4f(-1.0, -1.0, 1.0, 1.0))
                if in_part:
                    sides = rectangle_of(part.a, part.b, part.c, part.d, part.reach, sides)
                lower(cells.rectangle, LOW_U, sides[0])
                lower(cells.rectangle, LOW_V, sides[1])
                lower(cells.rectangle, HIGH_U, -sides[2])
                lower(cells.rectangle, HIGH_V, -sides[3])


@wp.func
def cells_along(touched: wp.array(dtype=wp.int32), cells: wp.vec2i) -> wp.int32:
    """Cells along a face: as :func:`.bins.cells_in_use`, for the faces that triangles touch."""
    chosen = cells[1]
    for k in range(1, FACES):
        if touched[k] != 0:
            chosen = cells[0]
    return chosen


@wp.kernel(enable_backward=False, grid_stride=False)
def place_kernel(
    light: wp.int32,
    camera: Camera,
    lights: wp.array(dtype=wp.vec3f),
    axes: wp.array(dtype=wp.mat33d),
    hits: Hits,
    hit_points: wp.array(dtype=wp.vec3d),
    touched: wp.array(dtype=wp.int32),
    cells: RayCells,
    visibility: wp.array2d(dtype=wp.uint8),
):
    """:func:`.bins.map_kernel` and :func:`.bins.count_kernel` in one, where the rectangle is known."""
    at = tile_pixel(wp.tid(), camera.width, camera.height)
    face = wp.int32(-1)
    size = wp.int32(0)
    if at[0] >= 0:
        pixel = at[1] * camera.width + at[0]
        visibility[light, pixel] = wp.uint8(0)
        if entry(hits.triangle, pixel) >= 0:
            hit = hit_points[pixel]
            p = place_of(hit, lights[light], axes[light])
            h = to_float32(hit)
            set_entry(cells.point, pixel, wp.vec4f(h[0], h[1], h[2], wp.cast(pixel, wp.float32)))
            face = wp.int32(p[2])
            size = wp.cast(largest(h), wp.int32)
            along = cells_along(touched, cells.cells)
            r = face_rectangle(face, cells.rectangle, along)
            x = cell_along(p[0], r[0], r[2], along)
            y = cell_along(p[1], r[1], r[3], along)
            cell = cell_index(face, x, y, along)
            set_entry(cells.slot, pixel, wp.vec2i(cell, number_in(cells.count, cell)))
            raise_farthest(cells.farthest, face, x, y, p[3], along)
    record_rays(cells.rectangle, EMPTY, EMPTY, EMPTY, EMPTY, face, size)


@wp.kernel(enable_backward=False, grid_stride=False)
def scan_kernel(touched: wp.array(dtype=wp.int32), cells: RayCells, counts: wp.array(dtype=wp.int32)):
    """:func:`.bins.scan_kernel` with the cells that ``touched`` chooses."""
    k = wp.tid()
    row = k // 128
    along = cells_along(touched, cells.cells)
    if cells.rectangle[FACE + row // along] == 0:
        scan_row(cells.count, cells.offset, row * (along + SPARE), along, counts, RAYS)
    set_table(k, cells, along)
