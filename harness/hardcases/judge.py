"""Run a method on a hard case: expected and given counts, and the class of every wrong answer."""

from collections.abc import Callable, Mapping, Sequence
from copy import deepcopy
from dataclasses import asdict, dataclass, field
from functools import cached_property
from hashlib import sha256
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import CapacityRejected, UserError
from ..frame.method import Method
from ..frame.session import Session
from ..judge.arithmetic import edge_bound
from ..judge.context import Judge
from ..judge.distances import plane_distance
from ..judge.referee import Referee
from ..judge.reference import exact_reference
from ..judge.score import Judgement, judge_frame, score_answers
from ..judge.verdict import ERRORS, EXCUSED, WRONG_BIT, Verdict
from ..runner.machine.lock import MACHINE
from ..scene.effects import Effects
from .case import Counts, HardCase, Trial

Answers = dict[str, NDArray]
ERROR_NAMES = ("hole", *(kind.key for kind in ERRORS), "differs", "failed")
"""What counts as an error: a ray that leaks through a closed surface, the judge's error classes, two different answers
that must be the same, a crash.
"""

NOT_OK = (Verdict.TIE, *EXCUSED, *ERRORS)
OF_BITS = tuple(kind.key for kind in WRONG_BIT)

SHADOWS = "shadows"  # key in a method's `outside`: it does not claim that its shadow bits are right


@dataclass
class Finding:
    """The result of one case.

    ``status``: ok; outside (declared by the method, or not applicable); error; or excused (more answers were excused
    than :attr:`.case.HardCase.excusable` allows). ``classes`` counts answers that are not ok; ``examples`` are some of
    them, as :mod:`.judge.score` describes them. ``excused``: of ``rays`` answers, those that are wrong by rounding near
    an edge. ``hits``: of ``pixels`` primary rays, those that hit something. ``bits_outside``: wrong shadow bits of a
    method that declares shadows as outside.
    """

    case: str
    title: str
    expected: str
    got: str = ""
    status: str = "ok"
    classes: dict[str, int] = field(default_factory=dict)
    reason: str = ""
    examples: list[dict[str, Any]] = field(default_factory=list)
    excused: int = 0
    rays: int = 0
    pixels: int = 0
    hits: int = 0
    bits_outside: int = 0

    @property
    def true_errors(self) -> int:
        return sum(self.classes.get(name, 0) for name in ERROR_NAMES)

    def as_json(self) -> dict[str, Any]:
        return {**asdict(self), "true_errors": self.true_errors}


@dataclass(frozen=True, eq=False)
class Judged:
    """A trial with its exact answers, made once for every method and device."""

    case: HardCase
    trial: Trial
    _counts: dict[bytes, tuple[dict[str, int], list[dict[str, Any]], int]] = field(default_factory=dict)
    """What :meth:`count` found, by a hash of the answers: exact methods give the same bits."""

    @cached_property
    def judge(self) -> Judge:
        """The judge of the trial's rays, with exact answers as the reference."""
        prepared, moment = self.trial.prepared, self.trial.moment
        effects = Effects.of(prepared.scene)
        referee = Referee(moment.points, prepared.faces, moment.valid, mask=prepared.alpha)
        reference = exact_reference(prepared, moment, referee, effects)
        return Judge(prepared, moment, effects, referee, reference, random_pixels=0)

    @property
    def exact(self) -> Answers:
        """The exact answers, in the form in which a method gives them."""
        return self.judge.checked_reference.answers

    @property
    def rays(self) -> int:
        """Number of rays: one per pixel, and one from each hit to each light with shadows."""
        triangle = self.exact["triangle"]
        return len(triangle) + int((triangle >= 0).sum()) * int(self.judge.wanted.sum())

    def count(self, answers: Answers, shadows: bool = True) -> tuple[dict[str, int], list[dict[str, Any]], int]:
        """Counts of classes but ok, examples, wrong shadow bits that are no errors; ``shadows``: whether they are."""
        known = digest(answers, shadows)
        if known not in self._counts:
            self._counts[known] = self._count(answers, shadows)
        return deepcopy(self._counts[known])

    def _count(self, answers: Answers, shadows: bool) -> tuple[dict[str, int], list[dict[str, Any]], int]:
        classes: dict[str, int] = {}
        examples: list[dict[str, Any]] = []

        def add(name: str, count: int, example: str = "") -> None:
            if count:
                classes[name] = classes.get(name, 0) + count
                if example:
                    examples.append({"kind": example})

        found = judge_frame(self.judge, answers)
        score = score_answers(self.judge, answers, found).score
        bits_outside = 0
        for part in score.parts:
            for counts in (part.primary, *part.shadow):
                outside = WRONG_BIT if counts is not part.primary and not shadows else ()
                for kind in NOT_OK:
                    count = getattr(counts, kind.key, 0)
                    if kind in outside:
                        bits_outside += count
                    else:
                        add(kind.key, count)
        wrong = sum(bounce.rays_wrong for bounce in score.bounces)
        add("differs", wrong, f"{wrong} mirrored rays differ from those that follow from the previous hits")
        if self.trial.watertight:
            holes = self._holes(found[0], shadows)
            add("hole", holes, f"{holes} rays through closed surfaces")
        bits = answers["shadowed"]
        for one, other in self.trial.same_lights if shadows else ():
            differ = int(np.count_nonzero(bits[one] != bits[other]))
            add("differs", differ, f"lights {one} and {other} at one place differ")
        shown = [one for one in score.examples if shadows or "light" not in one or one["kind"] not in OF_BITS]
        return classes, examples + shown, bits_outside

    def _holes(self, found: Judgement, shadows: bool) -> int:
        """Misses where the exact ray hits, and lit pixels with the right triangle where the exact segment is occluded.
        A segment that begins or ends within the error bound of its occluder's plane may still be excused, because
        float64 cannot decide whether the hit point lies in that plane. A near edge is no excuse here.
        """
        exact, given, referee = self.exact, found.checked.answers, self.judge.referee
        same = given["triangle"] == exact["triangle"]
        holes = int(np.count_nonzero((given["triangle"] == -1) & ~same))
        lit = (given["shadowed"] == 0) & (exact["shadowed"] == 1) & same & shadows
        for i, light in enumerate(self.trial.moment.lights):
            # Such a bit differs from the reference, so the referee has decided it.
            rows = np.nonzero(lit[i, found.selection.judged])[0]
            corners = referee.corners(found.exact.occluders[i, rows])
            points = found.exact.hits.points[rows]
            ends = np.broadcast_to(light.astype(np.float64), points.shape)
            away = np.minimum(plane_distance(points, corners), plane_distance(ends, corners))
            holes += int(np.count_nonzero(away > edge_bound(points)))
        return holes


