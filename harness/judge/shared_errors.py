"""Disputes of others settled: where a method's answer is the reference's, it is as wrong as the reference there.

A method is decided exactly where it differs from the reference (:mod:`.judge.selection`). Everywhere else its answer
*is* the reference's, and the referee may have been asked about that one for another method's sake. So a score keeps,
for each set of rays, where it decided itself and what it found of the reference (:class:`Disputes`). Once all methods
of a moment are scored, :func:`settle` charges each with the reference's errors where it was not decided itself: every
pixel on which two of the methods differ, or one of them and the reference, has then been decided for all of them.

A wrong t, u or v is no part of this: those are checked on every pixel of every method, with the triangle it names.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..files import array_hash
from ..scene.moment import Moment
from .examples import EXAMPLES
from .referee import Hits, Referee
from .reference import Reference
from .selection import Suspects
from .verdict import ERRORS, EXCUSED, EXCUSED_LIMIT, RIGHT, Verdict

AGREES, TIES, DECIDED = 0, 1, 2
"""What an answer is: the reference's and so counted as right, the same as a tie, or decided by itself."""


@dataclass(eq=False)
class Disputes:
    """Of one score and one set of rays: where it was decided, and the reference's answers that are not right.

    place      where the counts lie in the score: "" or "bounces/0/"
    reference  names the reference's answers to these very rays; two scores of one name share them
    width      of the image in pixels
    state      uint8 [pixels]: AGREES, TIES or DECIDED
    pixels     int64 [n]: where the reference was found wrong or excused, ascending
    hit        bool [n]: whether the reference names a triangle there
    primary    int8 [n]: the class of that triangle (of a miss)
    shadow     int8 [n, lights that ask for shadows]: the class of each bit, -1 where the triangle is not right
    """

    place: str
    reference: str
    width: int
    state: NDArray[np.uint8]
    pixels: NDArray[np.int64]
    hit: NDArray[np.bool_]
    primary: NDArray[np.int8]
    shadow: NDArray[np.int8]


def find_disputes(
    moment: Moment,
    reference: Reference,
    referee: Referee,
    hits: Hits,
    suspects: Suspects,
    primary: NDArray[np.int8],
    shadow_of_reference: Sequence[NDArray[np.int8]],
) -> Disputes:
    """What a score leaves to others. ``place`` is to be set where the rays are not the primary ones.

    ``hits``: the exact ones of the judged pixels; ``primary`` [pixels]: the classes of the method's own answers;
    ``shadow_of_reference``: those of the reference's bits at the judged pixels, of each light that asks for shadows.
    """
    state = np.where(primary == Verdict.TIE, TIES, AGREES).astype(np.uint8)
    state[suspects.judged] = DECIDED
    state[suspects.unjudged] = DECIDED
    given = reference.triangle[suspects.judged]
    kinds = referee.classify_primary(hits, given)
    right = np.isin(kinds, RIGHT)
    bits = np.full((len(given), len(shadow_of_reference)), -1, dtype=np.int8)
    for column, found in enumerate(shadow_of_reference):
        bits[right, column] = found[right]
    rows = np.nonzero(~right | (bits > Verdict.OK).any(axis=1))[0]
    every = np.arange(moment.width * moment.height)
    rays = array_hash(moment.origins(every), moment.directions(every), moment.spots)
    name = f"{reference.provenance['key']} {rays} {moment.facing}"
    return Disputes(
        "",
        hashlib.sha256(name.encode()).hexdigest(),
        moment.width,
        state,
        suspects.judged[rows].astype(np.int64),
        given[rows] >= 0,
        kinds[rows],
        bits[rows],
    )


def pooled(disputes: Iterable[Disputes]) -> dict[str, tuple[Disputes, int]]:
    """By reference: what all scores together found of it, each pixel once, and how many scores were asked."""
    groups: dict[str, list[Disputes]] = {}
    for one in disputes:
        groups.setdefault(one.reference, []).append(one)
    result = {}
    for name, group in groups.items():
        pixels, first = np.unique(np.concatenate([one.pixels for one in group]), return_index=True)
        hit, primary, shadow = (
            np.concatenate([getattr(one, part) for one in group])[first]
            for part in ("hit", "primary", "shadow")
        )
        whole = Disputes("", name, group[0].width, np.zeros(0, np.uint8), pixels, hit, primary, shadow)
        result[name] = whole, len(group)
    return result


def settle(rows: Sequence[tuple[dict[str, Any], Sequence[Disputes]]]) -> list[bool]:
    """Settle scores of any moments, in place, with what each one kept; which of them changed.

    Doing it again, or with more rows, starts from what each score had by itself.
    """
    pool = pooled(one for _, kept in rows for one in kept)
    return [charge(score, kept, pool) for score, kept in rows]


