"""Where a triangle lies on the image, conservatively: camera space, frustum planes, box of pixel centres.

Camera space is (right, up, forward) from the eye; a pixel's ray is forward + sx right + sy up.
"""

import warp as wp

from ...harness.frame.geometry import Camera, Corners
from ..exact.triangle import U32, largest, total
from ..gpu.division import LARGEST_DIVISOR, LEAST_DIVISOR, about_inverse


@wp.func
def camera_space(p: wp.vec3f, eye: wp.vec3f, axes: wp.array(dtype=wp.vec3f)) -> wp.vec3f:
    v = p - eye
    return wp.vec3f(wp.dot(axes[0], v), wp.dot(axes[1], v), wp.dot(axes[2], v))


@wp.func
def in_camera_space(camera: Camera, corners: Corners) -> Corners:
    """A triangle's corners in camera space."""
    eye = camera.eye[0]
    return Corners(
        camera_space(corners.a, eye, camera.axes),
        camera_space(corners.b, eye, camera.axes),
        camera_space(corners.c, eye, camera.axes),
    )


@wp.func
def outside_plane(a: wp.vec3f, b: wp.vec3f, c: wp.vec3f, plane: wp.vec3f) -> wp.bool:
    """Whether the whole triangle lies certainly outside a plane through the eye."""
    slack = 32.0 * U32 * total(plane)
    return (
        wp.dot(plane, a) > slack * largest(a)
        and wp.dot(plane, b) > slack * largest(b)
        and wp.dot(plane, c) > slack * largest(c)
    )


@wp.func
def out_of_view(a: wp.vec3f, b: wp.vec3f, c: wp.vec3f, tx: wp.float32, ty: wp.float32) -> wp.bool:
    """Whether the triangle lies certainly outside one plane of the view frustum."""
    return (
        outside_plane(a, b, c, wp.vec3f(1.0, 0.0, -tx))
        or outside_plane(a, b, c, wp.vec3f(-1.0, 0.0, -tx))
        or outside_plane(a, b, c, wp.vec3f(0.0, 1.0, -ty))
        or outside_plane(a, b, c, wp.vec3f(0.0, -1.0, -ty))
        or outside_plane(a, b, c, wp.vec3f(0.0, 0.0, -1.0))
    )


@wp.func
def longest(a: wp.vec3f, b: wp.vec3f, c: wp.vec3f) -> wp.float32:
    """The longest edge, by its largest coordinate."""
    return wp.max(largest(b - a), wp.max(largest(c - b), largest(a - c)))


@wp.func
def screen_scale(tx: wp.float32, ty: wp.float32, width: wp.int32, height: wp.int32) -> wp.vec4f:
    """(pixels per sx, pixels per sy, column of sx = 0, row of sy = 0); pixel centres are at whole numbers."""
    w = wp.float32(width)
    h = wp.float32(height)
    return wp.vec4f(0.5 * w / tx, 0.5 * h / ty, 0.5 * w - 0.5, 0.5 * h - 0.5)


@wp.func
def is_in_front(p: wp.vec3f) -> wp.bool:
    """Whether a vertex lies far enough in front of the eye's plane for its projection to be known."""
    return p[2] > 1.0e-4 * largest(p) and p[2] > LEAST_DIVISOR and p[2] < LARGEST_DIVISOR


@wp.func
def in_front(a: wp.vec3f, b: wp.vec3f, c: wp.vec3f) -> wp.bool:
    """Whether every vertex does (:func:`is_in_front`)."""
    return is_in_front(a) and is_in_front(b) and is_in_front(c)


@wp.func
def pixel_box(
    a: wp.vec3f, b: wp.vec3f, c: wp.vec3f, tx: wp.float32, ty: wp.float32, width: wp.int32, height: wp.int32
) -> wp.vec4i:
    """First and last column and row of the pixel centres that may see the triangle; empty if last < first.

    A vertex behind the eye, or so near the eye's plane that its projection is not known, leaves the full image.
    A camera-space coordinate is off by at most 13 u of the vertex's largest: four roundings of the difference from the
    eye and of the sum of products, two because axes in float32 are not exactly orthogonal. So the column of a vertex far
    above the view is off by more than its own rounding. The pad covers this, three roundings of the projection
    (:func:`..gpu.division.about_inverse`), and the 2^-30 of its size that a closed triangle reaches beyond itself.
    """
    if not in_front(a, b, c):
        return wp.vec4i(0, 0, width - 1, height - 1)
    w = wp.float32(width)
    h = wp.float32(height)
    s = screen_scale(tx, ty, width, height)
    near_a = about_inverse(a[2])
    near_b = about_inverse(b[2])
    near_c = about_inverse(c[2])
    ax = s[2] + s[0] * (a[0] * near_a)
    bx = s[2] + s[0] * (b[0] * near_b)
    cx = s[2] + s[0] * (c[0] * near_c)
    ay = s[3] - s[1] * (a[1] * near_a)
    by = s[3] - s[1] * (b[1] * near_b)
    cy = s[3] - s[1] * (c[1] * near_c)
    beyond = 8.0e-9 * longest(a, b, c) * wp.max(near_a, wp.max(near_b, near_c))
    off = 24.0 * U32 * wp.max(largest(a) * near_a, wp.max(largest(b) * near_b, largest(c) * near_c))
    pad_x = 0.01 + (4.0e-6 + beyond + off) * (1.0 + tx) * s[0] + 1.0e-6 * w
    pad_y = 0.01 + (4.0e-6 + beyond + off) * (1.0 + ty) * s[1] + 1.0e-6 * h
    return wp.vec4i(
        wp.int32(wp.ceil(wp.clamp(wp.min(ax, wp.min(bx, cx)) - pad_x, 0.0, w))),
        wp.int32(wp.ceil(wp.clamp(wp.min(ay, wp.min(by, cy)) - pad_y, 0.0, h))),
        wp.int32(wp.floor(wp.clamp(wp.max(ax, wp.max(bx, cx)) + pad_x, -1.0, w - 1.0))),
        wp.int32(wp.floor(wp.clamp(wp.max(ay, wp.max(by, cy)) + pad_y, -1.0, h - 1.0))),
    )
