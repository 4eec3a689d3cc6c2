"""P17: images with unusual sides: prime numbers, small, narrow and large."""

import numpy as np

from .case import Trial, hard, rows, view
from .shapes import ball, joined, quad, triangles

PARTIAL = "partial tiles, thread guards"


@hard(
    "P17 {width}x{height}", "image of {width}x{height}", PARTIAL,
    rows("width height", (1, 1), (33, 25), (3, 257), (257, 3), (8, 9)),
)  # fmt: skip
def odd_image(width: int, height: int) -> Trial:
    """A ball on a floor in an image whose sides are not multiples of a tile or block size."""
    floor = quad((-3, 0, -3), (3, 0, -3), (3, 0, 3), (-3, 0, 3))
    return view(
        joined(floor, ball(0.5, (0, 0.6, 0))), [(1, 2.5, 0.5)], (0.3, 1.7, 3.1), (-0.1, -0.45, -1),
        0.5 * min(1.0, height / width * 4), (width, height),
    )  # fmt: skip


@hard("P17 {width}x{height}", "image of {width}x{height}", PARTIAL, rows("width height", (1023, 769), (7, 5000)))
def large_image(width: int, height: int) -> Trial:
    """Small triangles at the corners, along the sides and in the middle of a large image, without a background.

    Most pixels miss, which makes judging fast; pixels in partial tiles and the last pixel hit a triangle.
    """
    half, reach = 1.0, width / height
    places = [(x, y) for x in (-1, -0.5, 0, 0.5, 1) for y in (-1, -0.5, 0, 0.5, 1) if x or y]
    size = 12.0 / max(width, height) * max(1.0, reach)
    corners = [
        (x * reach * half + size * a, y * half + size * b, -1.0)
        for x, y in places for a, b in ((-1.1, -1.0), (1.2, -0.9), (0.1, 1.3))
    ]  # fmt: skip
    mesh = joined(triangles(*corners), triangles(*(np.array(corners) * 0.5)))
    return view(mesh, [(0, 0, 0), (0, 0, -0.75)], (0, 0, 0), (0, 0, -1), half, (width, height))
