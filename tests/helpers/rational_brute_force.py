"""Rational intersections and small scenes, for the tests of the referee and of scoring."""

from fractions import Fraction

import numpy as np
from shadowbench.harness.judge.referee import Referee
from shadowbench.harness.scene.moment import Moment
from shadowbench.harness.scene.prepared import Prepared
from shadowbench.harness.scene.scene import Camera, Geometry, Light, Scene

Vector = list[Fraction]


def rational(values) -> Vector:
    return [Fraction(float(x)) for x in values]


def determinant(a: Vector, b: Vector, c: Vector) -> Fraction:
    return a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0]) + a[2] * (b[0] * c[1] - b[1] * c[0])


def solve(o: Vector, d: Vector, triangle: list[Vector]) -> tuple[Fraction, Fraction, Fraction] | None:
    """t, u, v of o + t d = a + u (b - a) + v (c - a) by Cramer's rule, or None for a coplanar ray."""
    a, b, c = triangle
    e, f = [q - p for p, q in zip(a, b, strict=True)], [q - p for p, q in zip(a, c, strict=True)]
    back, s = [-x for x in d], [x - y for x, y in zip(o, a, strict=True)]
    whole = determinant(back, e, f)
    if whole == 0:
        return None
    return determinant(s, e, f) / whole, determinant(back, s, f) / whole, determinant(back, e, s) / whole


def inside(solution: tuple[Fraction, Fraction, Fraction] | None) -> bool:
    return solution is not None and solution[1] >= 0 and solution[2] >= 0 and solution[1] + solution[2] <= 1


def make_scene(vertices, faces, camera: Camera, *lights: Light) -> Scene:
    vertices, faces = np.asarray(vertices, dtype=np.float64), np.asarray(faces)
    return Scene("case", "Case", lambda: Geometry.static(vertices, faces), camera, tuple(lights))


def ball(radius: float, centre, rings: int = 6, sectors: int = 9) -> tuple[np.ndarray, np.ndarray]:
    """A closed ball of triangles."""
    vertices = [(0.0, radius, 0.0)]
    for i in range(1, rings):
        a = np.pi * i / rings
        for j in range(sectors):
            b = 2 * np.pi * j / sectors
            vertices.append((radius * np.sin(a) * np.cos(b), radius * np.cos(a), radius * np.sin(a) * np.sin(b)))
    vertices.append((0.0, -radius, 0.0))
    faces = [(0, 1 + (j + 1) % sectors, 1 + j) for j in range(sectors)]
    for i in range(rings - 2):
        for j in range(sectors):
            p, q = 1 + i * sectors + j, 1 + i * sectors + (j + 1) % sectors
            faces += [(p, q, p + sectors), (q, q + sectors, p + sectors)]
    last = len(vertices) - 1
    faces += [(last, last - sectors + j, last - sectors + (j + 1) % sectors) for j in range(sectors)]
    return np.array(vertices) + np.asarray(centre, dtype=float), np.array(faces)


def ball_on_floor(lights: int = 1) -> Scene:
    """A ball over a square floor (faces 0 and 1), lights above, the camera to one side, sky behind."""
    vertices, faces = ball(0.5, (0.0, 0.6, 0.0))
    floor = np.array([(-2.0, 0, -2), (2, 0, -2), (2, 0, 2), (-2, 0, 2)])
    all_faces = np.concatenate([[(0, 1, 2), (0, 2, 3)], faces + 4])
    place = [Light((1.0 - 2.0 * i, 2.5, 0.5)) for i in range(lights)]
    return make_scene(np.concatenate([floor, vertices]), all_faces, Camera((0.3, 1.7, 3.1), (0.0, 0.3, 0.0)), *place)


def exact_answers(prepared: Prepared, moment: Moment, referee: Referee) -> dict[str, np.ndarray]:
    """The right answers of every pixel, in the form of a method's."""
    pixels = np.arange(moment.width * moment.height)
    hits = referee.closest(moment.eye, moment.directions(pixels))
    answers = {
        "triangle": hits.triangle.copy(),
        "t": hits.t.astype(np.float32),
        "u": np.zeros(len(pixels), dtype=np.float32),
        "v": np.zeros(len(pixels), dtype=np.float32),
        "shadowed": np.stack([referee.occluded(hits, light) for light in moment.lights]),
    }
    for i in np.nonzero(hits.triangle >= 0)[0]:
        corners = [rational(moment.points[v]) for v in prepared.faces[hits.triangle[i]]]
        solution = solve(rational(moment.eye), rational(hits.directions[i]), corners)
        assert solution is not None
        answers["u"][i], answers["v"][i] = float(solution[1]), float(solution[2])
    return answers
