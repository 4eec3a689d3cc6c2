"""P04-P06, P11, P16, P23-P27, P30, S26-S27: unusual meshes, the empty scene among them."""

import itertools

import numpy as np

from ..arrays import F64
from ..scene.scene import AlphaMask
from .case import BESIDE, ORIGIN, Counts, Trial, hard, rows, view
from .closed import FAR
from .shapes import Mesh, Point, ball, ball_on_floor, box, fan, joined, pixel_centres, plane, quad, soup, triangles


@hard("P04", "one triangle 2e4 wide", "one pair for every tile")
def huge_triangle() -> Trial:
    """One triangle 2e4 wide under the eye; every pixel sees it."""
    mesh = triangles((-1e4, -1e4, -1), (1e4, -1e4, -1), (0, 1e4, -1))
    return view(mesh, [(0.5, 0.25, 3), (0, 0, -0.5)], ORIGIN, (0, 0, -1), stated=Counts(256, (0, 0)))


BROKEN: Mesh = (  # zero-area, NaN and infinite triangles
    np.array([
        (0, 0, -1), (0.5, 0, -1), (1, 0, -1), (np.nan, 0, -1), (np.inf, 0, -1), (0, -np.inf, 0), (3e38, 3e38, -1),
    ]),
    np.array([(0, 0, 0), (0, 1, 2), (0, 1, 3), (0, 1, 4), (5, 3, 0), (1, 1, 2), (3, 3, 3), (2, 0, 2)]),
)  # fmt: skip


@hard("P05", "broken triangles before a square", "division of 0 by 0; NaN as a tile or a bounding box", hit=256)
@hard("P05b", "nothing but broken triangles", "a scene without a bounding box", hit=0)
def broken_triangles(hit: int) -> Trial:
    mesh = joined(BROKEN, plane(2, -2, 4)) if hit else BROKEN
    return view(mesh, [(0, 0, -1), (0.5, 0, 2)], ORIGIN, (0, 0, -1), stated=Counts(hit, (0, 0)))


@hard("P06", "every triangle three times", "ties that depend on the order of a reduction")
def three_of_each() -> Trial:
    """Every triangle three times, in three vertex orders; shadows from and onto duplicates. By convention the lowest
    index is the answer; another one counts as a tie, not as an error. For the built-in methods, a test requires the
    exact index.
    """
    points, faces = ball_on_floor()
    thrice = np.concatenate([faces, faces[:, [1, 2, 0]], faces[:, [1, 0, 2]]])
    return view((points, thrice), [(1, 2.5, 0.5)], *BESIDE, (24, 24))


@hard(
    "P06 {what} {seed}", "duplicates with corners in other orders",
    "rounded distances compared where their difference should be",
    rows("what seed holes", ("orders", 49, False), ("orders", 128, False), ("orders", 219, False), ("holes", 141, True),
         ("holes", 208, True)),
)  # fmt: skip
def in_other_orders(seed: int, holes: bool) -> Trial:
    """Every triangle three times with its corners in any order, whose distances then differ in their last bit; in some pixel
    that bit decides which of two rounded distances is less. ``holes``: half of them have a mask, without a hole.
    """
    random = np.random.default_rng(seed)
    count = 10
    points, faces = triangles((random.normal(size=(count, 3, 3)) * (1.5, 1.5, 0.7) + (0, 0, -3)).astype(np.float32))
    orders = np.array(list(itertools.permutations(range(3))))
    others = [np.take_along_axis(faces, orders[random.integers(0, 6, count)], axis=1) for _ in range(2)]
    random = np.random.default_rng(seed + 1000)
    masked = (random.random(3 * count) < 0.5).astype(np.uint8)
    mask = AlphaMask(masked, random.random((3 * count, 3, 2)).astype(np.float32), np.ones((2, 2), dtype=np.uint8))
    mesh, alpha = (points, np.concatenate([faces, *others])), (lambda geometry: mask) if holes else None
    return view(mesh, [(1, 2, 3)], (0.1, 0.2, 0.5), (0, 0, -1), 0.7, (64, 64), alpha=alpha)


@hard("P11", "one triangle, all miss", "arrays of length 0")
def one_triangle_missed() -> Trial:
    mesh = triangles((9, 0, -1), (9, 1, -1), (9, 0, -2))
    return view(mesh, [(0, 3, 0)], ORIGIN, (0, 0, -1), 0.5, stated=Counts(0, (0,)))


@hard("P11b", "empty scene", "an inverted box, arrays of length 0", vertices=0)
@hard("P11c", "vertices but no triangles", "an inverted box, arrays of length 0", vertices=4)
def empty(vertices: int) -> Trial:
    mesh = np.arange(3.0 * vertices).reshape(-1, 3), np.zeros((0, 3), int)
    return view(mesh, [(0, 3, 0), ORIGIN], ORIGIN, (0, 0, -1), 1.0, (9, 7), stated=Counts(0, (0, 0)))


@hard("P27", "no light", "arrays of lights of length 0")
def no_light() -> Trial:
    return view(box(-1, 1), [], (0, 0, 4), (0, 0, -1), 0.5, (9, 9), stated=Counts(None, ()))


