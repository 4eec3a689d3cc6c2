"""Warp structs that kernels take as arguments: mesh, camera, rays and closest hits of a frame. A launch copies a
struct, with the addresses of its arrays, into the kernel's arguments. The addresses are fixed for the lifetime of a
frame, so a captured graph may store them. :class:`.frame.Frame` makes each struct once.
"""

from typing import Any, TypeVar, dataclass_transform

import warp as wp

T = TypeVar("T")


@dataclass_transform()
def value_struct(kind: type[T]) -> type[T]:
    """``wp.struct`` with type information for its constructor, which kernels call with positional arguments."""
    return wp.struct(kind)


def struct_with_bases(kind: type[T]) -> type[T]:
    """``wp.struct`` with the fields of the classes that ``kind`` extends before its own. All are of one module."""
    kind.__annotations__ = {
        name: of for one in reversed(kind.__mro__) for name, of in vars(one).get("__annotations__", {}).items()
    }
    return wp.struct(kind)


@wp.struct
class Mesh:
    """The triangles of a frame.

    points  vec3f [vertex_count]    triangles  vec3i [triangle_count]
    weld    int32 [vertex_count]: lowest index of a vertex at the same position
    valid   uint8 [triangle_count]: 0 for triangles that no ray hits
    """

    points: wp.array(dtype=wp.vec3f)
    triangles: wp.array(dtype=wp.vec3i)
    weld: wp.array(dtype=wp.int32)
    valid: wp.array(dtype=wp.uint8)


@wp.struct
class Camera:
    """The image size, the eye and the directions of the pixels.

    eye     vec3f [1]                 axes  vec3f [3]: right, up, forward
    column  vec3f [width], row  vec3f [height]: the direction of pixel (x, y) is column[x] + row[y]; of an orthographic
            camera, where its ray starts
    tangents  float32 [2]: half width and half height of the image plane at distance 1
    """

    width: wp.int32
    height: wp.int32
    eye: wp.array(dtype=wp.vec3f)
    axes: wp.array(dtype=wp.vec3f)
    tangents: wp.array(dtype=wp.float32)
    column: wp.array(dtype=wp.vec3f)
    row: wp.array(dtype=wp.vec3f)


@wp.struct
class Hits:
    """Closest hits of one ray per pixel, arrays [pixels]; see :class:`.frame.Answers`."""

    triangle: wp.array(dtype=wp.int32)
    t: wp.array(dtype=wp.float32)
    u: wp.array(dtype=wp.float32)
    v: wp.array(dtype=wp.float32)


@wp.struct
class Rays:
    """Mirrored rays of one bounce, arrays [pixels]; ``active`` is 0 where a pixel has no ray."""

    origin: wp.array(dtype=wp.vec3f)
    direction: wp.array(dtype=wp.vec3f)
    active: wp.array(dtype=wp.uint8)


@wp.struct
class Bounces:
    """Mirrored rays and the answers of a method to them; row b - 1 is bounce b. Empty if the scene has no mirrors.

    origin, direction  vec3f [bounces, pixels]: the rays, made by the harness (:mod:`.effects.mirrors`)
    active      uint8 [bounces, pixels]: 1 = the pixel has a ray; where it is 0, the ray is zero
    triangle, t, u, v  [bounces, pixels]: the ray's closest hit as in :class:`.frame.Answers`; a miss where there is no ray
    shadowed  uint8 [bounces, light_count, pixels]: the shadow bits of those hits
    receivers   uint8 [bounces, light_count, pixels]: 1 = the hit has a shadow ray; empty if every hit is
                a receiver
    """

    origin: wp.array2d(dtype=wp.vec3f)
    direction: wp.array2d(dtype=wp.vec3f)
    active: wp.array2d(dtype=wp.uint8)
    triangle: wp.array2d(dtype=wp.int32)
    t: wp.array2d(dtype=wp.float32)
    u: wp.array2d(dtype=wp.float32)
    v: wp.array2d(dtype=wp.float32)
    shadowed: wp.array3d(dtype=wp.uint8)
    receivers: wp.array3d(dtype=wp.uint8)


@value_struct
class Ray:
    """A ray origin + t direction. The direction is not normalised."""

    origin: wp.vec3f
    direction: wp.vec3f


@value_struct
class Corners:
    """The positions of a triangle's vertices 0, 1 and 2."""

    a: wp.vec3f
    b: wp.vec3f
    c: wp.vec3f


@wp.func
def direction_through(camera: Camera, x: wp.int32, y: wp.int32) -> wp.vec3f:
    """The direction of the pixel in a column and a row."""
    return camera.column[x] + camera.row[y]


@wp.func
def ray_through(camera: Camera, x: wp.int32, y: wp.int32) -> Ray:
    """The primary ray of the pixel in a column and a row."""
    return Ray(camera.eye[0], direction_through(camera, x, y))


@wp.func
def parallel_ray(camera: Camera, pixel: wp.int32) -> Ray:
    """The primary ray of a pixel of an orthographic camera."""
    start = direction_through(camera, pixel % camera.width, pixel // camera.width)
    return Ray(start, camera.axes[2])


@wp.func
def ray_of(camera: Camera, pixel: wp.int32) -> Ray:
    """The primary ray of a pixel; pixel = row * width + column."""
    return ray_through(camera, pixel % camera.width, pixel // camera.width)


@wp.func
def mirrored_ray(rays: Rays, pixel: wp.int32) -> Ray:
    """The mirrored ray of a pixel; zero where ``rays.active`` is 0."""
    return Ray(rays.origin[pixel], rays.direction[pixel])


@wp.func
def corners_of(mesh: Mesh, triangle: wp.int32) -> Corners:
    """The corners of a triangle."""
    face = mesh.triangles[triangle]
    return Corners(mesh.points[face[0]], mesh.points[face[1]], mesh.points[face[2]])


@wp.func
def weld_of(mesh: Mesh, triangle: wp.int32) -> wp.vec3i:
    """The weld indices of a triangle's corners. Edge functions take the two ends of an edge in this order."""
    face = mesh.triangles[triangle]
    return wp.vec3i(mesh.weld[face[0]], mesh.weld[face[1]], mesh.weld[face[2]])


def filled(kind: Any, **fields: Any) -> Any:
    """A struct with the given fields. Fields that a kernel does not read may be left out; their arrays are empty."""
    struct = kind()
    for name, value in fields.items():
        setattr(struct, name, value)
    return struct


def bounce_arrays(bounces: int, lights: int, pixels: int, limited: bool) -> Any:
    """:class:`Bounces` on the current device, filled with zeros; empty for 0 bounces."""
    plane = (bounces, pixels) if bounces else (0, 0)
    bits = (bounces, max(1, lights), pixels) if bounces else (0, 0, 0)
    kinds = {
        "origin": wp.vec3f, "direction": wp.vec3f, "active": wp.uint8, "triangle": wp.int32,
        "t": wp.float32, "u": wp.float32, "v": wp.float32,
    }  # fmt: skip
    return filled(
        Bounces,
        **{name: wp.zeros(plane, dtype=kind) for name, kind in kinds.items()},
        shadowed=wp.zeros(bits, dtype=wp.uint8),
        receivers=wp.zeros(bits if limited else (0, 0, 0), dtype=wp.uint8),
    )
