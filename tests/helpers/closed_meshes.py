"""Closed meshes that rays meet at edges and vertices, for the tests of culling."""

import numpy as np
from numpy.typing import NDArray
from shadowbench.harness.hardcases.case import Trial, view
from shadowbench.harness.hardcases.shapes import box, plane, sheet


def grid_of_squares(n: int) -> tuple[NDArray, NDArray]:
    """A closed unit cube of n x n squares a side: many rays through shared edges and vertices."""
    side = np.linspace(-1.0, 1.0, n + 1)
    u, v = (x.ravel() for x in np.meshgrid(side, side, indexing="ij"))
    vertices: list[NDArray] = []
    faces: list[NDArray] = []
    for axis in range(3):
        for sign in (-1.0, 1.0):
            corners = np.empty((len(u), 3))
            corners[:, axis] = sign
            corners[:, (axis + 1) % 3], corners[:, (axis + 2) % 3] = u, v * sign
            base = sum(len(c) for c in vertices)
            vertices.append(corners)
            i, j = (x.ravel() for x in np.meshgrid(np.arange(n), np.arange(n), indexing="ij"))
            a, b = i * (n + 1) + j, (i + 1) * (n + 1) + j
            faces += [np.stack(t, axis=1) + base for t in ((a, b, b + 1), (a, b + 1, a + 1))]
    return np.concatenate(vertices), np.concatenate(faces)


def rays_through_vertices(
    towards: tuple[float, float, float], half: float, deepest: int, light: tuple[float, float, float]
) -> Trial:
    """A closed body whose front is the sheet of the hard cases P29: a vertex exactly on the ray of every pixel.

    Its walls run along the rays of the border, and its back is a fan that the inner rays meet far from any edge:
    whatever slips through the front meets the inside of the back, and nothing where that is culled.
    """
    origin = (0.0, 0.0, 0.0)
    rays = view(plane(2, -1, 1), [], origin, towards, half).moment
    directions = rays.directions(np.arange(256)).astype(np.float64)
    powers = 2.0 ** np.random.default_rng(21).integers(0, deepest + 1, (256, 1))
    _, front = sheet(np.arange(16), np.arange(16), 1.0)
    edges = np.concatenate([front[:, [0, 1]], front[:, [1, 2]], front[:, [2, 0]]]).tolist()
    inner = {(q, p) for p, q in edges}
    border = np.array([edge for edge in edges if tuple(edge) not in inner])
    behind = np.full(256, -1)
    behind[border[:, 0]] = 256 + np.arange(len(border))
    (p, q), middle = border.T, np.full(len(border), 256 + len(border))
    faces = [
        front,
        np.stack([q, p, behind[p]], axis=1),
        np.stack([q, behind[p], behind[q]], axis=1),
        np.stack([behind[q], behind[p], middle], axis=1),
    ]
    way = np.asarray(towards) / np.linalg.norm(towards)
    points = np.concatenate([directions * powers, directions[border[:, 0]] * 64, [way * 64]])
    return view((points, np.concatenate(faces)), [light], origin, towards, half, closed=True)


def rays_along_an_edge() -> Trial:
    """A box whose right edge a column of rays meets exactly; the wall behind it, turned away, comes first in the list."""
    points, faces = box((-0.5, -0.5, -2.0), (3 / 16, 0.5, -1.0))
    wall = (points[faces][:, :, 0] == 3 / 16).all(axis=1)
    faces = np.concatenate([faces[wall], faces[~wall]])
    return view((points, faces), [(0.5, 3.0, 3.0)], (0, 0, 0), (0, 0, -1), 1.0, closed=True)
