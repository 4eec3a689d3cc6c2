"""P04-P06, P08, P11-P16, the empty scene and more: unusual meshes."""

import itertools

import numpy as np

from ..arrays import F64
from ..scene.scene import AlphaMask
from .case import ORIGIN, Counts, Trial, axes, hard, rows, view
from .shapes import Mesh, ball, box, float32_of, joined, pixel_centres, plane, quad, sheet, soup, split, triangles

FAR = "cancellation in float64 edge functions, for rays through vertices"
LEAVES = "0 times infinity: the ray leaves the box before it enters"
NO_THICKNESS = "bounding boxes without thickness: rays in their faces"


@hard("P04", "one triangle 2e4 wide", "one pair for every tile")
def huge_triangle() -> Trial:
    """One triangle 2e4 wide under the eye; every pixel sees it."""
    return view(
        triangles((-1e4, -1e4, -1), (1e4, -1e4, -1), (0, 1e4, -1)), [(0.5, 0.25, 3), (0, 0, -0.5)], ORIGIN,
        (0, 0, -1), 1.0, stated=Counts(256, (0, 0)),
    )  # fmt: skip


@hard("P05", "broken triangles before a square", "division of 0 by 0; NaN as a tile or a bounding box", only=False)
@hard("P05b", "nothing but broken triangles", "a scene without a bounding box", only=True)
def broken_triangles(only: bool) -> Trial:
    """Zero-area, NaN and infinite triangles in front of a square; ``only``: without the square."""
    odd = [
        (0, 0, -1), (0.5, 0, -1), (1, 0, -1), (np.nan, 0, -1), (np.inf, 0, -1), (0, -np.inf, 0), (3e38, 3e38, -1),
    ]  # fmt: skip
    faces = [(0, 0, 0), (0, 1, 2), (0, 1, 3), (0, 1, 4), (5, 3, 0), (1, 1, 2), (3, 3, 3), (2, 0, 2)]
    mesh: Mesh = (np.array(odd), np.array(faces))
    if not only:
        mesh = joined(mesh, plane(2, -2, 4))
    return view(mesh, [(0, 0, -1), (0.5, 0, 2)], ORIGIN, (0, 0, -1), 1.0, stated=Counts(0 if only else 256, (0, 0)))


@hard("P06", "every triangle three times", "ties that depend on the order of a reduction")
def three_of_each() -> Trial:
    """Every triangle three times, in three vertex orders; shadows from and onto duplicates.

    By convention the lowest index is the answer; another one counts as a tie, not as an error. For the built-in methods,
    a test requires the exact index.
    """
    points, faces = ball(0.5, (0, 0.6, 0))
    floor, floor_faces = quad((-3, 0, -3), (3, 0, -3), (3, 0, 3), (-3, 0, 3))
    points, faces = joined((floor, floor_faces), (points, faces))
    thrice = np.concatenate([faces, faces[:, [1, 2, 0]], faces[:, [1, 0, 2]]])
    return view((points, thrice), [(1, 2.5, 0.5)], (0.3, 1.7, 3.1), (-0.1, -0.45, -1), 0.5, (24, 24))


@hard(
    "P06 {what} {seed}", "duplicates with corners in other orders",
    "rounded distances compared where their difference should be",
    rows("what seed holes", ("orders", 49, False), ("orders", 128, False), ("orders", 219, False), ("holes", 141, True),
         ("holes", 208, True)),
)  # fmt: skip
def in_other_orders(seed: int, holes: bool) -> Trial:
    """Every triangle three times with its corners in any order, whose distances then differ in their last bit; in some pixel
    that bit decides which of two rounded distances is less. ``holes``: half of them have a mask, without a hole."""
    random = np.random.default_rng(seed)
    count = 10
    corners = float32_of(random.normal(size=(count, 3, 3)) * (1.5, 1.5, 0.7) + (0, 0, -3))
    orders = np.array(list(itertools.permutations(range(3))))
    faces = np.arange(3 * count).reshape(-1, 3)
    others = [np.take_along_axis(faces, orders[random.integers(0, 6, count)], axis=1) for _ in range(2)]
    random = np.random.default_rng(seed + 1000)
    mask = AlphaMask(
        (random.random(3 * count) < 0.5).astype(np.uint8), random.random((3 * count, 3, 2)).astype(np.float32),
        np.ones((2, 2), dtype=np.uint8),
    )  # fmt: skip
    return view(
        (corners.reshape(-1, 3), np.concatenate([faces, *others])), [(1, 2, 3)], (0.1, 0.2, 0.5), (0, 0, -1), 0.7, (64, 64),
        alpha=(lambda geometry: mask) if holes else None,
    )  # fmt: skip


