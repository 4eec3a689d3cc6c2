"""The classes of answers, and the score of a frame: how many answers fall into each, for the primary rays, each light and
each bounce.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import IntEnum
from typing import Annotated, Any

from ..typed_json import OMITTED, checked, to_json

Count = Annotated[int, 0]  # a count; when it is read it is checked not to be negative


class Verdict(IntEnum):
    """The class of an answer. TRUE, INVALID, ACNE and LEAK are errors; the others are not.

    OK        the lowest index of the exact tie set, or the right shadow bit
    TIE       another member of the exact tie set
    NEAR_TIE  another triangle whose exact t is within the bound of the true one
    EDGE      wrong only because the ray passes within the bound of an exact edge, or of the border of a hole or spot
    TRUE      wrong
    INVALID   not an answer: poison, NaN, an index out of range, a triangle that is never hit
    ACNE      a lit point called shadowed;  LEAK  a shadowed point called lit
    """

    OK = 0
    TIE = 1
    NEAR_TIE = 2
    EDGE = 3
    TRUE = 4
    INVALID = 5
    ACNE = 6
    LEAK = 7

    @property
    def key(self) -> str:
        """Its name in records."""
        return self.name.lower()

    @property
    def label(self) -> str:
        """Its name in tables."""
        return self.key.replace("_", "-")


PRIMARY = (Verdict.OK, Verdict.TIE, Verdict.NEAR_TIE, Verdict.EDGE, Verdict.TRUE, Verdict.INVALID)
"""The classes of a closest hit."""

SHADOW = (Verdict.OK, Verdict.EDGE, Verdict.ACNE, Verdict.LEAK, Verdict.INVALID)  # the classes of a shadow bit

RIGHT = (Verdict.OK, Verdict.TIE)
EXCUSED = (Verdict.NEAR_TIE, Verdict.EDGE)
ERRORS = (Verdict.TRUE, Verdict.INVALID, Verdict.ACNE, Verdict.LEAK)

WRONG_BIT = (Verdict.EDGE, Verdict.ACNE, Verdict.LEAK)  # the classes of a shadow bit that is 0 or 1 and wrong

GRAVEST_BIT = (Verdict.EDGE, Verdict.INVALID, Verdict.LEAK, Verdict.ACNE)
"""The classes of wrong shadow bits; of a pixel with several, the last one here counts."""

MEANINGS = {  # what each class but OK means, for legends
    Verdict.TIE: "another triangle at exactly the same t",
    Verdict.NEAR_TIE: "another triangle, its t the same within float32 rounding (excused)",
    Verdict.EDGE: "wrong, but the ray passes an edge within float32 rounding (excused)",
    Verdict.TRUE: "a wrong triangle, t, u or v",
    Verdict.INVALID: "not an answer",
    Verdict.ACNE: "a lit point called shadowed",
    Verdict.LEAK: "a shadowed point called lit",
}

EXCUSED_LIMIT = 0.001  # a score fails if a larger share of the pixels is excused


@dataclass(frozen=True, kw_only=True)
class PrimaryClasses:
    """Closest hits by class of :class:`.judge.verdict.Verdict`; and how many have a wrong t, or a wrong u or v."""

    judged: Count = 0
    ok: Count = 0
    tie: Count = 0
    near_tie: Count = 0
    edge: Count = 0
    true: Count = 0
    invalid: Count = 0
    t_wrong: Count = 0
    uv_wrong: Count = 0


@dataclass(frozen=True, kw_only=True)
class PrimaryCounts(PrimaryClasses):
    """Closest hits of all pixels by class.

    disputed  pixels where the answer and the reference differ
    judged    pixels that the exact referee decided; ``unjudged``: disputed ones beyond the limit, true errors all
    t_max_relative_error, uv_max_error  over the pixels with the right triangle
    """

    pixels: Count
    disputed: Count = 0
    unjudged: Count = 0
    t_max_relative_error: float = 0.0
    uv_max_error: float = 0.0


@dataclass(frozen=True, kw_only=True)
class ShadowClasses:
    """Shadow bits of one light by class."""

    light: Count
    ok: Count = 0
    edge: Count = 0
    acne: Count = 0
    leak: Count = 0
    invalid: Count = 0


@dataclass(frozen=True, kw_only=True)
class ShadowCounts(ShadowClasses):
    """``scored``: bits with a class, those of pixels with the right triangle; ``disputed``: differ from the reference's."""

    scored: Count = 0
    disputed: Count = 0


