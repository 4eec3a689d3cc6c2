"""A ball on a floor and the exact answers to it, for the tests of the referee and of scoring."""

import numpy as np
from helpers.second_judge import SecondJudge, exactly
from shadowbench.harness.hardcases.shapes import ball, joined, quad
from shadowbench.harness.judge.referee import Referee
from shadowbench.harness.scene.moment import Moment
from shadowbench.harness.scene.prepared import Prepared
from shadowbench.harness.scene.scene import Camera, Geometry, Light, Scene


def make_scene(vertices, faces, camera: Camera, *lights: Light) -> Scene:
    vertices, faces = np.asarray(vertices, dtype=np.float64), np.asarray(faces)
    return Scene("case", "Case", lambda: Geometry.static(vertices, faces), camera, tuple(lights))


def ball_on_floor(lights: int = 1) -> Scene:
    """A ball over a square floor (faces 0 and 1), lights above, the camera to one side, sky behind."""
    mesh = joined(quad((-2, 0, -2), (2, 0, -2), (2, 0, 2), (-2, 0, 2)), ball(0.5, (0.0, 0.6, 0.0)))
    place = [Light((1.0 - 2.0 * i, 2.5, 0.5)) for i in range(lights)]
    return make_scene(*mesh, Camera((0.3, 1.7, 3.1), (0.0, 0.3, 0.0)), *place)


def exact_answers(prepared: Prepared, moment: Moment, referee: Referee) -> dict[str, np.ndarray]:
    """The right answers of every pixel, in the form of a method's."""
    pixels = np.arange(moment.width * moment.height)
    hits = referee.closest(moment.eye, moment.directions(pixels))
    weights, second = np.zeros((len(pixels), 3), dtype=np.float32), SecondJudge(moment.points, prepared.faces)
    for i in np.nonzero(hits.triangle >= 0)[0]:
        _, _, weights[i] = second.hit(exactly(moment.eye), exactly(hits.directions[i]), int(hits.triangle[i]))
    return {
        "triangle": hits.triangle.copy(),
        "t": hits.t.astype(np.float32),
        "u": weights[:, 1].copy(),
        "v": weights[:, 2].copy(),
        "shadowed": np.stack([referee.occluded(hits, light) for light in moment.lights]),
    }
