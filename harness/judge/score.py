"""Judge and count answers, in these steps:

1. consistency  is the answer valid, and do t, u and v fit its triangle?        :func:`.consistency.check_consistency`
2. agreement    where does it differ from the reference?                        :func:`.classify.compare`
3. selection    those pixels, their neighbours and a random sample              :func:`.classify.select`
4. referee      the exact answers at the selected pixels                        :func:`.classify.decide`
5. classes      the class of every pixel's closest hit and of every shadow bit  :func:`.classify.classify`
6. counts       the number of answers in each class: the score                  :func:`score_answers`

An answer is never excused by its position in the image, only by :func:`.judge.arithmetic.edge_bound`. Nothing here is
timed, and methods get no information from it.

The mirrored rays that the harness made are stored with a method's answers and are the definition, so each bounce is
judged by itself: its rays against a numpy version computed from the answers of the bounce before (whatever these were),
its hits and shadow bits against Embree and the exact referee on those very rays, as primary rays are.
"""

from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import F32, F64, I8, Bools, Ints
from ..scene.moment import Moment
from ..scene.prepared import Prepared
from .classify import EXAMPLES, Judgement, classify, compare, decide, examples_of, select
from .consistency import check_consistency
from .context import Judge
from .reference import ANSWERS
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

FINE = 2.0**-48  # bound on the float64 rounding of a made ray, 32 units: devices may fuse multiplication and addition
NO_RAY = -77  # stands for a triangle given where there is no ray: never a valid answer


@dataclass(frozen=True, eq=False)
class Mirrored(Moment):
    """A moment whose rays are those of a bounce, one per pixel; a pixel without a ray gets one that leads out of the
    scene.

    ray_origins, ray_directions  float32 [pixels, 3];  active  bool [pixels]
    """

    ray_origins: F32 = field(default_factory=lambda: np.zeros((0, 3), dtype=np.float32))
    ray_directions: F32 = field(default_factory=lambda: np.zeros((0, 3), dtype=np.float32))
    active: Bools = field(default_factory=lambda: np.zeros(0, dtype=bool))

    def origins(self, pixels: Ints) -> F32:
        return self.ray_origins[pixels]

    def directions(self, pixels: Ints) -> F32:
        return self.ray_directions[pixels]


def mirrored(prepared: Prepared, moment: Moment, answers: dict[str, NDArray], bounce: int) -> Mirrored:
    """The moment with the rays of a bounce from 1, as they are in ``answers`` (of ``Answers.to_host``)."""
    active = answers["bounce_active"][bounce - 1] == 1
    corners = moment.points[prepared.faces[moment.valid != 0]]
    # Beyond every vertex along every axis, and leading away: such a ray meets nothing, exactly.
    beyond = min(4.0 * float(np.abs(corners).max(initial=1.0)), float(np.finfo(np.float32).max))
    origins = np.where(active[:, None], answers["bounce_origin"][bounce - 1], np.float32(beyond))
    directions = np.where(active[:, None], answers["bounce_direction"][bounce - 1], np.float32(1.0))
    given = {one.name: getattr(moment, one.name) for one in fields(Moment)}
    return Mirrored(**given, ray_origins=origins, ray_directions=directions, active=active)


