"""A scene with a reference that is wrong in a few pixels, for tests of what its errors are charged to."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from helpers import exact_cases as cases
from shadowbench.harness.judge.context import Judge
from shadowbench.harness.judge.reference import Reference
from shadowbench.harness.judge.score import score_answers
from shadowbench.harness.scene.prepared import prepare

WIDTH, HEIGHT = 60, 45


class Court:
    """A scene, its exact answers, and a reference that is wrong in some pixels."""

    def __init__(self, scene=None):
        self.prepared = prepare(scene or cases.ball_on_floor(lights=2))
        self.moment = self.prepared.moment(0, WIDTH, HEIGHT)
        self.judge = Judge.of(self.prepared, self.moment)
        self.right = cases.exact_answers(self.prepared, self.moment, self.judge.referee)
        self.provenance = self.judge.reference.provenance
        self.wrong = self.answers()
        right, floor = self.right, self.right["triangle"] == 0
        self.lost = pixel_of(floor)
        self.acne = pixel_of((right["triangle"] == 1) & (right["visibility"][0] == 0))
        self.leak = pixel_of((right["triangle"] <= 1) & (right["visibility"][1] == 1))
        lose(self.wrong, self.lost)
        self.wrong["visibility"][0, self.acne] = 1
        self.wrong["visibility"][1, self.leak] = 0

    def answers(self):
        return {name: value.copy() for name, value in self.right.items()}

    @property
    def reference(self) -> Reference:
        arrays = {name: value.copy() for name, value in self.wrong.items()}
        return Reference(**arrays, provenance=self.provenance)

    def score(self, answers, sample: int = 0):
        """A score against the wrong reference, and what it leaves to others."""
        judge = replace(self.judge, moment=self.moment, reference=self.reference, random_pixels=sample)
        scored = score_answers(judge, answers)
        return scored.score, scored.disputes

    def counts(self, score):
        """What must come out the same whoever asked."""
        asked = ("disputed", "judged", "t_max_relative_error", "uv_max_error")
        primary = {name: n for name, n in vars(score.primary).items() if name not in asked}
        shadow = [
            {name: n for name, n in vars(light).items() if name != "disputed"} for light in score.shadow
        ]
        return primary, shadow, score.true_errors, score.excused_share, score.check

    def whole(self, answers):
        """The counts where the referee decides every pixel."""
        return self.counts(self.score(answers, WIDTH * HEIGHT)[0])


def pixel_of(test) -> int:
    found = np.nonzero(test)[0]
    assert len(found) > 10
    return int(found[len(found) // 2])


def lose(answers, pixel):
    answers["triangle"][pixel], answers["t"][pixel] = -1, np.inf
    answers["u"][pixel] = answers["v"][pixel] = 0
    answers["visibility"][:, pixel] = 0
