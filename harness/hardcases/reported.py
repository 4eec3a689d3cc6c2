"""P48-P50, S41-S42: errors that users of other ray tracers reported. Each name has the project and the number of the
thread.

Where a thread gives its numbers only in part or in a file that is not available, the case has the configuration that it
describes and says so.
"""

import numpy as np

from ..arrays import F64
from ..scene.scene import Light
from .case import ORIGIN, TURNED, Counts, Trial, axes, hard, rows, view
from .shapes import closed_behind, icosphere, joined, plane, sheet, triangles

START = np.array([0x3E6A2C13, 0x3FAD24CE, 0x3E6A2C13], dtype=np.uint32).view(np.float32).astype(np.float64)
"""Origin of the rays of embree#423: x and y are the bits given in the thread, z is not known."""


def rays_of(towards: tuple[float, float, float], half: float, eye: F64 | None = None) -> F64:
    """The float32 directions of 16 x 16 pixels, float64 [256, 3]."""
    at = ORIGIN if eye is None else tuple(eye.tolist())
    return view(plane(2, -1, 1), [], at, towards, half).moment.directions(np.arange(256)).astype(np.float64)


@hard(
    "P48 embree#423{end}", "triangles far beside rays in their planes",
    "edge functions of one sign by rounding: a false hit", TURNED,
)  # fmt: skip
def embree_423(turn: int = 0, scale: float = 1.0) -> Trial:
    """False hits of triangles far from a ray: each of 256 rays lies in the plane of a triangle, up to the rounding of
    float32.

    In the thread the edge of a mesh is such a ray, and the triangle lies far from it; without fused arithmetic all three
    edge functions have one sign by rounding alone. Only the first two coordinates of the thread are available
    (:data:`START`); the triangles follow its description.
    """
    towards = (0.2, -0.1, -1.0)
    random = np.random.default_rng(423)
    ways = rays_of(towards, 0.4, START)
    aside = random.normal(size=(256, 1, 3))
    far = random.uniform(1, 4, (256, 3, 1)) * np.sign(random.normal(size=(256, 1, 1)))
    along = random.uniform(1, 5, (256, 3, 1))
    corners = START + along * ways[:, None] + far * aside
    return view(
        joined(triangles(corners), plane(2, -8, 32)), [(0.5, 3, 4), tuple(START.tolist())], START.tolist(), towards, 0.4,
        turn=turn, scale=scale,
    )  # fmt: skip


@hard("P49 mitsuba3#1149{end}", "rays through the edge of a square", "rays lost between two triangles", TURNED)
def mitsuba_1149(turn: int = 0, scale: float = 1.0) -> Trial:
    """Rays through the middle of the edge that two triangles of a square share, from directions over a hemisphere.

    The thread's test has a unit square turned by 90 degrees about (1, 1, 1), and rays towards its middle from a hemisphere
    with density proportional to the cosine. The rays of a picture start in one point, so here each of 256 rays has a
    square of its own, turned so that ray and square have the same relative position as in the thread; the squares do not
    touch.
    """
    ways = rays_of((0, 0, -1), 0.5)
    u, v = (axis.ravel() for axis in np.meshgrid(np.linspace(0.05, 0.95, 16), np.linspace(0.05, 0.95, 16)))
    radius, angle = np.sqrt(u), 2 * np.pi * v
    local = np.stack([radius * np.cos(angle), radius * np.sin(angle), np.sqrt(1 - u)], axis=1)
    unit = ways / np.linalg.norm(ways, axis=1, keepdims=True)
    # The reflection that swaps local and -way: its normal is local + way.
    normal = local + unit
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    normal = np.where(length > 1e-9, normal / np.maximum(length, 1e-9), 0.0)
    square = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0)]) - np.array([0.5, 0.5, 0.0])
    depth = 2.0 ** (4 + np.arange(256) % 3)
    placed = square - 2 * np.einsum("kj,nj->nk", square, normal)[:, :, None] * normal[:, None]
    size = depth / 64  # apart: a pixel is 1/16 wide at distance 1
    points = placed * size[:, None, None] + (ways * depth[:, None])[:, None]
    faces = np.array([(0, 1, 2), (1, 3, 2)]) + 4 * np.arange(256)[:, None, None]
    return view(
        (points.reshape(-1, 3), faces), [(0.5, 0.25, 0.125), (0, 0, -128)], ORIGIN, (0, 0, -1), 0.5,
        turn=turn, scale=scale, watertight=True, stated=Counts(256),
    )  # fmt: skip