def bounce_judge(judge: Judge, answers: dict[str, NDArray], bounce: int) -> Judge:
    """The judge of a bounce's rays. As many rays are sampled as primary rays, or all if there are fewer."""
    rays = mirrored(judge.prepared, judge.moment, answers, bounce)
    count, active = len(rays.active), int(rays.active.sum())
    return judge.of_rays(rays, min(count, judge.random_pixels * count // max(1, active)))


def bounce_answers(answers: dict[str, NDArray], bounce: int) -> dict[str, NDArray]:
    """A method's answers to a bounce, in the form of answers to primary rays; of bounce 0 those themselves."""
    if not bounce:
        return {name: answers[name] for name in ANSWERS}
    result = {name: answers[f"bounce_{name}"][bounce - 1] for name in ANSWERS}
    idle = (answers["bounce_active"][bounce - 1] != 1) & (result["triangle"] != -1)
    return {**result, "triangle": np.where(idle, NO_RAY, result["triangle"])}


def wrong_rays(judge: Judge, answers: dict[str, NDArray], bounce: int) -> Bools:
    """The pixels whose ray of a bounce is not the one that follows from the bounce before. bool [pixels]

    A ray may differ from that of the numpy version by the rounding to float32, and by the float64 rounding, which is
    larger on a thin triangle (by the edges' product over the area) and at a grazing angle (by the inverse of the slope).
    """
    prepared, moment = judge.prepared, judge.moment
    before = mirrored(prepared, moment, answers, bounce - 1) if bounce > 1 else moment
    triangle = bounce_answers(answers, bounce - 1)["triangle"]
    active = answers["bounce_active"][bounce - 1]
    origin, direction = (answers[f"bounce_{name}"][bounce - 1].astype(np.float64) for name in ("origin", "direction"))
    expected = (triangle >= 0) & (triangle < prepared.triangle_count)
    expected[expected] = prepared.mirror[triangle[expected]] == 1
    pixels = np.nonzero(expected)[0]
    corners = moment.points[prepared.faces[triangle[pixels]]].astype(np.float64)
    o, d = (part(pixels).astype(np.float64) for part in (before.origins, before.directions))
    with np.errstate(all="ignore"):
        start, way, thin, slope = reflected(corners, o, d)
        sound = np.isfinite(start).all(axis=1) & np.isfinite(way).all(axis=1)
        size = np.abs(corners).max(axis=(1, 2)) + np.abs(o).max(axis=1) + np.abs(start).max(axis=1)
        slack = (FINE * thin * size / slope)[:, None] + 2.0**-23 * np.abs(start) + 2.0**-140
        turn = (FINE * thin * np.linalg.norm(d, axis=1))[:, None] + 2.0**-23 * np.abs(way) + 2.0**-140
        off = (np.abs(origin[pixels] - start) > slack).any(axis=1)
        off |= (np.abs(direction[pixels] - way) > turn).any(axis=1)
    wrong = np.where(expected, active != 1, (active != 0) | origin.any(axis=1) | direction.any(axis=1))
    wrong[pixels] = sound & (wrong[pixels] | off)
    return wrong


def reflected(corners: F64, o: F64, d: F64) -> tuple[F64, F64, F64, F64]:
    """Start and direction [n, 3] of mirrored rays in float64, before rounding, as :mod:`..frame.effects.mirrors`
    computes them. Also, [n]: the edges' product over the area of each triangle, and the sine of the ray's angle to its
    plane.
    """
    a = corners[:, 0]
    e, f = corners[:, 1] - a, corners[:, 2] - a
    n = np.cross(e, f)
    slope = _dots(n, d)
    h = o + d * (_dots(n, a - o) / slope)[:, None]
    way = d - n * (2.0 * slope / _dots(n, n))[:, None]
    area = np.linalg.norm(n, axis=1)
    side = n * (np.where(slope > 0.0, -1.0, 1.0) / area)[:, None]
    apart = np.abs(corners - h[:, None])
    gamma = 7.0 * 2.0**-24 / (1.0 - 7.0 * 2.0**-24)
    reach = apart.max(axis=(1, 2))
    step = FINE * (reach + np.abs(h).max(axis=1) + np.abs(o).max(axis=1)) + gamma * (
        _dots(np.abs(side), np.abs(h) + apart.max(axis=1)) + reach * np.abs(_dots(side, way)) / np.abs(way).max(axis=1)
    )
    start = h + step[:, None] * side
    start += np.sign(side) * 2.0**-23 * np.abs(start)
    thin = np.linalg.norm(e, axis=1) * np.linalg.norm(f, axis=1) / area
    return start, way, thin, np.abs(slope) / (area * np.linalg.norm(d, axis=1))


def _dots(p: F64, q: F64) -> F64:
    return np.einsum("ij,ij->i", p, q)


@dataclass(frozen=True, eq=False)
class Scored:
    """A score; the worst class of each pixel, int8 [pixels], -1 where a disputed pixel was left unjudged; and the data
    that this score and those of other methods exchange (:mod:`.judge.shared_errors`).
    """

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
    """One class per pixel, int8 [pixels]: of its primary answers if wrong, else of the first wrong bounce."""
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
