"""A scene with its judge and its exact answers, to plant errors in: a ball on a floor, lit by two lights."""

from dataclasses import replace

import numpy as np
from helpers import exact_answers as cases
from shadowbench.harness.judge.context import Judge
from shadowbench.harness.scene.moment import Moment
from shadowbench.harness.scene.prepared import Prepared, prepare
from shadowbench.harness.scene.scene import Camera, Light, Scene

WIDTH, HEIGHT = 60, 45


class AnsweredScene:
    """A scene, its judge, and what every method must answer."""

    def __init__(self, scene: Scene):
        self.prepared = prepare(scene)
        self.moment = self.prepared.moment(0, WIDTH, HEIGHT)
        self.judge = Judge.of(self.prepared, self.moment)
        self.right = cases.exact_answers(self.prepared, self.moment)

    def answers(self) -> dict[str, np.ndarray]:
        return {name: value.copy() for name, value in self.right.items()}

    def pixel(self, test) -> int:
        """The middle one of the pixels for which ``test`` holds."""
        found = np.nonzero(test)[0]
        assert len(found) > 10
        return int(found[len(found) // 2])


def answered_ball() -> AnsweredScene:
    return AnsweredScene(cases.ball_on_floor(lights=2))


def floor_pixel(case: AnsweredScene) -> int:
    return case.pixel(case.right["triangle"] == 0)


def sky_pixel(case: AnsweredScene) -> int:
    return case.pixel(case.right["triangle"] == -1)


def plant_hole(case: AnsweredScene, answers: dict[str, np.ndarray]) -> int:
    """A pixel of the floor that misses; which one."""
    pixel = floor_pixel(case)
    lose(answers, pixel)
    return pixel


def lose(answers: dict[str, np.ndarray], pixel: int | np.ndarray) -> None:
    """A pixel misses, or several."""
    answers["triangle"][pixel], answers["t"][pixel] = -1, np.inf
    answers["u"][pixel] = answers["v"][pixel] = 0
    answers["shadowed"][:, pixel] = 0


def lattice_of_rays(faces) -> tuple[Prepared, Moment]:
    """A square of such triangles, seen by 33 x 33 rays on a lattice: some run exactly along its diagonal."""
    corners = np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0.0)])
    prepared = prepare(cases.static_scene(corners, faces, Camera((0, 0, 2), (0, 0, 0)), Light((0, 0, 3))))
    steps = (np.arange(33, dtype=np.float32) - 16) / 8
    zero = np.zeros(33, dtype=np.float32)
    column, row = np.stack([steps, zero, zero - 1], axis=1), np.stack([zero, -steps, zero], axis=1)
    return prepared, replace(prepared.moment(0, 33, 33), column=column, row=row)
