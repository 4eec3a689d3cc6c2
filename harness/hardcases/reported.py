"""P48-P50, S41-S42: errors that users of other ray tracers reported. Each name has the project and the number of the
thread; where a thread gives its numbers only in part, the case has the configuration that it describes and says so.

P32, P33, S32, S33: cases found by random search on methods with one rounding margin (pad) removed: a few triangles with
small dyadic coordinates, whose borders rays meet exactly, in a tile of one pixel or in one cell. No other case depends on
these pads. With default settings the cases are easy; tests run them with the settings for which the pad decides.
"""

from typing import Any

import numpy as np

from ..scene.prepared import prepare
from ..scene.scene import Camera, Geometry, Light, Scene
from .case import ORIGIN, TURNED, Counts, Trial, axes, hard, rows, view
from .closed import directions
from .shapes import closed_behind, float32_of, icosphere, joined, lattice, plane, triangles

START = np.array([0x3E6A2C13, 0x3FAD24CE, 0x3E6A2C13], dtype=np.uint32).view(np.float32).astype(np.float64)
"""Origin of the rays of embree#423: x and y are the bits given in the thread, z is not known."""


@hard(
    "P48 embree#423{end}", "triangles far beside rays in their planes",
    "edge functions of one sign by rounding: a false hit", TURNED,
)  # fmt: skip
def embree_423(**place: Any) -> Trial:
    """False hits of triangles far from a ray: each of 256 rays lies in the plane of a triangle, up to the rounding of
    float32.

    In the thread the edge of a mesh is such a ray, and the triangle lies far from it; without fused arithmetic all three
    edge functions have one sign by rounding alone. Only the first two coordinates of the thread are available
    (:data:`START`); the triangles follow its description.
    """
    towards, random = (0.2, -0.1, -1.0), np.random.default_rng(423)
    ways = directions(towards, 0.4, eye=START)
    aside = random.normal(size=(256, 1, 3))
    far = random.uniform(1, 4, (256, 3, 1)) * np.sign(random.normal(size=(256, 1, 1)))
    along = random.uniform(1, 5, (256, 3, 1))
    mesh = joined(triangles(START + along * ways[:, None] + far * aside), plane(2, -8, 32))
    return view(mesh, [(0.5, 3, 4), START], START, towards, 0.4, **place)


@hard("P49 mitsuba3#1149{end}", "rays through the edge of a square", "rays lost between two triangles", TURNED)
def mitsuba_1149(**place: Any) -> Trial:
    """Rays through the middle of the edge that two triangles of a square share, from directions over a hemisphere.

    The thread's test has a unit square turned by 90 degrees about (1, 1, 1), and rays towards its middle from a hemisphere
    with density proportional to the cosine. The rays of a picture start in one point, so here each of 256 rays has a
    square of its own, turned so that ray and square have the same relative position as in the thread; the squares do not
    touch.
    """
    ways = directions((0, 0, -1), 0.5)
    u, v = (axis.ravel() for axis in np.meshgrid(np.linspace(0.05, 0.95, 16), np.linspace(0.05, 0.95, 16)))
    radius, angle = np.sqrt(u), 2 * np.pi * v
    local = np.stack([radius * np.cos(angle), radius * np.sin(angle), np.sqrt(1 - u)], axis=1)
    # The reflection that swaps local and -way: its normal is local + way.
    normal = local + ways / np.linalg.norm(ways, axis=1, keepdims=True)
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    normal = np.where(length > 1e-9, normal / np.maximum(length, 1e-9), 0.0)
    square = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0)]) - np.array([0.5, 0.5, 0.0])
    depth = 2.0 ** (4 + np.arange(256) % 3)
    placed = square - 2 * np.einsum("kj,nj->nk", square, normal)[:, :, None] * normal[:, None]
    size = depth / 64  # apart: a pixel is 1/16 wide at distance 1
    points = placed * size[:, None, None] + (ways * depth[:, None])[:, None]
    mesh = points.reshape(-1, 3), np.array([(0, 1, 2), (1, 3, 2)]) + 4 * np.arange(256)[:, None, None]
    lights, stated = [(0.5, 0.25, 0.125), (0, 0, -128)], Counts(256)
    return view(mesh, lights, ORIGIN, (0, 0, -1), 0.5, watertight=True, stated=stated, **place)


@hard(
    "S41 tinybvh#168 {kind} {axis}", "rays along an axis onto a mesh of integers, {kind}",
    "rays lost at edges and at the faces of boxes", axes("xyz"), rows("kind at", ("integers", 1.0), ("halves", 0.5)),
    excusable=0.0,
)  # fmt: skip
def tinybvh_168(at: float, **place: Any) -> Trial:
    """Rays along -y onto a closed mesh on a grid of integers, through its edges and vertices.

    The thread's mesh (a dragon rounded to integers) is in a file that is not available; here it is a ball of 1,280
    triangles of radius 37. Its rays are parallel: here they are the shadow rays of a light at infinity, from the plane
    under the ball, at integers ("integers") or half integers.
    """
    points, faces = icosphere(3)
    mesh = joined((np.round(points * 37.0) + (0.0, 40.0, 0.0), faces), plane(1, -1, 512))
    sun = Light((0.0, 1.0, 0.0), directional=True)
    return view(mesh, [sun], (at, -64.0, at), (0, 1, 0), 32 / 63, (32, 32), up=(0, 0, 1), **place)


