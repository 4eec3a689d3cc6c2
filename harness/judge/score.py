"""Answers against truth: counts per class. Nothing here times, and nothing flows back to a method.

Every pixel's answer is compared with Embree's; t, u and v are checked against the triangle given; every disputed
pixel, its neighbours and a seeded random sample are decided again by the exact referee. A pixel is never excused
by its place in the image, only by :func:`.judge.arithmetic.edge_bound`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..scene.effects import Effects
from ..scene.moment import Moment
from ..scene.prepared import Prepared
from .answer_files import read_raw, save_raw
from .bounces import Scored, score_bounces
from .classify import gravest_of, lowest_ids, primary_verdicts, shadow_verdicts
from .consistency import check_consistency
from .examples import EXAMPLES, examples_of
from .receivers import not_receivers
from .referee import Hits, Referee
from .reference import Reference, embree_installed, embree_reference, exact_reference
from .selection import Suspects, agreement, disputed_bits, find_suspects
from .shared_errors import Disputes, find_disputes
from .verdict import ERRORS, EXCUSED, EXCUSED_LIMIT, PRIMARY, RIGHT, SHADOW, Verdict

__all__ = ["Judge", "save_raw", "score_answers", "score_raw"]

JUDGE_LIMIT = 100_000
"""Disputed pixels judged; beyond it a seeded sample is judged and every other one counts as a true error."""


class Judge:
    """Truth of one moment, made once and shared by every method: Embree's answers and the exact referee.

    ``folder`` keeps Embree's answers; ``device`` is where the referee's filter runs. Where Embree is not installed
    the referee decides every pixel itself, and so it does where triangles have holes; the provenance says so.
    """

    def __init__(
        self,
        prepared: Prepared,
        moment: Moment,
        effects: Effects | None = None,
        folder: Path | str | None = None,
        device: str = "cpu",
    ) -> None:
        self.prepared, self.moment, self.folder, self.device = prepared, moment, folder, device
        self.effects = effects or Effects.of(prepared.scene)

    @cached_property
    def reference(self) -> Reference:
        if self.effects.alpha or not embree_installed():
            return exact_reference(self.prepared, self.moment, self.referee, self.effects, self.folder)
        return embree_reference(self.prepared, self.moment, self.effects, self.folder)

    @cached_property
    def referee(self) -> Referee:
        mask = self.prepared.alpha if self.effects.alpha else None
        return Referee(self.moment.points, self.prepared.faces, self.moment.valid, self.device, mask)

    def score(
        self,
        answers: dict[str, NDArray],
        extra_pixels: int = 200,
        classes: NDArray[np.int8] | None = None,
        disputes: list[Disputes] | None = None,
    ) -> dict[str, Any]:
        """The score of a method's answers to this moment (see :func:`score_answers`)."""
        return score_answers(
            self.prepared,
            self.moment,
            answers,
            self.reference,
            self.referee,
            self.effects,
            extra_pixels,
            classes=classes,
            disputes=disputes,
        )


