"""Errors that methods share with the reference.

The referee decides the answers of a method where they differ from the reference (:mod:`.judge.classify`). Everywhere
else the method gave the same answer as the reference, and the referee may have decided that pixel because another method
differs there. So each score stores, for each set of rays, the pixels at which its own answers were decided and the classes
of the reference's answers there (:class:`Disputes`). When all methods of a frame are scored, :func:`share_errors` adds the
errors of the reference to each method at the pixels where the method itself was not decided. Every pixel at which two
methods differ, or a method and the reference, is then decided for all methods.

Wrong t, u or v are not shared, because they are checked at every pixel of every method.
"""

import hashlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..arrays import I8, I64, U8, Bools
from ..files import array_hash
from .classify import EXAMPLES, Judgement
from .verdict import ERRORS, EXCUSED, RIGHT, Score, Shared, Verdict, check_of

AGREES, TIES, DECIDED = 0, 1, 2
"""The state of an answer: equal to the reference's and so counted as right, equal except for a tie, or decided by the
referee.
"""


@dataclass(eq=False)
class Disputes:
    """For one score and one set of rays: the pixels that were decided, and the reference's answers that are not right.

    place      the path of the counts in the score: "" or "bounces/0/"
    reference  the name of the reference's answers to these rays; scores with the same name share them
    width      of the image in pixels
    state      uint8 [pixels]: AGREES, TIES or DECIDED
    pixels     int64 [n]: where the reference was found wrong or excused, ascending
    hit        bool [n]: whether the reference gives a triangle there
    primary    int8 [n]: the class of that triangle (of a miss)
    shadow     int8 [n, lights with shadows]: the class of each bit, -1 where the triangle is not right
    """

    place: str
    reference: str
    width: int
    state: U8
    pixels: I64
    hit: Bools
    primary: I8
    shadow: I8


def find_disputes(found: Judgement) -> Disputes:
    """The disputes of a score, for those of other methods. ``place``: needed unless the rays are primary."""
    judge, selection, reference = found.judge, found.selection, found.reference
    judged, moment = selection.judged, judge.moment
    state = np.where(found.classes.primary == Verdict.TIE, TIES, AGREES).astype(np.uint8)
    state[judged] = DECIDED
    state[selection.unjudged] = DECIDED
    kinds = reference.triangle
    right = np.isin(kinds, RIGHT)
    bits = np.where(right[:, None], reference.bits[judge.wanted][:, judged].T, np.int8(-1))
    rows = np.nonzero(~right | (bits > Verdict.OK).any(axis=1))[0]
    every = np.arange(judge.pixel_count)
    rays = array_hash(moment.origins(every), moment.directions(every), moment.spots)
    name = f"{judge.reference.provenance['key']} {rays} {moment.facing}"
    return Disputes(
        "", hashlib.sha256(name.encode()).hexdigest(), moment.width, state, judged[rows].astype(np.int64),
        judge.reference.triangle[judged][rows] >= 0, kinds[rows], bits[rows],
    )  # fmt: skip


def pooled(disputes: Iterable[Disputes]) -> dict[str, tuple[Disputes, int]]:
    """For each reference: the errors that all scores together found, each pixel once, and the number of scores."""
    groups: dict[str, list[Disputes]] = {}
    for one in disputes:
        groups.setdefault(one.reference, []).append(one)
    result = {}
    for name, group in groups.items():
        pixels, first = np.unique(np.concatenate([one.pixels for one in group]), return_index=True)
        hit, primary, shadow = (
            np.concatenate([getattr(one, part) for one in group])[first] for part in ("hit", "primary", "shadow")
        )
        whole = Disputes("", name, group[0].width, np.zeros(0, np.uint8), pixels, hit, primary, shadow)
        result[name] = whole, len(group)
    return result


def share_errors(rows: Sequence[tuple[Score, Sequence[Disputes]]]) -> list[Score]:
    """Scores of any moments, each with the errors of its reference that all of them together found. If it is repeated,
    also with more rows, it starts again from each score's own counts.
    """
    pool = pooled(one for _, disputes in rows for one in disputes)
    return [charge(score, disputes, pool) for score, disputes in rows]


