"""A scene with a reference that is wrong in a few pixels, for tests of what its errors are charged to."""

from dataclasses import replace

from helpers import exact_answers as cases
from helpers.answered_scene import HEIGHT, WIDTH, AnsweredScene, lose
from shadowbench.harness.judge.reference import Reference
from shadowbench.harness.judge.score import score_answers


class WrongReference(AnsweredScene):
    """A scene, its exact answers, and a reference that is wrong in some pixels."""

    def __init__(self, scene=None):
        super().__init__(scene or cases.ball_on_floor(lights=2))
        self.provenance = self.judge.reference.provenance
        self.wrong = self.answers()
        right, floor = self.right, self.right["triangle"] == 0
        self.lost = self.pixel(floor)
        self.acne = self.pixel((right["triangle"] == 1) & (right["shadowed"][0] == 0))
        self.leak = self.pixel((right["triangle"] <= 1) & (right["shadowed"][1] == 1))
        lose(self.wrong, self.lost)
        self.wrong["shadowed"][0, self.acne] = 1
        self.wrong["shadowed"][1, self.leak] = 0

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
        shadow = [{name: n for name, n in vars(light).items() if name != "disputed"} for light in score.shadow]
        return primary, shadow, score.true_errors, score.excused_share, score.check

    def whole(self, answers):
        """The counts where the referee decides every pixel."""
        return self.counts(self.score(answers, WIDTH * HEIGHT)[0])
