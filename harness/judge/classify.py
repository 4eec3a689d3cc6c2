"""The class of every pixel's answers: the referee's where it was asked, agreement with Embree elsewhere."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..scene.moment import Moment
from .consistency import Consistency
from .referee import Hits, Referee
from .selection import Suspects
from .verdict import RIGHT, Verdict


def lowest_ids(given: NDArray, referee: Referee) -> NDArray:
    """Given triangles, of duplicates the one with the lowest index; what is no triangle stays. [n]"""
    known = (given >= 0) & (given < len(referee.faces))
    return np.where(known, referee.duplicate_of[np.where(known, given, 0)], given) if known.any() else given


def primary_verdicts(
    referee: Referee,
    hits: Hits,
    given: NDArray,
    found: Consistency,
    suspects: Suspects,
    agree: NDArray[np.bool_],
) -> tuple[NDArray[np.int8], NDArray[np.bool_]]:
    """The class of every pixel's answer, -1 where a disputed one was left unjudged; and where the triangle is right.

    int8 and bool [pixels]. A right triangle with a wrong t, u or v is a true error all the same.
    """
    verdicts = np.full(len(given), Verdict.OK, dtype=np.int8)
    verdicts[suspects.judged] = referee.classify_primary(hits, given[suspects.judged])
    named = agree & ~found.primary_invalid
    named[suspects.judged] = np.isin(verdicts[suspects.judged], RIGHT)
    verdicts[(found.t_wrong | found.uv_wrong) & (verdicts != Verdict.INVALID)] = Verdict.TRUE
    verdicts[found.primary_invalid] = Verdict.INVALID
    verdicts[suspects.unjudged] = -1
    return verdicts, named


def shadow_verdicts(
    referee: Referee,
    moment: Moment,
    hits: Hits,
    answers: dict[str, NDArray],
    found: Consistency,
    suspects: Suspects,
    primary: NDArray[np.int8],
    wanted: Sequence[bool],
    outside: NDArray[np.bool_],
) -> list[NDArray[np.int8]]:
    """For each light the class of every pixel's bit; -1 where it is not scored. int8 [pixels] each

    Hit points ``outside`` (no receivers) have no shadow ray: a bit there is a shadow where none can be.
    """
    scored = np.isin(primary, RIGHT)
    result = []
    for i, light in enumerate(moment.lights):
        bits = answers["visibility"][i]
        if not wanted[i]:
            # A light that asks for no shadows: every bit must be 0.
            verdicts = np.where(bits != 0, Verdict.INVALID, -1).astype(np.int8)
        else:
            verdicts = np.where(scored & (answers["triangle"] >= 0), Verdict.OK, -1).astype(np.int8)
            rows = np.nonzero(verdicts[suspects.judged] == Verdict.OK)[0]
            pixels = suspects.judged[rows]
            verdicts[pixels] = referee.classify_shadow(hits.take(rows), light, bits[pixels])
            out = outside[i] & (verdicts >= 0)
            verdicts[out] = np.where(bits[out] != 0, Verdict.ACNE, Verdict.OK)
            verdicts[found.shadow_invalid[i]] = Verdict.INVALID
        result.append(verdicts)
    return result


def gravest_of(primary: NDArray[np.int8], shadow: Sequence[NDArray[np.int8]]) -> NDArray[np.int8]:
    """One class a pixel: the primary answer's unless it is right, then an error of any shadow bit, then an edge."""
    result = primary.copy()
    right = np.isin(primary, RIGHT)
    for kind in (Verdict.EDGE, Verdict.INVALID, Verdict.LEAK, Verdict.ACNE):
        for verdicts in shadow:
            result[right & (verdicts == kind)] = kind
    return result