def charge(score: Score, disputes: Sequence[Disputes], pool: dict[str, tuple[Disputes, int]]) -> Score:
    """A score with the errors of its reference in ``pool``; the same object if nothing changes."""
    if not disputes:
        return score
    changes: dict[str, int] = {}
    examples: list[dict[str, Any]] = []
    for own in disputes:
        whole, _ = pool[own.reference]
        _count(own, _open(own, whole), score, changes, examples)
    shared = Shared(
        scores=pool[disputes[0].reference][1],
        true_errors=changes.get("true_errors", 0),
        excused=changes.get("excused", 0),
        changes=changes,
    )
    if shared == score.settled:
        return score
    facts = score.to_json()
    if score.settled:
        _apply(facts, score.settled.changes, -1)
    _apply(facts, changes, 1)
    mine = [one for one in facts["examples"] if not one.get("settled")]
    facts["examples"] = mine + examples[: max(0, EXAMPLES - len(mine))]
    return replace(Score.from_json(facts), settled=shared)


def charged_pixels(disputes: Sequence[Disputes], pool: dict[str, tuple[Disputes, int]]) -> tuple[I64, I8]:
    """The pixels whose errors are added to a score, primary rays first, and their worst classes."""
    pixels, kinds = [np.zeros(0, np.int64)], [np.zeros(0, np.int8)]
    for own in disputes:
        left = _open(own, pool[own.reference][0])
        right = np.isin(left.primary, RIGHT)
        pixels.append(left.pixels)
        kinds.append(np.where(right, left.shadow.max(axis=1, initial=-1), left.primary).astype(np.int8))
    return np.concatenate(pixels), np.concatenate(kinds)


def _open(own: Disputes, whole: Disputes) -> Disputes:
    """The known errors of the reference at pixels that a score did not decide itself; ``state`` is the score's there."""
    rows = np.nonzero(own.state[whole.pixels] != DECIDED)[0]
    pixels = whole.pixels[rows]
    parts = (whole.hit[rows], whole.primary[rows], whole.shadow[rows])
    return Disputes(own.place, own.reference, own.width, own.state[pixels], pixels, *parts)


def _count(
    own: Disputes, left: Disputes, score: Score, changes: dict[str, int], examples: list[dict[str, Any]]
) -> None:
    """Add the counts of the pixels of ``left`` to ``changes`` (path of a count in the score: increment)."""

    def change(path: str, by: int) -> None:
        if by:
            changes[path] = changes.get(path, 0) + by

    place, wrong = own.place, ~np.isin(left.primary, RIGHT)
    bounce = int(place.split("/")[1]) + 1 if place else 0
    lights = [counts.light for counts in score.parts[bounce].shadow]
    errors = int(np.isin(left.primary, ERRORS).sum()) + int(np.isin(left.shadow, ERRORS).sum())
    change("true_errors", errors)
    if place:
        change(f"{place}true_errors", errors)
    excused = np.isin(left.primary, EXCUSED) | (left.shadow == Verdict.EDGE).any(axis=1)
    change("excused", int(excused.sum()))
    for kind in np.unique(left.primary[wrong]).tolist():
        change(f"{place}primary/{Verdict(kind).key}", int((left.primary == kind).sum()))
    change(f"{place}primary/ok", -int((wrong & (left.state == AGREES)).sum()))
    change(f"{place}primary/tie", -int((wrong & (left.state == TIES)).sum()))
    for place_of_light in range(left.shadow.shape[1]):
        path, bits = f"{place}shadow/{place_of_light}", left.shadow[:, place_of_light]
        lost = int((wrong & left.hit).sum())  # a bit is not scored where the triangle is wrong
        change(f"{path}/scored", -lost)
        change(f"{path}/ok", -lost - int((bits > Verdict.OK).sum()))
        for kind in np.unique(bits[bits > Verdict.OK]).tolist():
            change(f"{path}/{Verdict(kind).key}", int((bits == kind).sum()))
    lead = {"bounce": bounce} if place else {}
    for row, pixel in enumerate(left.pixels[:EXAMPLES].tolist()):
        where = {**lead, "pixel": [pixel % own.width, pixel // own.width], "settled": True}
        if wrong[row]:
            examples.append({**where, "kind": Verdict(int(left.primary[row])).key})
        for light, kind in zip(lights, left.shadow[row].tolist(), strict=True):
            if kind > Verdict.OK:
                examples.append({**where, "kind": Verdict(kind).key, "light": light})


def _apply(facts: dict[str, Any], changes: dict[str, int], sign: int) -> None:
    """Add changes to the counts of a score as JSON, and check it again."""
    for path, by in changes.items():
        if path != "excused":
            *steps, name = path.split("/")
            place: Any = facts
            for step in steps:
                place = place[int(step)] if isinstance(place, list) else place[step]
            place[name] += sign * by
    pixels = facts["primary"]["pixels"]
    excused = round(facts["excused_share"] * pixels) + sign * changes.get("excused", 0)
    facts["excused_share"] = excused / pixels if pixels else 0.0
    facts["check"] = check_of(facts["true_errors"], facts["excused_share"])
