"""Closed meshes that rays meet at edges and vertices, for the tests of culling."""

import numpy as np
from shadowbench.harness.hardcases.case import Trial, view
from shadowbench.harness.hardcases.shapes import box, plane, sheet


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
