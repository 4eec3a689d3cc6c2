"""The data for judging answers to one set of rays: the scene, the rays, the reference and the exact referee."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from ..arrays import Bools
from ..scene.effects import Effects
from ..scene.moment import Moment
from ..scene.prepared import Prepared
from .consistency import Checked, check_consistency
from .receivers import not_receivers
from .referee import Referee
from .reference import Reference, reference_for, shadow_flags

JUDGE_LIMIT = 100_000  # most disputed pixels that are judged; of more, a seeded sample, and the others count as errors
RANDOM_PIXELS = 200  # number of random pixels that are judged in addition to the disputed ones; chosen by the seed


@dataclass(frozen=True, eq=False)
class Judge:
    """The data for judging answers to one set of rays; made once and shared by all methods.

    moment         the rays: primary ones, or those of a bounce (:class:`.judge.score.Mirrored`)
    reference      answers to these rays, to compare with
    random_pixels  number of pixels that the referee decides in addition to disputed ones; ``seed`` chooses them
    limit          largest number of disputed pixels that the referee decides
    """

    prepared: Prepared
    moment: Moment
    effects: Effects
    referee: Referee
    reference: Reference
    random_pixels: int = RANDOM_PIXELS
    seed: int = 0
    limit: int = JUDGE_LIMIT

    @staticmethod
    def of(
        prepared: Prepared, moment: Moment, effects: Effects | None = None, folder: Path | str | None = None,
        device: str = "cpu", known: Referee | None = None,
    ) -> Judge:  # fmt: skip
        """The judge of a moment's primary rays. ``folder`` stores the reference's answers; ``device`` runs the
        referee's filter; ``effects`` default to the scene's; ``known``: a referee to use again if its mesh is this one.
        """
        effects = effects or Effects.of(prepared.scene)
        mesh = moment.points, prepared.faces, moment.valid, device, prepared.alpha if effects.alpha else None
        referee = known if known is not None and known.is_of(*mesh) else Referee(*mesh)
        reference = reference_for(prepared, moment, referee, effects, folder)
        return Judge(prepared, moment, effects, referee, reference)

    def of_rays(self, moment: Moment, random_pixels: int) -> Judge:
        """The judge of other rays through the same scene. Its reference is not stored."""
        reference = reference_for(self.prepared, moment, self.referee, self.effects)
        return replace(self, moment=moment, reference=reference, random_pixels=random_pixels)

    def with_random_pixels(self, count: int) -> Judge:
        """A copy of the judge with another number of random pixels."""
        return replace(self, random_pixels=count)

    @property
    def pixel_count(self) -> int:
        return self.moment.width * self.moment.height

    @cached_property
    def wanted(self) -> Bools:
        """Which lights have shadow rays. bool [lights]"""
        return np.array(shadow_flags(self.moment, self.effects), dtype=bool)

    @cached_property
    def checked_reference(self) -> Checked:
        """The answers of the reference in the form of a method's answers: bits are 0 where there is no shadow ray."""
        answers = self.reference.answers()
        outside, _ = not_receivers(self.prepared, self.moment, answers["triangle"])
        answers["shadowed"] = np.where(outside, 0, answers["shadowed"]).astype(np.uint8)
        return check_consistency(self.prepared, self.moment, answers)