def score_answers(
    prepared: Prepared,
    moment: Moment,
    answers: dict[str, NDArray],
    reference: Reference,
    referee: Referee,
    effects: Effects,
    extra_pixels: int = 200,
    seed: int = 0,
    judge_limit: int = JUDGE_LIMIT,
    classes: NDArray[np.int8] | None = None,
    disputes: list[Disputes] | None = None,
) -> dict[str, Any]:
    """Counts per class of a method's answers (numpy arrays as ``Answers.to_host`` gives them); JSON-able.

    ``primary`` and each light of ``shadow`` count classes of :class:`~.judge.referee.Verdict` over all pixels (agreement
    with Embree counts as ok where the referee was not asked); the largest errors of t, u and v are over pixels with
    the right triangle. ``true_errors`` sums what no rounding excuses and
    the disputed pixels left unjudged; ``excused_share`` is the share of pixels in an excused class; ``check`` is
    "ok" only with no true error and at most :data:`EXCUSED_LIMIT` excused. ``reference_errors`` are the same
    counts for Embree's own answers over the judged pixels. ``classes`` (int8 [pixels]), where given, is filled
    with the class of every pixel: of its primary answer where that is wrong or excused, else the gravest of its
    shadow bits, else of its first bounce that is; -1 for a disputed pixel left unjudged. ``disputes``, where given,
    gets what :func:`.judge.shared_errors.settle` needs once other methods' answers to the same moment are scored too;
    an exact reference leaves nothing to settle.

    Where rays bounce, ``bounces`` has for each the same again for its rays (:func:`.judge.bounces.score_bounces`), and
    its errors and excuses count with the others. ``answers`` then hold the rays too.
    """

    def scored(
        rays: Moment, given: dict[str, NDArray], sample: int, known: Reference | None = None
    ) -> Scored:
        truth = known or reference_of(prepared, rays, referee, effects)
        return _scored(prepared, rays, given, truth, referee, effects, sample, seed, judge_limit)

    score, gravest, excused, left = scored(moment, answers, extra_pixels, reference)
    bounces = score_bounces(prepared, moment, answers, effects, extra_pixels, scored)
    for place, (_, _, _, more) in enumerate(bounces):
        left += [replace(one, place=f"bounces/{place}/") for one in more]
    if disputes is not None:
        disputes += left
    for found, kinds, excuses, _ in bounces:
        excused |= excuses
        right = np.isin(gravest, RIGHT)
        gravest[right] = kinds[right]
        score["true_errors"] += found["true_errors"]
        score["examples"] += [{"bounce": found["bounce"], **one} for one in found.pop("examples")]
    score["examples"] = score["examples"][:EXAMPLES]
    if bounces:
        score["bounces"] = [found for found, *_ in bounces]
    if classes is not None:
        classes[:] = gravest
    share = float(excused.mean()) if excused.size else 0.0
    score["excused_share"] = share
    score["check"] = "ok" if score["true_errors"] == 0 and share <= EXCUSED_LIMIT else "failed"
    score["truth"] = {**reference.provenance, "random_pixels": extra_pixels, "seed": seed}
    return score


def reference_of(prepared: Prepared, moment: Moment, referee: Referee, effects: Effects) -> Reference:
    """The reference for rays that only one method's answers have, so that it is not kept."""
    if not embree_installed():
        return exact_reference(prepared, moment, referee, effects)
    return embree_reference(prepared, moment, effects)


def _scored(
    prepared: Prepared,
    moment: Moment,
    answers: dict[str, NDArray],
    reference: Reference,
    referee: Referee,
    effects: Effects,
    extra_pixels: int,
    seed: int,
    judge_limit: int,
) -> Scored:
    lights = len(moment.lights)
    own_reference = reference
    outside = not_receivers(prepared, moment, answers["triangle"])
    if outside.any():
        reference = replace(reference, visibility=np.where(outside, 0, reference.visibility).astype(np.uint8))
    found = check_consistency(prepared, moment, answers)
    wanted = _wanted(effects, lights)
    agree = agreement(answers["triangle"], reference.triangle, referee)
    suspects = find_suspects(
        moment, answers, reference, found, agree, wanted, extra_pixels, seed, judge_limit
    )
    hits = referee.closest(moment.origins(suspects.judged), moment.directions(suspects.judged))

    primary, named = primary_verdicts(referee, hits, answers["triangle"], found, suspects, agree)
    # A duplicate with a lower index exists: a tie, wherever it was not judged already.
    primary[(primary == Verdict.OK) & (answers["triangle"] != lowest_ids(answers["triangle"], referee))] = (
        Verdict.TIE
    )
    shadow = shadow_verdicts(referee, moment, hits, answers, found, suspects, primary, wanted, outside)

    excused = np.isin(primary, EXCUSED)
    for verdicts in shadow:
        excused |= verdicts == Verdict.EDGE
    unjudged = len(suspects.unjudged)
    true_errors = (
        int(np.isin(primary, ERRORS).sum() + sum(np.isin(v, ERRORS).sum() for v in shadow)) + unjudged
    )
    bits = disputed_bits(answers, reference, found, agree, wanted)
    reference_errors, of_reference = _reference_errors(
        prepared, moment, referee, hits, own_reference, suspects, wanted
    )
    left: list[Disputes] = []
    if not reference.exact:
        left.append(find_disputes(moment, reference, referee, hits, suspects, primary, of_reference))
    score = {
        "primary": {
            "pixels": moment.width * moment.height,
            "disputed": int((~agree).sum()),
            "judged": len(suspects.judged),
            "unjudged": unjudged,
            **_counts(primary, PRIMARY),
            "t_wrong": int(found.t_wrong.sum()),
            "uv_wrong": int(found.uv_wrong.sum()),
            "t_max_relative_error": float(found.t_error[named].max(initial=0.0)),
            "uv_max_error": float(found.uv_error[named].max(initial=0.0)),
        },
        "shadow": [
            {
                "light": i,
                "scored": int((shadow[i] >= 0).sum()),
                "disputed": int(bits[i].sum()),
                **_counts(shadow[i], SHADOW),
            }
            for i in range(lights)
            if wanted[i]
        ],
        "true_errors": true_errors,
        "examples": examples_of(moment, answers, referee, hits, suspects, found, primary, shadow),
        "reference_errors": reference_errors,
    }
    return score, gravest_of(primary, shadow), excused, left