@hard("P08", "flat sheet, rays to its border", NO_THICKNESS, every=1, unwelded=False)
@hard("P08b", "flat sheet, rays through edges", NO_THICKNESS, every=2, unwelded=False)
@hard("P08c", "flat sheet with split vertices", "no rule for rays through edges", every=2, unwelded=True)
def flat_sheet(every: int, unwelded: bool) -> Trial:
    """A flat sheet; rays through all its vertices and its border (1), or vertices, edges and diagonals (2)."""
    x = pixel_centres(16)[::every]
    mesh = sheet(x, x, 1.0)
    covered = (16 if every == 1 else 15) ** 2
    return view(
        split(mesh) if unwelded else mesh, [(0, 0, 0.5), (0.25, 0.125, -3)], ORIGIN, (0, 0, -1), 1.0,
        watertight=True, stated=Counts(covered, (0, 0)),
    )  # fmt: skip


@hard("P08d{axis}", "rays in the upper face of the scene's box", LEAVES, axes(), upper=True)
@hard("P08e{axis}", "rays in the lower face of the scene's box", LEAVES, axes(), upper=False)
def beside_the_eye(turn: int, upper: bool) -> Trial:
    """A flat sheet that ends at the x of the eye: the middle column of rays lies in the upper (or lower) face of its
    bounding box.

    Rays and border have x = 0, so the decision is not rounded. The border belongs to the closed triangles.
    """
    y = np.arange(-8, 9) / 4.0
    x = np.arange(-8, 1) / 4.0
    light = (-1.0, 0.0, 3.0) if upper else (1.0, 0.0, 3.0)
    return view(
        sheet(x if upper else -x[::-1], y, 2.0), [light], ORIGIN, (0, 0, -1), 1.0, (17, 17), turn=turn,
        watertight=True, stated=Counts(9 * 17, (0,)),
    )  # fmt: skip


@hard("P28", "flat sheet, odd directions to its border", NO_THICKNESS, towards=(0, 0, -1), half=0.7)
def on_odd_rays(towards: tuple[float, float, float], half: float) -> Trial:
    """A flat sheet with a vertex exactly on the float32 ray of every pixel: its border is the border of the scene."""
    rays = view(plane(2, -1, 1), [], ORIGIN, towards, half).moment
    directions = rays.directions(np.arange(256)).astype(np.float64)
    _, faces = sheet(np.arange(16), np.arange(16), 1.0)
    light = (np.asarray(towards) * -4.0).tolist()
    return view((directions, faces), [ORIGIN, tuple(light)], ORIGIN, towards, half, stated=Counts(256))


@hard("P28b", "flat squares apart, met at their corners", NO_THICKNESS, shadow=False)
@hard("S25", "shadow rays at the corners of flat squares", NO_THICKNESS, shadow=True)
def patches(shadow: bool) -> Trial:
    """Sixty-four flat squares apart from each other, each with its corners on four rays of an odd direction.

    Every ray meets the corner of one box without thickness. ``shadow``: the rays are the shadow rays instead.
    """
    rays = view(plane(2, -1, 1), [], ORIGIN, (0, 0, -1), 0.7).moment
    directions = rays.directions(np.arange(256)).astype(np.float64)
    index = np.arange(256).reshape(16, 16)
    a, b, c, d = index[::2, ::2], index[::2, 1::2], index[1::2, 1::2], index[1::2, ::2]
    mesh = directions, np.concatenate([np.stack(f, axis=-1).reshape(-1, 3) for f in ((a, b, c), (a, c, d))])
    if not shadow:
        return view(mesh, [(0, 0, 1)], ORIGIN, (0, 0, -1), 0.7, stated=Counts(256, (0,)))
    # Seen from behind, the rays meet the plane z = -4 at exactly four times the corners: column x and row y agree.
    return view(joined(mesh, plane(2, -4, 8)), [ORIGIN], (0, 0, -8), (0, 0, 1), 0.7, stated=Counts(256, (256,)))


@hard("P11", "one triangle, all miss", "arrays of length 0")
def one_triangle_missed() -> Trial:
    return view(
        triangles((9, 0, -1), (9, 1, -1), (9, 0, -2)), [(0, 3, 0)], ORIGIN, (0, 0, -1), 0.5, stated=Counts(0, (0,))
    )


@hard("P11b", "empty scene", "an inverted box, arrays of length 0", vertices=0)
@hard("P11c", "vertices but no triangles", "an inverted box, arrays of length 0", vertices=4)
def empty(vertices: int) -> Trial:
    points = np.arange(3.0 * vertices).reshape(-1, 3)
    return view(
        (points, np.zeros((0, 3), int)), [(0, 3, 0), ORIGIN], ORIGIN, (0, 0, -1), 1.0, (9, 7), stated=Counts(0, (0, 0))
    )


@hard("P27", "no light", "arrays of lights of length 0")
def no_light() -> Trial:
    return view(box(-1, 1), [], (0, 0, 4), (0, 0, -1), 0.5, (9, 9), stated=Counts(None, ()))