@hard("P16", "teapot in a stadium", "one cell holds the whole cluster; a fixed epsilon")
def teapot_in_stadium() -> Trial:
    """A cluster 1e-3 wide of three hundred triangles on a ground of 2e3."""
    ground = quad((-1e3, -1e3, -2e-3), (1e3, -1e3, -2e-3), (1e3, 1e3, -2e-3), (-1e3, 1e3, -2.5e-3))
    mesh, lights = joined(ground, soup(3, 300, 2e-4, 1e-3)), [(3, 2, 5), (1e-3, 0, 4e-3), (400, -300, 20)]
    return view(mesh, lights, (0, -4e-3, 3e-3), (0, 4, -3), 0.5, (24, 24), up=(0, 0, 1))


def needles(middle: F64, towards: Point, seed: int) -> Mesh:
    """Triangles 2 long and 2e-5 wide about points [n, 3], in all orientations perpendicular to ``towards``."""
    along = np.random.default_rng(seed).normal(size=middle.shape)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    across = np.cross(along, towards)
    across *= 1e-5 / np.linalg.norm(across, axis=1, keepdims=True)
    return triangles(np.stack([middle + along, middle - along + across, middle - along - across], axis=1))


def on_segments(seed: int) -> F64:
    """A hundred points [100, 3] on segments from the origin to pixels' hit points at 5 (x, y, -1)."""
    random = np.random.default_rng(seed)
    x, places = pixel_centres(16), random.permutation(256)[:100]
    depth = random.uniform(1, 4, (100, 1))
    return np.stack([x[places % 16], x[places // 16], -np.ones(100)], axis=1) * depth


@hard("S26", "slivers as occluders", "rounding of edge signs and planes of thin triangles")
def shadow_slivers() -> Trial:
    """Needles that shadow rays cross in their middle: from a light near them, and from one 1e6 away."""
    from_near, from_far = on_segments(13), on_segments(14)
    # Receivers at 5 (x, y, -1); below a far light the ray that ends there stays at 5 (x, y).
    from_far[:, :2] *= 5 / -from_far[:, 2:]
    mesh = joined(plane(2, -5, 16), needles(from_near, from_near, 15), needles(from_far, (0.0, 0.0, 1.0), 16))
    return view(mesh, [ORIGIN, (0, 0, 1e6)], (0, 0, -10), (0, 0, 1))


@hard("P30 {radii:g}", "a ball seen from {radii:g} radii", FAR, rows("radii", 1e3, 1e5, 1e6, 1e7))
def far_ball(radii: float) -> Trial:
    """A closed ball of radius 1 seen from afar and lit from afar: its triangles are a third of a radius wide."""
    eye = np.array([0.48, 0.64, 0.6]) * radii
    lights = [(0.9 * radii, -0.1 * radii, 0.3 * radii), (3, 4, 5)]
    return view(ball(1.0, ORIGIN, 12, 18), lights, eye, -eye, 1.2 / radii, (24, 24))


@hard("S27 {radii:g}", "a ball {radii:g} radii from light and floor", FAR, rows("radii", 1e3, 1e5, 1e6, 1e7))
def far_from_occluder(radii: float) -> Trial:
    """A ball half way between a light and a small floor, both ``radii`` of its radii away."""
    towards, right = np.array([0.48, 0.64, 0.6]), np.array([0.8, -0.6, 0.0])
    up, middle = np.cross(right, towards), -towards * radii
    floor = quad(*(middle + 4 * (i * right + j * up) for i, j in ((-1, -1), (1, -1), (1, 1), (-1, 1))))
    mesh = joined(ball(1.0, ORIGIN, 12, 18), floor)
    return view(mesh, [towards * radii], middle - 8 * towards, towards, 0.4, (24, 24))


@hard("P23", "slivers", "rounding of t and barycentric weights of thin triangles")
def slivers() -> Trial:
    """Triangles of aspect ratio 1e5 in all orientations in front of a wall, each met by the ray of a pixel."""
    middle = on_segments(12)
    mesh = joined(plane(2, -5, 16), needles(middle, middle, 17))
    return view(mesh, [(0.5, 2, 0.5), ORIGIN, (0, 0, -4.9)], ORIGIN, (0, 0, -1))


@hard("P24", "a fan of 96 triangles", "many candidate triangles at one vertex")
def wide_fan() -> Trial:
    around = [(np.cos(a), np.sin(a), -2 + 0.3 * np.sin(5 * a)) for a in 2 * np.pi * np.arange(96) / 96]
    mesh, lights = joined(fan((0, 0, -1.5), around), plane(2, -3, 8)), [ORIGIN, (0, 0, 2)]
    return view(mesh, lights, (0, 0, -7), (0, 0, 1), 0.5, (17, 17), watertight=True, stated=Counts(289))


@hard("P25", "boxes that share faces", "ties of coplanar triangles; lights on corners")
def touching_boxes() -> Trial:
    boxes = [box(low, np.add(low, 1)) for low in itertools.product((-1, 0), repeat=3)]
    return view(joined(*boxes), [(4, 3, 2), ORIGIN, (0.5, 0.5, 0.5)], (0, 0, 3), (0, 0, -1), 0.5)


@hard("P26", "triangles through every cell", "long lists; a hit that lies in another cell")
def through_every_cell() -> Trial:
    """Three triangles across the whole scene among four hundred small ones."""
    a, b, c, d = (-5, -4, -3), (5, 4.1, 2.9), (-4.5, 5, 3.5), (4, -5, 4)
    mesh = joined(triangles((a, b, c), (b, c, d), (a, b, d)), soup(5, 400, 0.05, 3.0))
    return view(mesh, [(0.1, 0.2, 6)], (0.5, 0.4, 9), (-0.5, -0.4, -9), 0.6, (24, 24))
