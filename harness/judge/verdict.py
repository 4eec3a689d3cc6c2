"""The classes of answers, and the verdict that the referee gives."""

from __future__ import annotations

from enum import IntEnum


class Verdict(IntEnum):
    """The class of an answer. TRUE, INVALID, ACNE and LEAK are errors; the others are not.

    OK        the lowest index of the exact tie set, or the right shadow bit
    TIE       another member of the exact tie set
    NEAR_TIE  another triangle whose exact t is within the bound of the true one
    EDGE      wrong only because the ray passes within the bound of an exact edge, or of the border of a hole
    TRUE      wrong
    INVALID   not an answer: poison, NaN, an index out of range, a triangle that is never hit
    ACNE      says shadowed, is lit;  LEAK  says lit, is shadowed
    """

    OK = 0
    TIE = 1
    NEAR_TIE = 2
    EDGE = 3
    TRUE = 4
    INVALID = 5
    ACNE = 6
    LEAK = 7


# What an answer is counted as, what of that is wrong, excused or right.
PRIMARY = (Verdict.OK, Verdict.TIE, Verdict.NEAR_TIE, Verdict.EDGE, Verdict.TRUE, Verdict.INVALID)
SHADOW = (Verdict.OK, Verdict.EDGE, Verdict.ACNE, Verdict.LEAK, Verdict.INVALID)
ERRORS = (Verdict.TRUE, Verdict.INVALID, Verdict.ACNE, Verdict.LEAK)
EXCUSED = (Verdict.NEAR_TIE, Verdict.EDGE)
RIGHT = (Verdict.OK, Verdict.TIE)
EXCUSED_LIMIT = 0.001
"""A score fails where a larger share of the pixels had to be excused."""
