"""Judge and count answers, in these steps:

1. consistency  is the answer valid, and do t, u and v fit its triangle?        :func:`.consistency.check_consistency`
2. agreement    where does it differ from the reference?                        :func:`.classify.compare`
3. selection    those pixels, their neighbours and a random sample              :func:`.classify.select`
4. referee      the exact answers at the selected pixels                        :func:`.classify.decide`
5. classes      the class of every pixel's closest hit and of every shadow bit  :func:`.classify.classify`
6. counts       the number of answers in each class: the score                  :func:`score_answers`

An answer is never excused by its position in the image, only by :func:`.judge.arithmetic.edge_bound`. Nothing here is
timed, and methods get no information from it.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import I8
from .bounces import bounce_answers, bounce_judge, wrong_rays
from .classify import EXAMPLES, Judgement, classify, compare, decide, examples_of, select
from .consistency import check_consistency
from .context import Judge
from .shared_errors import Disputes, find_disputes
from .verdict import (
    ERRORS,
    PRIMARY,
    RIGHT,
    SHADOW,
    BounceCounts,
    PrimaryClasses,
    PrimaryCounts,
    RayCounts,
    ReferenceErrors,
    ReferenceShadow,
    Score,
    ShadowCounts,
    Verdict,
    check_of,
)


@dataclass(frozen=True, eq=False)
class Scored:
    """A score; the worst class of each pixel, int8 [pixels], -1 where a disputed pixel was left unjudged; and the data
    that this score and those of other methods exchange (:mod:`.judge.shared_errors`)."""

    score: Score
    classes: I8
    disputes: tuple[Disputes, ...]


def judge_rays(judge: Judge, answers: dict[str, NDArray]) -> Judgement:
    """Judge answers (numpy arrays as ``Answers.to_host`` gives them) to one set of rays."""
    checked = check_consistency(judge.prepared, judge.moment, answers)
    agreement = compare(judge, checked)
    selection = select(judge, checked, agreement)
    exact = decide(judge, selection)
    classes = classify(judge, checked, agreement, selection, exact)
    reference = classify(judge, judge.checked_reference, agreement, selection, exact)
    return Judgement(judge, checked, agreement, selection, exact, classes, reference)


def judge_frame(judge: Judge, answers: dict[str, NDArray]) -> list[Judgement]:
    """Judge answers to a frame: to its primary rays, then to each bounce of mirrored rays."""
    found = [judge_rays(judge, answers)]
    for bounce in range(1, judge.effects.bounces + 1):
        found.append(judge_rays(bounce_judge(judge, answers, bounce), bounce_answers(answers, bounce)))
    return found


def gravest_classes(found: list[Judgement]) -> I8:
    """One class per pixel, int8 [pixels]: that of its primary answers if they are wrong, else that of the first bounce
    with a wrong answer."""
    result = found[0].classes.gravest
    for one in found[1:]:
        right = np.isin(result, RIGHT)
        result = np.where(right, one.classes.gravest, result)
    return result


def score_answers(judge: Judge, answers: dict[str, NDArray], found: list[Judgement] | None = None) -> Scored:
    """The score of a method's answers to a frame. ``found``: what :func:`judge_frame` says of them, where that is known."""
    primary, *mirrored = found = found or judge_frame(judge, answers)
    counts, examples = _count(primary), examples_of(primary)
    bounces = []
    for bounce, one in enumerate(mirrored, 1):
        wrong = int(wrong_rays(judge, answers, bounce).sum())
        rays = int((answers["bounce_active"][bounce - 1] == 1).sum())
        of_bounce = _count(one)
        parts = {**vars(of_bounce), "true_errors": of_bounce.true_errors + wrong}
        bounces.append(BounceCounts(**parts, bounce=bounce, rays=rays, rays_wrong=wrong))
        examples += [{"bounce": bounce, **example} for example in examples_of(one)]
    excused = np.logical_or.reduce([one.classes.excused for one in found])
    share = float(excused.mean()) if excused.size else 0.0
    errors = counts.true_errors + sum(one.true_errors for one in bounces)
    sampled: dict[str, Any] = {"random_pixels": judge.random_pixels, "seed": judge.seed}
    score = Score(
        primary=counts.primary, shadow=counts.shadow, true_errors=errors, reference_errors=counts.reference_errors,
        excused_share=share, check=check_of(errors, share), examples=tuple(examples[:EXAMPLES]),
        truth={**judge.reference.provenance, **sampled}, bounces=tuple(bounces),
    )  # fmt: skip
    places = ["", *(f"bounces/{i}/" for i in range(len(mirrored)))]
    disputes = tuple(
        replace(find_disputes(one), place=place)
        for place, one in zip(places, found, strict=True)
        if not one.judge.reference.exact
    )
    return Scored(score, gravest_classes(found), disputes)


def _count(found: Judgement) -> RayCounts:
    """Where the referee has not decided, an answer that agrees with the reference counts as right."""
    judge, checked, classes = found.judge, found.checked, found.classes
    lights = np.nonzero(judge.wanted)[0].tolist()
    unjudged, named = len(found.selection.unjudged), classes.named
    return RayCounts(
        primary=PrimaryCounts(
            pixels=judge.pixel_count, disputed=int((~found.agreement.triangle).sum()),
            judged=len(found.selection.judged), unjudged=unjudged, **_tally(classes.primary, PRIMARY),
            t_wrong=int(checked.t_wrong.sum()), uv_wrong=int(checked.uv_wrong.sum()),
            t_max_relative_error=float(checked.t_error[named].max(initial=0.0)),
            uv_max_error=float(checked.uv_error[named].max(initial=0.0)),
        ),
        shadow=tuple(
            ShadowCounts(
                light=i, scored=int((classes.shadow[i] >= 0).sum()), disputed=int(found.agreement.bits[i].sum()),
                **_tally(classes.shadow[i], SHADOW),
            )
            for i in lights
        ),
        true_errors=int(np.isin(classes.primary, ERRORS).sum() + np.isin(classes.shadow, ERRORS).sum()) + unjudged,
        reference_errors=_count_reference(found, lights),
    )  # fmt: skip


def _count_reference(found: Judgement, lights: list[int]) -> ReferenceErrors:
    """The answers of the reference at the judged pixels, counted in the same way."""
    classes, checked, judged = found.reference, found.judge.checked_reference, found.selection.judged
    primary = PrimaryClasses(
        judged=len(judged), **_tally(classes.primary[judged], PRIMARY), t_wrong=int(checked.t_wrong[judged].sum()),
        uv_wrong=int(checked.uv_wrong[judged].sum()),
    )  # fmt: skip
    bits = classes.shadow[:, judged]
    shadow = [ReferenceShadow(light=i, judged=int((bits[i] >= 0).sum()), **_tally(bits[i], SHADOW)) for i in lights]
    return ReferenceErrors(primary=primary, shadow=tuple(shadow))


def _tally(classes: I8, kinds: tuple[Verdict, ...]) -> dict[str, int]:
    return {kind.key: int((classes == kind).sum()) for kind in kinds}