def charge(score: dict[str, Any], kept: Sequence[Disputes], pool: dict[str, tuple[Disputes, int]]) -> bool:
    """Charge one score with what ``pool`` knows of its reference; whether that changed it.

    ``settled`` then says how many scores were asked, how many errors and excused pixels came from others' disputes,
    and by how much each count was changed for it.
    """
    if not kept:
        return False
    before = score.get("settled")
    changes: dict[str, int] = {}
    examples: list[dict[str, Any]] = []
    for own in kept:
        whole, _ = pool[own.reference]
        _count(own, _open(own, whole), score, changes, examples)
    settled = {
        "scores": pool[kept[0].reference][1],
        "true_errors": changes.get("true_errors", 0),
        "excused": changes.get("excused", 0),
        "changes": changes,
    }
    if settled == before:
        return False
    if before:
        _apply(score, before["changes"], -1)
    _apply(score, changes, 1)
    score["settled"] = settled
    mine = [one for one in score["examples"] if not one.get("settled")]
    score["examples"] = mine + examples[: max(0, EXAMPLES - len(mine))]
    return True


def charged_pixels(
    kept: Sequence[Disputes], pool: dict[str, tuple[Disputes, int]]
) -> tuple[NDArray[np.int64], NDArray[np.int8]]:
    """The pixels that a score is charged with, primary rays first, and their gravest classes."""
    pixels, kinds = [np.zeros(0, np.int64)], [np.zeros(0, np.int8)]
    for own in kept:
        left = _open(own, pool[own.reference][0])
        right = np.isin(left.primary, RIGHT)
        pixels.append(left.pixels)
        kinds.append(np.where(right, left.shadow.max(axis=1, initial=-1), left.primary).astype(np.int8))
    return np.concatenate(pixels), np.concatenate(kinds)


def _open(own: Disputes, whole: Disputes) -> Disputes:
    """What is known of the reference where a score did not decide itself; ``state`` is the score's there."""
    rows = np.nonzero(own.state[whole.pixels] != DECIDED)[0]
    pixels = whole.pixels[rows]
    parts = (whole.hit[rows], whole.primary[rows], whole.shadow[rows])
    return Disputes(own.place, own.reference, own.width, own.state[pixels], pixels, *parts)


def _count(
    own: Disputes,
    left: Disputes,
    score: dict[str, Any],
    changes: dict[str, int],
    examples: list[dict[str, Any]],
) -> None:
    """Add to ``changes`` (path of a count in the score: by how much) what the pixels of ``left`` come to."""

    def change(path: str, by: int) -> None:
        if by:
            changes[path] = changes.get(path, 0) + by

    place, wrong = own.place, ~np.isin(left.primary, RIGHT)
    lights = [light["light"] for light in _at(score, f"{place}shadow")]
    errors = int(np.isin(left.primary, ERRORS).sum()) + int(np.isin(left.shadow, ERRORS).sum())
    change("true_errors", errors)
    if place:
        change(f"{place}true_errors", errors)
    excused = np.isin(left.primary, EXCUSED) | (left.shadow == Verdict.EDGE).any(axis=1)
    change("excused", int(excused.sum()))
    for kind in np.unique(left.primary[wrong]).tolist():
        change(f"{place}primary/{Verdict(kind).name.lower()}", int((left.primary == kind).sum()))
    change(f"{place}primary/ok", -int((wrong & (left.state == AGREES)).sum()))
    change(f"{place}primary/tie", -int((wrong & (left.state == TIES)).sum()))
    for place_of_light in range(left.shadow.shape[1]):
        path, bits = f"{place}shadow/{place_of_light}", left.shadow[:, place_of_light]
        lost = int((wrong & left.hit).sum())  # a bit is not scored where the triangle is wrong
        change(f"{path}/scored", -lost)
        change(f"{path}/ok", -lost - int((bits > Verdict.OK).sum()))
        for kind in np.unique(bits[bits > Verdict.OK]).tolist():
            change(f"{path}/{Verdict(kind).name.lower()}", int((bits == kind).sum()))
    bounce = {"bounce": int(place.split("/")[1]) + 1} if place else {}
    for row, pixel in enumerate(left.pixels[:EXAMPLES].tolist()):
        where = {**bounce, "pixel": [pixel % own.width, pixel // own.width], "settled": True}
        if wrong[row]:
            examples.append({**where, "kind": Verdict(int(left.primary[row])).name.lower()})
        for light, kind in zip(lights, left.shadow[row].tolist(), strict=True):
            if kind > Verdict.OK:
                examples.append({**where, "kind": Verdict(kind).name.lower(), "light": light})


def _at(score: dict[str, Any], path: str) -> Any:
    """What lies at a path of names and places in a score."""
    found: Any = score
    for step in path.split("/"):
        found = found[int(step)] if isinstance(found, list) else found[step]
    return found


def _apply(score: dict[str, Any], changes: dict[str, int], sign: int) -> None:
    for path, by in changes.items():
        if path != "excused":
            parent, _, name = path.rpartition("/")
            (_at(score, parent) if parent else score)[name] += sign * by
    pixels = score["primary"]["pixels"]
    excused = round(score["excused_share"] * pixels) + sign * changes.get("excused", 0)
    score["excused_share"] = excused / pixels if pixels else 0.0
    passed = score["true_errors"] == 0 and score["excused_share"] <= EXCUSED_LIMIT
    score["check"] = "ok" if passed else "failed"