def counts_of(answers: Answers, lights: int) -> Counts:
    """The counts of hits and shadowed pixels in a set of answers."""
    shadowed = tuple(int((answers["shadowed"][i] == 1).sum()) for i in range(lights))
    return Counts(int((answers["triangle"] >= 0).sum()), shadowed)


def judge_case(judged: Judged, method: Method, device: str, every_bit: bool = False, twice: bool = True) -> Finding:
    """Run a method on a case: the classes of its answers, and, if ``twice``, whether another run gave the same bits.
    ``every_bit``: wrong shadow bits count even if the method declares shadows as outside.
    """
    case, trial = judged.case, judged.trial
    lights = len(trial.moment.lights)
    finding = Finding(case.name, case.title, str(counts_of(judged.exact, lights)))
    outside = outside_of(method)
    reason = outside.get(case.name) or method.applies(trial.prepared.scene, device)
    if reason:
        finding.status, finding.reason = "outside", reason
        return finding
    try:
        moment = trial.moment
        session = Session(method, trial.prepared, moment.width, moment.height, device)
        for earlier in trial.before:
            session.answers(earlier)
        answers = session.answers(moment)
        again = session.answers(moment) if twice else answers
    except CapacityRejected as error:
        finding.status, finding.reason = "outside", f"rejected: {error}"
        return finding
    except Exception as error:  # any exception is a finding of the check
        finding.classes, finding.status = {"failed": 1}, "error"
        finding.got = finding.reason = f"{type(error).__name__}: {error}"
        return finding
    finding.got = str(counts_of(answers, lights))
    finding.classes, finding.examples, finding.bits_outside = judged.count(answers, every_bit or SHADOWS not in outside)
    finding.excused = sum(finding.classes.get(kind.key, 0) for kind in EXCUSED)
    finding.rays, finding.pixels = judged.rays, len(judged.exact["triangle"])
    finding.hits = int((judged.exact["triangle"] >= 0).sum())
    unlike = [name for name in answers if not same_bits(answers[name], again[name])]
    if unlike:
        finding.classes["differs"] = finding.classes.get("differs", 0) + 1
        finding.reason = f"two runs differ in {', '.join(unlike)}"
    if finding.true_errors:
        finding.status = "error"
    elif finding.excused > case.excusable * finding.rays:
        finding.status = "excused"
        most = (
            f"{finding.excused / finding.rays:.1%} of its rays are excused, more than the {case.excusable:.1%} allowed"
        )
        finding.reason = f"{finding.reason}; {most}" if finding.reason else most
    return finding


def outside_of(method: Method) -> Mapping[str, str]:
    """The cases, or :data:`SHADOWS`, that a method declares as not supported, each with the reason."""
    return getattr(method, "outside", None) or {}


def judge_refusal(case: HardCase) -> Finding:
    """A case with an invalid scene: making it must raise a :class:`UserError`."""
    finding = Finding(case.name, case.title, "refused")
    try:
        case.make()
    except UserError as error:
        finding.got, finding.reason = "refused", str(error)
    else:
        finding.got, finding.status, finding.classes = "made", "error", {"failed": 1}
    return finding


def digest(answers: Answers, shadows: bool) -> bytes:
    """A hash of the bytes, types and shapes of answers."""
    found = sha256(b"shadows" if shadows else b"")
    for name, values in sorted(answers.items()):
        found.update(f"{name} {values.dtype.str} {values.shape};".encode())
        found.update(np.ascontiguousarray(values).tobytes())
    return found.digest()


def same_bits(a: NDArray, b: NDArray) -> bool:
    """Whether two arrays hold the same bytes (NaN equals itself, 0 differs from -0)."""
    return a.shape == b.shape and a.tobytes() == b.tobytes()


def judge_method(
    make_method: Callable[[], Method], device: str, cases: Sequence[HardCase], judged: dict[str, Judged],
    every_bit: bool = False,
) -> list[Finding]:  # fmt: skip
    """Run every case on one method. ``judged``: a cache of exact answers; ``every_bit`` as in :func:`judge_case`."""
    findings = []
    for case in cases:
        MACHINE.give_way()
        if case.refused:
            findings.append(judge_refusal(case))
            continue
        if case.name not in judged:
            judged[case.name] = Judged(case, case.make())
        findings.append(judge_case(judged[case.name], make_method(), device, every_bit))
    return findings