@dataclass(frozen=True, kw_only=True)
class ReferenceShadow(ShadowClasses):
    judged: Count = 0


@dataclass(frozen=True, kw_only=True)
class ReferenceErrors:
    """The reference's own answers at the judged pixels, by class."""

    primary: PrimaryClasses
    shadow: tuple[ReferenceShadow, ...] = ()

    @property
    def true_errors(self) -> int:
        return sum(total(self, kind) for kind in ERRORS)


@dataclass(frozen=True, kw_only=True)
class RayCounts:
    """The counts of one set of rays. ``true_errors``: errors that no rounding excuses, including unjudged pixels."""

    primary: PrimaryCounts
    shadow: tuple[ShadowCounts, ...]
    true_errors: Count
    reference_errors: ReferenceErrors | None = None


@dataclass(frozen=True, kw_only=True)
class BounceCounts(RayCounts):
    """The counts of one bounce. ``rays_wrong``: rays that do not follow from the hit before; true errors too."""

    bounce: Count
    rays: Count
    rays_wrong: Count


@dataclass(frozen=True, kw_only=True)
class Shared:
    """The counts that were added to a score for errors of the reference that the scores of other methods showed.

    scores      how many scores share the reference
    changes     by path of a count in the score ("bounces/0/primary/true"): what was added to it
    """

    scores: Count
    true_errors: Count
    excused: Count
    changes: dict[str, int]


@dataclass(frozen=True, kw_only=True)
class Score(RayCounts):
    """The score of a method's answers to one frame, as a record stores it.

    true_errors    of primary rays and all bounces
    excused_share  share of the pixels with an excused answer
    check          "ok" without true errors and with at most :data:`.verdict.EXCUSED_LIMIT` excused, else "failed"
    examples       some of the errors, then of the excused answers: pixel, class, what was given, what is exact
    truth          the origin of the reference, and how pixels were selected
    bounces        the counts of each bounce
    settled        the counts that were added because of other scores; None before the comparison
    """

    excused_share: float
    check: str = ""
    examples: tuple[dict[str, Any], ...] = ()
    truth: dict[str, Any] = field(default_factory=dict)
    bounces: tuple[BounceCounts, ...] = field(default=(), metadata=OMITTED)
    settled: Shared | None = field(default=None, metadata=OMITTED)

    @property
    def passed(self) -> bool:
        return self.check == "ok"

    @property
    def parts(self) -> tuple[RayCounts, ...]:
        """The counts of the primary rays, then of each bounce."""
        return (self, *self.bounces)

    def to_json(self) -> dict[str, Any]:
        return to_json(self)

    @staticmethod
    def from_json(value: Any, name: str = "") -> Score:
        """The score in a record. Raises :class:`.typed_json.WrongFieldError`."""
        return checked(Score, value, name)


def check_of(true_errors: int, excused_share: float) -> str:
    """Whether a score passes: "ok" or "failed"."""
    return "ok" if true_errors == 0 and excused_share <= EXCUSED_LIMIT else "failed"


def total(counts: RayCounts | ReferenceErrors, kind: Verdict) -> int:
    """How many answers of one set of rays have a class: closest hits and the bits of all lights."""
    return sum(getattr(part, kind.key, 0) for part in (counts.primary, *counts.shadow))