def _wanted(effects: Effects, lights: int) -> list[bool]:
    return [i < len(effects.shadows) and bool(effects.shadows[i]) for i in range(lights)]


def _counts(verdicts: NDArray[np.int8], classes: Sequence[Verdict]) -> dict[str, int]:
    return {verdict.name.lower(): int((verdicts == verdict).sum()) for verdict in classes}


def _reference_errors(
    prepared: Prepared,
    moment: Moment,
    referee: Referee,
    hits: Hits,
    reference: Reference,
    suspects: Suspects,
    wanted: Sequence[bool],
) -> tuple[dict[str, Any], list[NDArray[np.int8]]]:
    """Embree's own answers on the judged pixels, counted the same way (its t and triangle together).

    Also, of each light that asks for shadows, the classes of its bits there, whatever its t: int8 [judged].
    """
    answers = reference.answers()
    outside = not_receivers(prepared, moment, reference.triangle)
    answers["visibility"] = np.where(outside, 0, answers["visibility"]).astype(np.uint8)
    found = check_consistency(prepared, moment, answers)
    agree = np.ones(len(reference.triangle), dtype=bool)
    primary, named = primary_verdicts(referee, hits, reference.triangle, found, suspects, agree)
    right = np.where(named, np.int8(Verdict.OK), primary)
    shadow = shadow_verdicts(referee, moment, hits, answers, found, suspects, right, wanted, outside)
    judged = suspects.judged
    bits = [verdicts[judged] for i, verdicts in enumerate(shadow) if wanted[i]]
    unscored = ~np.isin(primary, RIGHT)
    for i in np.nonzero(np.array(wanted))[0]:
        shadow[i][unscored & (shadow[i] != Verdict.INVALID)] = -1
    counts = {
        "primary": {
            "judged": len(judged),
            **_counts(primary[judged], PRIMARY),
            "t_wrong": int(found.t_wrong[judged].sum()),
            "uv_wrong": int(found.uv_wrong[judged].sum()),
        },
        "shadow": [
            {"light": i, "judged": int((v[judged] >= 0).sum()), **_counts(v[judged], SHADOW)}
            for i, v in enumerate(shadow)
            if wanted[i]
        ],
    }
    return counts, bits


def score_raw(
    path: Path | str,
    scene_dir: Path | str | None = None,
    folder: Path | str | None = None,
    disputes: list[Disputes] | None = None,
) -> dict[str, Any]:
    """The score of answers kept by :func:`save_raw`, as :func:`.judge.score.score_answers` gives it; ``disputes`` too.

    Raises :class:`UserError` for a file that is no such file, or a mesh that is not the one traced.
    ``scene_dir``: where originals of the catalogue's scenes lie. ``folder``: keeps Embree's answers.
    """
    from .score import Judge

    prepared, moment, answers, facts = read_raw(Path(path), scene_dir)
    effects = Effects(
        tuple(facts["shadows"]), alpha=bool(facts.get("alpha")), bounces=facts.get("bounces", 0)
    )
    return Judge(prepared, moment, effects, folder).score(answers, disputes=disputes)