@hard("P16", "teapot in a stadium", "one cell holds the whole cluster; a fixed epsilon")
def teapot_in_stadium() -> Trial:
    """A cluster 1e-3 wide of three hundred triangles on a ground of 2e3."""
    ground = quad((-1e3, -1e3, -2e-3), (1e3, -1e3, -2e-3), (1e3, 1e3, -2e-3), (-1e3, 1e3, -2.5e-3))
    lights = [(3, 2, 5), (1e-3, 0, 4e-3), (400, -300, 20)]
    return view(
        joined(ground, soup(3, 300, 2e-4, 1e-3)), lights, (0, -4e-3, 3e-3), (0, 4, -3), 0.5, (24, 24), up=(0, 0, 1)
    )


def needles(middle: F64, towards: F64, seed: int) -> Mesh:
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
    above = np.broadcast_to([0.0, 0.0, 1.0], from_far.shape)
    return view(
        joined(plane(2, -5, 16), needles(from_near, from_near, 15), needles(from_far, above, 16)),
        [ORIGIN, (0, 0, 1e6)], (0, 0, -10), (0, 0, 1), 1.0,
    )  # fmt: skip


@hard("P30 {radii:g}", "a ball seen from {radii:g} radii", FAR, rows("radii", 1e3, 1e5, 1e6, 1e7))
def far_ball(radii: float) -> Trial:
    """A closed ball of radius 1 seen from afar and lit from afar: its triangles are a third of a radius wide."""
    eye = np.array([0.48, 0.64, 0.6]) * radii
    lights = [(0.9 * radii, -0.1 * radii, 0.3 * radii), (3, 4, 5)]
    return view(ball(1.0, (0, 0, 0), 12, 18), lights, eye.tolist(), (-eye).tolist(), 1.2 / radii, (24, 24))


@hard("S27 {radii:g}", "a ball {radii:g} radii from light and floor", FAR, rows("radii", 1e3, 1e5, 1e6, 1e7))
def far_from_occluder(radii: float) -> Trial:
    """A ball half way between a light and a small floor, both ``radii`` of its radii away."""
    towards = np.array([0.48, 0.64, 0.6])
    right = np.array([0.8, -0.6, 0.0])
    up = np.cross(right, towards)
    middle = -towards * radii
    floor = [middle + 4 * (i * right + j * up) for i, j in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    return view(
        joined(ball(1.0, (0, 0, 0), 12, 18), quad(*floor)), [(towards * radii).tolist()],
        (middle - 8 * towards).tolist(), towards, 0.4, (24, 24),
    )  # fmt: skip


@hard("P23", "slivers", "rounding of t and barycentric weights of thin triangles")
def slivers() -> Trial:
    """Triangles of aspect ratio 1e5 in all orientations in front of a wall, each met by the ray of a pixel."""
    middle = on_segments(12)
    return view(
        joined(plane(2, -5, 16), needles(middle, middle, 17)), [(0.5, 2, 0.5), ORIGIN, (0, 0, -4.9)], ORIGIN,
        (0, 0, -1), 1.0,
    )  # fmt: skip


@hard("P24", "a fan of 96 triangles", "many candidate triangles at one vertex", count=96)
def fan(count: int) -> Trial:
    around = [(np.cos(a), np.sin(a), -2 + 0.3 * np.sin(5 * a)) for a in 2 * np.pi * np.arange(count) / count]
    corners = [c for i in range(count) for c in ((0, 0, -1.5), around[i], around[(i + 1) % count])]
    return view(
        joined(triangles(*corners), plane(2, -3, 8)), [ORIGIN, (0, 0, 2)], (0, 0, -7), (0, 0, 1), 0.5, (17, 17),
        watertight=True, stated=Counts(289),
    )  # fmt: skip


@hard("P25", "boxes that share faces", "ties of coplanar triangles; lights on corners")
def touching_boxes() -> Trial:
    boxes = [box((i, j, k), (i + 1, j + 1, k + 1)) for i in (-1, 0) for j in (-1, 0) for k in (-1, 0)]
    return view(joined(*boxes), [(4, 3, 2), (0, 0, 0), (0.5, 0.5, 0.5)], (0, 0, 3), (0, 0, -1), 0.5, (16, 16))


@hard("P26", "triangles through every cell", "long lists; a hit that lies in another cell")
def through_every_cell() -> Trial:
    """Four triangles across the whole scene among four hundred small ones."""
    slanted = triangles(
        ((-5, -4, -3), (5, 4.1, 2.9), (-4.5, 5, 3.5)), ((5, 4.1, 2.9), (-4.5, 5, 3.5), (4, -5, 4)),
        ((-5, -4, -3), (5, 4.1, 2.9), (4, -5, 4)),
    )  # fmt: skip
    return view(
        joined(slanted, soup(5, 400, 0.05, 3.0)), [(0.1, 0.2, 6)], (0.5, 0.4, 9), (-0.5, -0.4, -9), 0.6, (24, 24)
    )