@hard(
    "S41 tinybvh#168 {kind} {axis}", "rays along an axis onto a mesh of integers, {kind}",
    "rays lost at edges and at the faces of boxes", axes("xyz"), rows("kind", "integers", "halves"), excusable=0.0,
)  # fmt: skip
def tinybvh_168(kind: str, turn: int = 0) -> Trial:
    """Rays along -y onto a closed mesh on a grid of integers, through its edges and vertices.

    The thread's mesh (a dragon rounded to integers) is in a file that is not available; here it is a ball of 1,280
    triangles of radius 37. Its rays are parallel: here they are the shadow rays of a light at infinity, from the plane
    under the ball, at integers ("integers") or half integers.
    """
    points, faces = icosphere(3)
    ball = np.round(points * 37.0) + (0.0, 40.0, 0.0), faces
    eye = (1.0, -64.0, 1.0) if kind == "integers" else (0.5, -64.0, 0.5)
    return view(
        joined(ball, plane(1, -1, 512)), [Light((0.0, 1.0, 0.0), directional=True)], eye, (0, 1, 0), 32 / 63, (32, 32),
        up=(0, 0, 1), turn=turn, watertight=False,
    )  # fmt: skip


@hard(
    "S42 bvh#20 {axis}", "vertical rays onto a height field", "division by 0; every leaf visited", axes("xyz"),
    excusable=0.0,
)  # fmt: skip
def bvh_20(turn: int = 0) -> Trial:
    """Vertical rays onto a height field over a regular grid, through all its vertices: heights looked up by rays.

    The thread's own numbers are not available; related threads (madmann91/bvh#9, #21 and #60) describe rays with
    components of 0 that find nothing, or visit nearly every leaf of such a mesh.
    """
    grid = np.arange(-16.0, 17.0)
    points, faces = sheet(grid, grid, 1.0)
    points = points.copy()
    points[:, 2] = (2 + np.random.default_rng(20).integers(0, 9, (33, 33)) / 2).ravel()
    return view(
        joined((points, faces), plane(2, 0, 64)), [Light((0.0, 0.0, 1.0), directional=True)], (1.0, 1.0, -16.0), (0, 0, 1),
        1.0, up=(0, 1, 0), turn=turn, stated=Counts(256, None),
    )  # fmt: skip


@hard("P50 fcpw#20{end}", "rays through edges of a closed surface", "cracks between triangles", TURNED)
def fcpw_20(turn: int = 0, scale: float = 1.0) -> Trial:
    """Rays along the edges of a closed mesh as a picture shows them: through vertices and the middles of edges.

    The thread is about cracks between triangles of a closed mesh and gives a picture, no numbers. Every second vertex of the
    surface is on the ray of a pixel, rounded to float32, so that every other ray passes the middle of an edge within a
    rounding, or within a few.
    """
    ways = rays_of((0.1, 0.2, -1.0), 0.6).reshape(16, 16, 3)[::2, ::2]
    depth = 1 + np.random.default_rng(20).integers(0, 64, (8, 8, 1)) / 64
    _, faces = sheet(np.arange(8), np.arange(8), 1.0)
    points = (ways * depth).astype(np.float32).astype(np.float64)
    mesh = closed_behind((points.reshape(-1, 3), faces), (-1.0, -2.0, 8.0))
    return view(
        mesh, [(0.1, 0.1, 0.5), (0.25, 0.125, -16.0)], ORIGIN, (0.1, 0.2, -1.0), 0.6, turn=turn, scale=scale,
        closed=True,
    )  # fmt: skip
