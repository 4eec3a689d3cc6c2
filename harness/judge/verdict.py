"""The classes of answers, and the verdict that the referee gives."""

from enum import IntEnum


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

MEANINGS = {
    Verdict.TIE: "another triangle at exactly the same t",
    Verdict.NEAR_TIE: "another triangle, its t the same within float32 rounding (excused)",
    Verdict.EDGE: "wrong, but the ray passes an edge within float32 rounding (excused)",
    Verdict.TRUE: "a wrong triangle, t, u or v",
    Verdict.INVALID: "not an answer",
    Verdict.ACNE: "a lit point called shadowed",
    Verdict.LEAK: "a shadowed point called lit",
}
"""What each class but OK means, for legends."""

EXCUSED_LIMIT = 0.001  # a score fails if a larger share of the pixels is excused
