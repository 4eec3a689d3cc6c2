"""Which pixels are decided exactly: those in dispute, their neighbours, and a random sample."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..scene.moment import Moment
from .consistency import Consistency
from .referee import Referee
from .reference import Reference

NEIGHBOUR_LIMIT = 5_000
"""Neighbours of disputed pixels judged; beyond it a seeded sample of them."""


@dataclass(eq=False)
class Suspects:
    """Which pixels are decided exactly. ``unjudged`` are disputed ones beyond the limit."""

    disputed: NDArray[np.bool_]
    judged: NDArray[np.intp]
    unjudged: NDArray[np.intp]


def agreement(given: NDArray, expected: NDArray, referee: Referee) -> NDArray[np.bool_]:
    """Where two closest triangles are the same one, or exact duplicates of each other. bool [pixels]"""
    agree = given == expected
    if agree.all():
        return agree
    rows = np.nonzero(~agree & (given >= 0) & (given < len(referee.faces)) & (expected >= 0))[0]
    lowest = referee.duplicate_of
    agree[rows] = lowest[given[rows]] == lowest[expected[rows]]
    return agree


def disputed_bits(
    answers: dict[str, NDArray],
    reference: Reference,
    found: Consistency,
    agree: NDArray[np.bool_],
    wanted: Sequence[bool],
) -> NDArray[np.bool_]:
    """Where both see the same point and say different shadow bits. bool [lights, pixels]"""
    comparable = agree & ~found.primary_invalid & (answers["triangle"] >= 0)
    differ = (answers["visibility"][: len(wanted)] != reference.visibility) & comparable[None, :]
    return differ & np.asarray(wanted, dtype=bool)[:, None]


def find_suspects(
    moment: Moment,
    answers: dict[str, NDArray],
    reference: Reference,
    found: Consistency,
    agree: NDArray[np.bool_],
    wanted: Sequence[bool],
    extra_pixels: int,
    seed: int,
    judge_limit: int,
) -> Suspects:
    disputed = ~agree | found.primary_invalid | found.t_wrong | found.uv_wrong
    disputed |= disputed_bits(answers, reference, found, agree, wanted).any(axis=0)
    random = np.random.default_rng(seed)
    pixels = np.nonzero(disputed)[0]
    unjudged = np.zeros(0, dtype=np.intp)
    if len(pixels) > judge_limit:
        shuffled = random.permutation(pixels)
        pixels, unjudged = np.sort(shuffled[:judge_limit]), np.sort(shuffled[judge_limit:])
    near = neighbours(pixels, moment.width, moment.height)
    near = near[~disputed[near]]
    if len(near) > NEIGHBOUR_LIMIT:
        near = random.choice(near, NEIGHBOUR_LIMIT, replace=False)
    count = moment.width * moment.height
    sample = random.choice(count, min(extra_pixels, count), replace=False)
    sample = sample[~disputed[sample]]
    return Suspects(disputed, np.unique(np.concatenate([pixels, near, sample])), unjudged)


def neighbours(pixels: NDArray[np.intp], width: int, height: int) -> NDArray[np.intp]:
    """The pixels of the 3 x 3 blocks around the given ones, inside the image."""
    x, y = pixels % width, pixels // width
    steps = (-1, 0, 1)
    blocks = [
        np.clip(y + dy, 0, height - 1) * width + np.clip(x + dx, 0, width - 1) for dy in steps for dx in steps
    ]
    return np.unique(np.concatenate(blocks))