@hard(
    "S42 bvh#20 {axis}", "vertical rays onto a height field", "division by 0; every leaf visited", axes("xyz"),
    excusable=0.0,
)  # fmt: skip
def bvh_20(**place: Any) -> Trial:
    """Vertical rays onto a height field over a regular grid, through all its vertices: heights looked up by rays. The
    thread's own numbers are not available; related threads (madmann91/bvh#9, #21 and #60) describe rays with components
    of 0 that find nothing, or visit nearly every leaf of such a mesh.
    """
    field = lattice(np.arange(-16.0, 17.0), 2 + np.random.default_rng(20).integers(0, 9, (33, 33)) / 2)
    mesh, sun, stated = joined(field, plane(2, 0, 64)), Light((0.0, 0.0, 1.0), directional=True), Counts(256, None)
    return view(mesh, [sun], (1.0, 1.0, -16.0), (0, 0, 1), up=(0, 1, 0), stated=stated, **place)


@hard("P50 fcpw#20{end}", "rays through edges of a closed surface", "cracks between triangles", TURNED)
def fcpw_20(**place: Any) -> Trial:
    """Rays along the edges of a closed mesh as a picture shows them: through vertices and the middles of edges.

    The thread is about cracks between triangles of a closed mesh and gives a picture, no numbers. Every second vertex of the
    surface is on the ray of a pixel, rounded to float32, so that every other ray passes the middle of an edge within a
    rounding, or within a few.
    """
    ways = directions((0.1, 0.2, -1.0), 0.6).reshape(16, 16, 3)[::2, ::2]
    depth = 1 + np.random.default_rng(20).integers(0, 64, (8, 8, 1)) / 64
    points = float32_of(ways * depth).reshape(-1, 3)
    mesh = closed_behind((points, lattice(np.arange(8), 0.0)[1]), (-1.0, -2.0, 8.0))
    return view(mesh, [(0.1, 0.1, 0.5), (0.25, 0.125, -16.0)], ORIGIN, (0.1, 0.2, -1.0), 0.6, closed=True, **place)


# A triangle met at a corner and along its edges; it touches tiles of one pixel only at their border.
@hard(
    "P32", "a triangle on the borders of tiles", "tile bounds without padding",
    points=[(1.3177083730697632, 2.625, 0.468505859375), (1.2065972089767456, 1.625, 0.1907280832529068),
            (2.3177082538604736, 3.625, -0.5870497226715088)],
    faces=[(0, 2, 1)], camera=Camera((0.984375, -0.375, 0.968505859375), (0.984375, 0.625, 0.968505859375), (0, 0, 1),
                                     28.072486935852957),
    light=Light((0.8732638955116272, 0.625, 1.0240614414215088)), size=(9, 9),
)  # fmt: skip
# A triangle with an edge in the face of its bounding box, where rays enter the grid; many cells.
@hard(
    "P33", "a triangle in the face of its box", "cell bounds without padding",
    points=[(-0.0263671875, 0.000972747802734375, -0.01416015625), (-0.0263671875, 0.000972747802734375, -0.01806640625),
            (-0.0732421875, -0.013187408447265625, -0.0283203125)],
    faces=[(0, 1, 2)], camera=Camera((-0.0107421875, 0.000484466552734375, -0.0146484375),
                                     (-0.0263671875, 0.000484466552734375, -0.0146484375), (0, 1, 0), 53.13010235415598),
    light=Light((262112.0, -393088.0, -130992.0)), size=(8, 16),
)  # fmt: skip
# A directional light and two triangles with a common vertex: float32 rounds the rays to outside their bounds.
@hard(
    "S32", "directional light along edges", "light-tile bounds without padding",
    points=[(-0.102294921875, -0.096923828125, -0.078125), (-0.121826171875, -0.112548828125, -0.19921875),
            (-0.125732421875, -0.065673828125, -0.1171875), (-0.063232421875, -0.065673828125, -0.1796875),
            (-0.266357421875, -0.128173828125, -0.3515625)],
    faces=[(0, 2, 1), (1, 4, 3)],
    camera=Camera((0.014892578125, -0.003173828125, -0.0078125), (0.014892578125, -0.018798828125, -0.0078125), (0, 0, 1),
                  126.86989764584402),
    light=Light((-0.005855560302734375, -0.009761810302734375, -0.09179306030273438), directional=True), size=(8, 8),
)  # fmt: skip
# A distant light whose rays to three triangles differ by less than float32 can resolve.
@hard(
    "S33", "rays of a far light that float32 cannot tell apart", "bounds without padding",
    points=[(-1.749755859375, -1.249755859375, -7.75), (-1.749755859375, -1.249755859375, -6.25),
            (0.249755859375, -1.249755859375, -7.75), (0.249755859375, -1.249755859375, -6.25),
            (0.249755859375, -2.0, -6.25)],
    faces=[(1, 3, 4), (0, 3, 1), (0, 2, 3)],
    camera=Camera((0.125, 0.0, -0.625244140625), (0.125, 0.0, -1.625244140625), (1, 0, 0), 28.072486935852957),
    light=Light((2096128.0, 3146496.0, -4194560.0)), size=(13, 10),
)  # fmt: skip
def found(points: Any, faces: Any, camera: Camera, light: Light, size: tuple[int, int]) -> Trial:
    geometry = Geometry.static(np.array(points), np.array(faces))
    prepared = prepare(Scene("found", "Found", lambda: geometry, camera, (light,)))
    return Trial(prepared, prepared.moment(0, *size))
