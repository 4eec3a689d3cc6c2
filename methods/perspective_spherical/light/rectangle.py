"""The rectangle of a light grid: the view's (paper, Figure 5), all directions, a whole spot, or the scene's."""

import functools

import warp as wp

from ....harness.frame.geometry import Camera
from ...common.bounds import box_high, box_low
from ...exact.triangle import to_float64
from ..parameters import LIGHT_MAPS
from .bounds import BOUNDS
from .mapping import AZIMUTH_ELEVATION, CUBE, TWO_ANGLE, LightSpace, face_frame, whole
from .sphere import HALF_PI, PI, ROUNDING
from .tile_edges import EXTENT


@wp.func
def frustum_corner(camera: Camera, depth: wp.vec2f, i: wp.int32) -> wp.vec3d:
    """Corner i of the camera's frustum between two depths: bit 0 right, bit 1 up, bit 2 far."""
    x = wp.float64(camera.tangents[0])
    y = wp.float64(camera.tangents[1])
    z = wp.float64(depth[0])
    if i % 2 == 0:
        x = -x
    if (i // 2) % 2 == 0:
        y = -y
    if i >= 4:
        z = wp.float64(depth[1])
    d = to_float64(camera.axes[2]) + x * to_float64(camera.axes[0]) + y * to_float64(camera.axes[1])
    return to_float64(camera.eye[0]) + z * d


@wp.func
def in_frustum(camera: Camera, depth: wp.vec2f, p: wp.vec3d) -> wp.bool:
    v = p - to_float64(camera.eye[0])
    z = wp.dot(v, to_float64(camera.axes[2]))
    if z < wp.float64(depth[0]) or z > wp.float64(depth[1]):
        return False
    x = wp.abs(wp.dot(v, to_float64(camera.axes[0])))
    y = wp.abs(wp.dot(v, to_float64(camera.axes[1])))
    return x <= z * wp.float64(camera.tangents[0]) and y <= z * wp.float64(camera.tangents[1])


@wp.func
def spot_bounds(spots: wp.array2d(dtype=wp.float64), index: wp.int32) -> wp.vec4d:
    """The rectangle of a whole spot in its own axes."""
    half = wp.min(spots[index, 10], PI)
    rise = wp.min(spots[index, 11], HALF_PI)
    if spots[index, 0] == wp.float64(1.0):
        half = wp.acos(spots[index, 10])
        rise = wp.min(half, HALF_PI)
        if half > wp.float64(1.5):
            half = PI
    return wp.vec4d(-half, half, -rise, rise)


@wp.func
def view_bounds(
    bounds_of: wp.Function, all: wp.vec4d, face: wp.int32, space: LightSpace, camera: Camera, depth: wp.vec2f,
    sides: wp.int32,
) -> wp.vec4d:  # fmt: skip
    """Bounding rectangle of the camera's frustum, between its nearest and farthest triangle, seen from the light; ``all``
    where the light is in it. May reach beyond +-pi where a coordinate wraps.
    """
    light = to_float64(space.proxy_positions[space.index])
    axes = space.axes[0]
    if in_frustum(camera, depth, light):
        return all
    none = wp.float64(wp.INF)
    found = wp.vec4d(none, -none, none, -none)
    # Loops that the compiler does not unroll: the bounds are long, and run once per frame.
    for side in range(sides):
        # The four corners of a side: those with bit (side / 2) equal to side % 2, in order around it.
        bit = side // 2
        fixed = (side % 2) << bit
        step = wp.int32(1)
        if bit == 0:
            step = 2
        other = 7 - (1 << bit) - step
        p0 = face_frame(axes * (frustum_corner(camera, depth, fixed) - light), face)
        p1 = face_frame(axes * (frustum_corner(camera, depth, fixed + step) - light), face)
        p2 = face_frame(axes * (frustum_corner(camera, depth, fixed + step + other) - light), face)
        p3 = face_frame(axes * (frustum_corner(camera, depth, fixed + other) - light), face)
        for half in range(sides // 3):
            corner = p1
            if half == 1:
                corner = p3
            normal = wp.cross(corner - p0, p2 - p0)
            # Seen edge-on (or without area) it adds nothing that its neighbours do not hold.
            if wp.abs(wp.dot(normal, p0)) > wp.float64(1.0e-12) * wp.length(normal) * wp.length(p0):
                b = bounds_of(p0, corner, p2, wp.float64(4.0) * ROUNDING)
                if b[1] >= b[0]:
                    found = joint(found, b)
    return found


@wp.func
def joint(a: wp.vec4d, b: wp.vec4d) -> wp.vec4d:
    """The rectangle around two."""
    return wp.vec4d(wp.min(a[0], b[0]), wp.max(a[1], b[1]), wp.min(a[2], b[2]), wp.max(a[3], b[3]))


@wp.func
def in_range(low: wp.float64, high: wp.float64, least: wp.float64, most: wp.float64, wrap: wp.int32) -> wp.vec2d:
    """What an interval covers of a coordinate's range: all of it where it reaches beyond a seam."""
    if wrap == 1 and (low < least or high > most):
        return wp.vec2d(least, most)
    return wp.vec2d(wp.max(low, least), wp.min(high, most))


@functools.cache
def make_clamp_kernel(map: str) -> wp.Kernel:
    """The rectangles that are not the rays' own, under one light map."""
    bounds_of, wrap = BOUNDS[map]
    number = LIGHT_MAPS.index(map)

    @wp.kernel(enable_backward=False, module="unique")
    def clamp_kernel(
        faces: wp.int32,
        clamp: wp.int32,
        sides: wp.int32,
        space: LightSpace,
        spots: wp.array2d(dtype=wp.float64),
        camera: Camera,
        depth_range: wp.array(dtype=wp.float32),
        extent: wp.array(dtype=wp.float64),
    ):
        """Widen the rays' rectangles to the view's (clamp 1) or to all directions or the whole spot (2).

        ``sides``: of a frustum, 6. Rays always lie inside: a rectangle is never smaller than theirs. Depth planes
        stay those of the rays.
        """
        face = wp.tid()
        near = wp.float64(wp.INF)
        far = -near
        for other in range(faces):
            near = wp.min(near, extent[other * EXTENT + 2])
            far = wp.max(far, extent[other * EXTENT + 5])
        if not (far >= near):
            return
        all = whole(wp.static(number))
        bounds = all
        if clamp == 1:
            depth = wp.vec2f(wp.max(0.0, depth_range[0]), depth_range[1])
            bounds = view_bounds(bounds_of, all, face, space, camera, depth, sides)
            u = in_range(bounds[0], bounds[1], all[0], all[1], wp.static(wrap[0]))
            v = in_range(bounds[2], bounds[3], all[2], all[3], wp.static(wrap[1]))
            bounds = wp.vec4d(u[0], u[1], v[0], v[1])
            if not (bounds[1] >= bounds[0]):
                return
        elif wp.static(map == "azimuth-elevation") and space.aimed and spots[space.index, 0] != wp.float64(0.0):
            bounds = spot_bounds(spots, space.index)
        offset = face * EXTENT
        # No ray in this face: its own depth planes are empty, those of all rays serve.
        if not (extent[offset + 5] >= extent[offset + 2]):
            extent[offset + 2] = near
            extent[offset + 5] = far
        own = wp.vec4d(extent[offset], extent[offset + 3], extent[offset + 1], extent[offset + 4])
        set_rectangle(extent, offset, joint(own, bounds))

    return clamp_kernel


@wp.func
def set_rectangle(extent: wp.array(dtype=wp.float64), offset: wp.int32, bounds: wp.vec4d):
    """Lowest and highest coordinates of a face; its distances stay."""
    extent[offset] = bounds[0]
    extent[offset + 3] = bounds[1]
    extent[offset + 1] = bounds[2]
    extent[offset + 4] = bounds[3]


@wp.kernel(enable_backward=False)
def scene_kernel(
    space: LightSpace, spots: wp.array2d(dtype=wp.float64), scene: wp.array(dtype=wp.float32),
    reach: wp.array(dtype=wp.float32), extent: wp.array(dtype=wp.float64),
):  # fmt: skip
    """Rectangles that hold the sphere around the scene, whatever the camera sees; empty where it lies in no face.

    ``scene``: its box, as :mod:`..common.bounds` writes it. Fills ``space.box`` with it, and ``space.eye`` with a bound
    on the eye's coordinates. A light in the sphere has rays in all directions, and so have maps and
    axes that do not look along the way to the scene; a spot has its own.
    """
    face = wp.tid()
    offset = face * EXTENT
    for axis in range(3):
        extent[offset + axis] = wp.float64(wp.INF)
        extent[offset + 3 + axis] = wp.float64(-wp.INF)
        if face == 0:
            space.box[axis] = wp.float64(scene[axis])
            space.box[3 + axis] = -wp.float64(scene[3 + axis])
    if face == 0:
        space.eye[0] = wp.vec3f(reach[0], reach[0], reach[0])
    low = to_float64(box_low(scene))
    high = to_float64(box_high(scene))
    if not (low[0] <= high[0]):
        return
    half = wp.float64(0.5)
    radius = half * wp.length(high - low) * wp.float64(1.0 + 1.0e-6)
    distance = wp.length((low + high) * half - to_float64(space.proxy_positions[space.index]))
    bounds = whole(space.map)
    if spots[space.index, 0] != wp.float64(0.0):
        if space.map == AZIMUTH_ELEVATION and space.aimed:
            bounds = spot_bounds(spots, space.index)
    elif space.aimed and distance > wp.float64(1.5) * radius and space.map != TWO_ANGLE:
        angle = wp.asin(radius / distance)
        if space.map == CUBE:
            if face > 0:
                return
            angle = wp.tan(angle)
        bounds = wp.vec4d(-angle, angle, -angle, angle)
    set_rectangle(extent, offset, bounds)
    extent[offset + 2] = wp.max(wp.float64(0.0), distance - radius)
    extent[offset + 5] = distance + radius
