"""The pixels where answers and reference differ, and the pixels that are decided exactly: those, their neighbours, a
random sample."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..arrays import Bools
from .consistency import Checked
from .context import Judge
from .referee import Referee

NEIGHBOUR_LIMIT = 5_000
"""Largest number of neighbours of disputed pixels that are judged; of more, a seeded sample."""


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
