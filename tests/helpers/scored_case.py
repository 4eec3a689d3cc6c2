"""A scored scene with its exact answers, to plant errors in: a ball on a floor, lit by two lights."""

from __future__ import annotations

import numpy as np
from helpers import exact_cases as cases
from shadowbench.harness.judge.context import Judge
from shadowbench.harness.scene.prepared import prepare
from shadowbench.harness.scene.scene import Scene

WIDTH, HEIGHT = 60, 45


class Case:
    def __init__(self, scene: Scene):
        self.prepared = prepare(scene)
        self.moment = self.prepared.moment(0, WIDTH, HEIGHT)
        self.judge = Judge.of(self.prepared, self.moment)
        self.right = cases.exact_answers(self.prepared, self.moment, self.judge.referee)

    def answers(self) -> dict[str, np.ndarray]:
        return {name: value.copy() for name, value in self.right.items()}

    def pixel(self, test) -> int:
        """The middle one of the pixels for which ``test`` holds."""
        found = np.nonzero(test)[0]
        assert len(found) > 10
        return int(found[len(found) // 2])


def ball_case() -> Case:
    return Case(cases.ball_on_floor(lights=2))


def floor_pixel(case: Case) -> int:
    return case.pixel(case.right["triangle"] == 0)


def sky_pixel(case: Case) -> int:
    return case.pixel(case.right["triangle"] == -1)


def plant_hole(case: Case, answers: dict[str, np.ndarray]) -> int:
    """A pixel of the floor that misses; which one."""
    pixel = floor_pixel(case)
    answers["triangle"][pixel], answers["t"][pixel] = -1, np.inf
    answers["u"][pixel] = answers["v"][pixel] = 0
    answers["visibility"][:, pixel] = 0
    return pixel
