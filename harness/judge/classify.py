"""The class of every pixel's answers: decided by the referee at selected pixels, by comparison with the reference
elsewhere. Selected are the pixels where answers and reference differ, their neighbours, and a random sample.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import I8, Bools
from .consistency import Checked
from .context import Judge
from .decisions import Exact
from .referee import Referee
from .verdict import ERRORS, EXCUSED, GRAVEST_BIT, RIGHT, Verdict

NEIGHBOUR_LIMIT = 5_000  # largest number of neighbours of disputed pixels that are judged; of more, a seeded sample


@dataclass(frozen=True, eq=False)
class Agreement:
    """Where answers agree with the reference.

    triangle  bool [pixels]: the same closest triangle, or exact duplicates of each other
    bits      bool [lights, pixels]: where both have the same hit point and different shadow bits
    """

    triangle: Bools
    bits: Bools


@dataclass(frozen=True, eq=False)
class Selection:
    """The pixels that are decided exactly, ascending. ``unjudged``: disputed pixels beyond the limit."""

    judged: NDArray[np.intp]
    unjudged: NDArray[np.intp]


def compare(judge: Judge, checked: Checked) -> Agreement:
    """Compare answers with the reference."""
    reference, given = judge.reference, checked.answers
    agree = same_triangle(given["triangle"], reference.triangle, judge.referee)
    comparable = agree & ~checked.primary_invalid & (given["triangle"] >= 0)
    expected = np.where(checked.outside, 0, reference.shadowed)
    return Agreement(agree, (given["shadowed"] != expected) & comparable & judge.wanted[:, None])


def same_triangle(given: NDArray, expected: NDArray, referee: Referee) -> Bools:
    """Where two closest triangles are the same one, or exact duplicates of each other. bool [pixels]"""
    agree = given == expected
    if agree.all():
        return agree
    rows = np.nonzero(~agree & (given >= 0) & (given < len(referee.faces)) & (expected >= 0))[0]
    lowest = referee.duplicate_of
    agree[rows] = lowest[given[rows]] == lowest[expected[rows]]
    return agree


def select(judge: Judge, checked: Checked, agreement: Agreement) -> Selection:
    """The pixels that the referee decides; the same ones for the same answers and seed."""
    disputed = ~agreement.triangle | checked.primary_invalid | checked.t_wrong | checked.uv_wrong
    disputed |= agreement.bits.any(axis=0)
    random = np.random.default_rng(judge.seed)
    pixels = np.nonzero(disputed)[0]
    unjudged = np.zeros(0, dtype=np.intp)
    if len(pixels) > judge.limit:
        shuffled = random.permutation(pixels)
        pixels, unjudged = np.sort(shuffled[: judge.limit]), np.sort(shuffled[judge.limit :])
    near = neighbours(pixels, judge.moment.width, judge.moment.height)
    near = near[~disputed[near]]
    if len(near) > NEIGHBOUR_LIMIT:
        near = random.choice(near, NEIGHBOUR_LIMIT, replace=False)
    count = judge.pixel_count
    sample = random.choice(count, min(judge.random_pixels, count), replace=False)
    sample = sample[~disputed[sample]]
    return Selection(np.unique(np.concatenate([pixels, near, sample])), unjudged)


def neighbours(pixels: NDArray[np.intp], width: int, height: int) -> NDArray[np.intp]:
    """The pixels of the 3 x 3 blocks around the given ones, inside the image."""
    x, y = pixels % width, pixels // width
    steps = (-1, 0, 1)
    blocks = [np.clip(y + dy, 0, height - 1) * width + np.clip(x + dx, 0, width - 1) for dy in steps for dx in steps]
    return np.unique(np.concatenate(blocks))


@dataclass(frozen=True, eq=False)
class Classes:
    """The classes of answers, int8 values of :class:`.judge.verdict.Verdict`.

    triangle  [judged]: of the triangle given, whatever its t, u and v
    primary   [pixels]: of the closest hit; a right triangle with a wrong t, u or v is TRUE; -1: left unjudged
    named     bool [pixels]: whether the triangle is right
    bits      [lights, pixels]: of the shadow bits where the triangle is right; -1 elsewhere
    """

    triangle: I8
    primary: I8
    named: Bools
    bits: I8

    @cached_property
    def shadow(self) -> I8:
        """``bits`` where scored: -1 also where t, u or v are wrong. INVALID is what is neither 0 nor 1."""
        unscored = ~np.isin(self.primary, RIGHT) & (self.bits != Verdict.INVALID)
        return np.where(unscored, np.int8(-1), self.bits)

    @cached_property
    def gravest(self) -> I8:
        """One class per pixel: that of the primary answer unless it is right, then that of the worst bit. [pixels]"""
        result, right = self.primary.copy(), np.isin(self.primary, RIGHT)
        for kind in GRAVEST_BIT:
            result[right & (self.shadow == kind).any(axis=0)] = kind
        return result

    @cached_property
    def excused(self) -> Bools:
        """Pixels with an excused answer."""
        return np.isin(self.primary, EXCUSED) | np.isin(self.shadow, EXCUSED).any(axis=0)


@dataclass(frozen=True, eq=False)
class Judgement:
    """The classes of a method's answers to one set of rays; ``reference``: those of the reference's answers."""

    judge: Judge
    checked: Checked
    agreement: Agreement
    selection: Selection
    exact: Exact
    classes: Classes
    reference: Classes


def decide(judge: Judge, selection: Selection) -> Exact:
    """The exact answers at the selected pixels: the reference's, where it has them, else the referee's."""
    moment, pixels = judge.moment, selection.judged
    if judge.reference.decided is not None:
        return judge.reference.decided.take(pixels)
    origins, directions = moment.origins(pixels), moment.directions(pixels)
    return judge.referee.answers(origins, directions, moment.lights, judge.wanted)


def classify(judge: Judge, checked: Checked, agreement: Agreement, selection: Selection, exact: Exact) -> Classes:
    """The classes of answers of a method, or of the reference."""
    given, judged = checked.answers["triangle"], selection.judged
    triangle = judge.referee.classify_primary(exact.hits, given[judged])
    primary = np.full(len(given), Verdict.OK, dtype=np.int8)
    primary[judged] = triangle
    named = agreement.triangle & ~checked.primary_invalid
    named[judged] = np.isin(triangle, RIGHT)
    primary[(checked.t_wrong | checked.uv_wrong) & (primary != Verdict.INVALID)] = Verdict.TRUE
    primary[checked.primary_invalid] = Verdict.INVALID
    primary[selection.unjudged] = -1
    # A duplicate with a lower index exists: a tie, wherever it was not judged already.
    primary[(primary == Verdict.OK) & (given != lowest_ids(given, judge.referee))] = Verdict.TIE
    return Classes(triangle, primary, named, _classify_bits(judge, checked, named, selection, exact))


def _classify_bits(judge: Judge, checked: Checked, named: Bools, selection: Selection, exact: Exact) -> I8:
    """The class of every light's bits where the triangle is right. int8 [lights, pixels]

    Hit points that are not receivers have no shadow ray: a bit that is set there is an error. At the border of a spot the
    answer of either side is excused.
    """
    bits, outside, border = checked.answers["shadowed"], checked.outside, checked.border
    wanted, pixels = judge.wanted[:, None], selection.judged
    scored = named & (checked.answers["triangle"] >= 0) & wanted
    result = np.where(scored, np.int8(Verdict.OK), np.int8(-1))
    result[~wanted & (bits != 0)] = Verdict.INVALID  # a light without shadows: every bit must be 0
    result[scored & outside & ~border & (bits != 0)] = Verdict.ACNE
    exact_bits, given, outside, border = exact.occluders >= 0, bits[:, pixels], outside[:, pixels], border[:, pixels]
    cast = scored[:, pixels] & (~outside | border)
    found = judge.referee.classify_shadows(exact.hits, judge.moment.lights, given, exact.occluders, cast)
    other_side = border & exact_bits & ((given == 1) == outside)
    found[border & (given == 0)] = Verdict.OK
    found[other_side] = Verdict.EDGE
    result[:, pixels] = np.where(cast, found, result[:, pixels])
    result[checked.shadow_invalid & wanted] = Verdict.INVALID
    return result


def lowest_ids(given: NDArray, referee: Referee) -> NDArray:
    """The given triangles, each replaced by its duplicate with the lowest index; invalid indices stay unchanged. [n]"""
    known = (given >= 0) & (given < len(referee.faces))
    return np.where(known, referee.duplicate_of[np.where(known, given, 0)], given) if known.any() else given


EXAMPLES = 10  # largest number of examples in a score


def examples_of(found: Judgement) -> list[dict[str, Any]]:
    """Up to :data:`EXAMPLES` pixels: errors first, then excused ones."""
    checked, classes, hits = found.checked, found.classes, found.exact.hits
    row_of = {int(pixel): row for row, pixel in enumerate(found.selection.judged)}
    chosen: list[tuple[int, str, int | None]] = []
    for kinds in (ERRORS, EXCUSED):
        for light, verdicts in ((None, classes.primary), *enumerate(classes.shadow)):
            for pixel in np.nonzero(np.isin(verdicts, kinds))[0][:EXAMPLES].tolist():
                chosen.append((pixel, Verdict(int(verdicts[pixel])).key, light))
    result, width = [], found.judge.moment.width
    for pixel, kind, light in chosen[:EXAMPLES]:
        row = row_of.get(pixel)
        entry: dict[str, Any] = {"pixel": [pixel % width, pixel // width], "kind": kind}
        if light is None:
            if kind == Verdict.TRUE.key and (checked.t_wrong[pixel] or checked.uv_wrong[pixel]):
                entry["kind"] = "true (t)" if checked.t_wrong[pixel] else "true (u, v)"
            entry["got"] = {n: json_number(checked.answers[n][pixel]) for n in ("triangle", "t", "u", "v")}
            if row is not None:
                entry["exact"] = {"triangle": list(hits.ties[row]) or [-1], "t": json_number(hits.t[row])}
        else:
            entry["light"] = light
            entry["got"] = int(checked.answers["shadowed"][light][pixel])
            if row is not None:
                outside = checked.outside[light, pixel]
                occluder = -1 if outside else int(found.exact.occluders[light, row])
                entry["exact"] = {"bit": int(occluder >= 0), "occluder": occluder}
        result.append(entry)
    return result


def json_number(value: Any) -> int | float | str:
    """A number that JSON can hold; infinities and NaN as text."""
    number = value.item()
    return number if isinstance(number, int) or np.isfinite(number) else str(number)
