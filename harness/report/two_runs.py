"""The verdict between two runs: per scene and method, and for the geometric mean over scenes.

A point is faster or slower where three things hold. It has at least nine rounds in both runs. Mann and Whitney's test on
the medians of its rounds finds a difference, at 5 % over all tests together (Holm's correction). And the gap is larger
than the margin and than the machine's own spread, which is the gap found between two halves of one run, A against A. It
is the same where the 95 % interval of the gap lies within the margin. What neither run could measure is not measured.
Otherwise the verdict is open. What B answers wrongly and A did not is wrong, never faster.
"""

import itertools
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from random import Random
from typing import Any

import numpy as np

from ..arrays import F64
from ..results.record import Record
from ..results.schema import entry_of
from ..results.throttled import disturbed, usual_clock

FASTER, SLOWER, SAME, WRONG, OPEN, UNMEASURED = "faster", "slower", "same", "wrong", "can't tell", "not measured"
VERDICTS = (FASTER, SLOWER, SAME, WRONG, OPEN, UNMEASURED)

ROUNDS = 9  # rounds of each run, at least: fewer cannot give a small enough p once it is corrected for many tests
MARGIN = 0.02  # a gap up to this share counts as no difference
LEVEL = 0.05  # probability of at least one false difference among all tests of a comparison
SPLITS = 200  # ways to halve a run, at most, to find its own spread


@dataclass(frozen=True)
class Timed:
    """A point of one run. ``rounds``: ms of each round by its number; ``left_out``: why a round is not among them."""

    record: Record
    rounds: dict[int, float]
    left_out: dict[int, str] = field(default_factory=dict)

    @property
    def wrong(self) -> int | None:
        """Wrong answers of all frames; None where not every frame was judged."""
        scores = [frame.score for frame in self.record.measured]
        known = [score.true_errors for score in scores if score is not None]
        return sum(known) if known and (len(known) == len(scores) or sum(known)) else None

    @property
    def scene(self) -> str:
        """The title of its scene, with its lighting where that has a name."""
        scene = self.record.scene
        light = (scene.get("lighting") or {}).get("label", "")
        return f"{scene.get('title') or scene['name']}{f', {light}' if light else ''}"

    @property
    def label(self) -> str:
        """What its method is called."""
        method = self.record.method
        return method.get("label") or method.get("title") or method["name"]

    @property
    def failed(self) -> bool:
        """Whether a frame was judged and did not pass: for errors, or for too many that are excused."""
        return any(frame.score is not None and not frame.score.passed for frame in self.record.measured)


@dataclass(frozen=True)
class Row:
    """One verdict. ``gap``: B over A less one; ``low`` and ``high``: its 95 % interval; ``spread``: the machine's own.

    errs      B has errors that A had not
    unjudged  the answers of A were judged, and those of B were not
    lost      A measured it, and B did not
    """

    scene: str
    label: str
    device: str
    verdict: str
    reason: str = ""
    a_ms: float = math.nan
    b_ms: float = math.nan
    gap: float = math.nan
    low: float = math.nan
    high: float = math.nan
    spread: float = math.nan
    p: float = math.nan
    rounds_a: int = 0
    rounds_b: int = 0
    wrong_a: int | None = None
    wrong_b: int | None = None
    errs: bool = False
    unjudged: bool = False
    lost: bool = False
    changed: bool = False
    scenes: int = 1


@dataclass(frozen=True)
class Comparison:
    """Rows of points and of geometric means, rounds left out (run, point, round, reason), entries of one run only."""

    rows: tuple[Row, ...]
    means: tuple[Row, ...]
    left_out: tuple[tuple[str, str, int, str], ...]
    only: dict[str, tuple[str, ...]]

    @property
    def missing(self) -> tuple[str, ...]:
        """The points that A measured and B did not: B has no record of them, or one that says why."""
        return (*self.only["A"], *(f"{row.scene}, {row.label}" for row in self.rows if row.lost))

    @property
    def wrong(self) -> tuple[str, ...]:
        """The points that B answers wrongly and A did not."""
        return tuple(f"{row.scene}, {row.label}" for row in self.rows if row.errs)


def counts(rows: Sequence[Row]) -> dict[str, int]:
    """How many rows have each verdict."""
    return {verdict: sum(row.verdict == verdict for row in rows) for verdict in VERDICTS}


def timed(record: Record, frames: Iterable[int], usual: float, cores: int | None = None) -> Timed:
    """The point's rounds: each the mean, over ``frames``, of the medians of its samples. A round counts where it measured
    all of these frames and was not disturbed (:func:`.results.throttled.disturbed`).
    """
    wanted = set(frames)
    medians: dict[int, list[float]] = {}
    for frame in record.measured:
        if frame.frame in wanted:
            total, numbers = np.asarray(frame.total_ms), np.asarray(frame.round)
            for number in np.unique(numbers):
                medians.setdefault(int(number), []).append(float(np.median(total[numbers == number])))
    whole = {number: float(np.mean(ms)) for number, ms in sorted(medians.items()) if len(ms) == len(wanted)}
    why = {
        int(one["round"]): disturbed(one, usual, record.method["device"], cores)
        for one in record.rounds or ()
        if "round" in one
    }
    slow = {number: text for number, text in why.items() if text and number in whole}
    return Timed(record, {n: ms for n, ms in whole.items() if n not in slow}, slow)


def compared(
    a: Mapping[tuple, Record], b: Mapping[tuple, Record], again: Mapping[tuple, Record] | None = None,
    margin: float = MARGIN, cores: int | None = None,
) -> Comparison:  # fmt: skip
    """Compare the records of two runs, by entry (:func:`entries`).

    again  a second run of A on the same machine, whose gap to A is added to what is known of the machine's own spread
    cores  of the machine: points of a CPU leave out rounds in which the load exceeded them. None: not known
    """
    usual = usual_clock(one for record in (*a.values(), *b.values()) for one in record.rounds or ())

    def over_common_frames(*runs: Record) -> tuple[Timed, Timed]:
        frames = set.intersection(*({frame.frame for frame in one.measured} for one in runs))
        one, other = (timed(record, frames, usual, cores) for record in runs)
        return one, other

    shared = [entry for entry in a if entry in b]
    pairs = {entry: over_common_frames(a[entry], b[entry]) for entry in shared}
    repeats = {entry: over_common_frames(a[entry], again[entry]) for entry in shared if again and entry in again}
    rows = {entry: _row(*pair, repeats.get(entry)) for entry, pair in pairs.items()}
    means = _means(pairs, repeats)
    tested = list(itertools.chain(rows.values(), means))
    corrected = holm([row.p for row in tested])
    final = [_judged(row, p, margin) for row, p in zip(tested, corrected, strict=True)]
    left = [
        (run, f"{one.scene}, {one.label}", number, why)
        for pair in pairs.values()
        for run, one in zip("AB", pair, strict=True)
        for number, why in one.left_out.items()
    ]
    only = {
        run: tuple(
            f"{Timed(one, {}).scene}, {Timed(one, {}).label}" for entry, one in own.items() if entry not in other
        )
        for run, own, other in (("A", a, b), ("B", b, a))
    }
    return Comparison(tuple(final[: len(rows)]), tuple(final[len(rows) :]), tuple(left), only)


def entries(records: Iterable[Record]) -> dict[tuple, Record]:
    """Records by what makes two of them the same entry of a table, in different runs."""
    moved = lambda record: str((record.scene.get("lighting") or {}).get("moved") or "")  # noqa: E731
    return {(record.experiment, *entry_of(record), moved(record)): record for record in records}


def gap_between(a: F64, b: F64) -> tuple[float, float, float]:
    """How much longer ``b`` takes than ``a``, as a share, and its 95 % interval. Hodges and Lehmann's estimate on
    logarithms, which belongs to Mann and Whitney's test. The interval is from the normal approximation of its
    statistic.
    """
    differences = np.sort(np.subtract.outer(np.log(b), np.log(a)).ravel())
    m, n = len(a), len(b)
    reach = 1.96 * math.sqrt(m * n * (m + n + 1) / 12)
    first = max(0, math.floor(m * n / 2 - reach))
    found = np.expm1([np.median(differences), differences[first], differences[-1 - first]])
    return float(found[0]), float(found[1]), float(found[2])


def own_spread(values: F64) -> float:
    """The gap that a run shows against itself, as a share: between its first and second half, and the one that 95 % of
    other ways to halve it stay below. Drift and noise both count.
    """
    half = len(values) // 2
    if half < 2:
        return math.nan
    numbers, logs = range(len(values)), np.log(values)
    ways = list(itertools.islice(itertools.combinations(numbers, half), 5_000))
    if len(ways) > SPLITS:
        ways = [tuple(Random(i).sample(numbers, half)) for i in range(SPLITS)]
    chosen = np.zeros((len(ways), len(values)), dtype=bool)
    np.put_along_axis(chosen, np.array(ways), True, axis=1)
    every = np.broadcast_to(logs, chosen.shape)
    one, other = (np.median(every[side].reshape(len(ways), -1), axis=1) for side in (chosen, ~chosen))
    blocks = abs(float(np.median(logs[:half]) - np.median(logs[half:])))
    return math.expm1(max(blocks, float(np.quantile(abs(one - other), 0.95))))


def holm(values: Sequence[float]) -> list[float]:
    """P values corrected for their number (Holm 1979); NaN, no test, stays and does not count."""
    known = sorted((p, i) for i, p in enumerate(values) if not math.isnan(p))
    result, largest = list(values), 0.0
    for place, (p, i) in enumerate(known):
        largest = max(largest, min(1.0, p * (len(known) - place)))
        result[i] = largest
    return result


def _row(a: Timed, b: Timed, again: tuple[Timed, Timed] | None) -> Row:
    row = Row(
        a.scene, a.label, a.record.method["device"], OPEN, rounds_a=len(a.rounds), rounds_b=len(b.rounds),
        wrong_a=a.wrong, wrong_b=b.wrong, lost=a.record.status == "ok" and b.record.status != "ok", **_flags([(a, b)]),
    )  # fmt: skip
    reasons = [
        f"{one.record.status} in {run}: {one.record.reason or 'no reason given'}"
        for run, one in (("A", a), ("B", b))
        if one.record.status != "ok"
    ]
    if reasons:
        return replace(row, verdict=UNMEASURED if len(reasons) == 2 else OPEN, reason=reasons[0])
    return _tested(row, _by_round([a]), _by_round([b]), again and tuple(_by_round([one]) for one in again))


def _flags(pairs: Sequence[tuple[Timed, Timed]]) -> dict[str, Any]:
    """Of points of A and B: whether B has errors that A had not, more wrong answers or more excused ones than may be;
    whether the answers of A alone were judged; whether the method's code has changed.
    """
    return {
        "errs": any((b.wrong or 0) > (a.wrong or 0) or (b.failed and not a.failed) for a, b in pairs),
        "unjudged": any(a.wrong is not None and b.wrong is None for a, b in pairs),
        "changed": len({(i, one.record.method.get("source_sha256")) for i, ab in enumerate(pairs) for one in ab})
        > len(pairs),
    }


def _means(pairs: Mapping[tuple, tuple[Timed, Timed]], repeats: Mapping[tuple, tuple[Timed, Timed]]) -> list[Row]:
    """A row per method, settings, lights, device and size: geometric mean over scenes, round by round."""
    groups: dict[tuple, list[tuple]] = {}
    for entry, pair in pairs.items():
        if min(len(one.rounds) for one in pair) >= ROUNDS:
            experiment, _, _, *others = entry
            groups.setdefault((experiment, *others), []).append(entry)
    rows = []
    for own in filter(lambda own: len(own) > 1, groups.values()):
        first = pairs[own[0]][0]
        light = (first.record.scene.get("lighting") or {}).get("label", "")
        a, b = (_by_round([pairs[entry][i] for entry in own]) for i in (0, 1))
        whole = all(entry in repeats for entry in own)
        repeat = tuple(_by_round([repeats[entry][i] for entry in own]) for i in (0, 1)) if whole else None
        row = Row(
            f"geometric mean of {len(own)} scenes" + f", {light}" * bool(light), first.label,
            first.record.method["device"], OPEN, rounds_a=len(a), rounds_b=len(b), scenes=len(own),
            **_flags([pairs[entry] for entry in own]),
        )  # fmt: skip
        rows.append(_tested(row, a, b, repeat))
    return rows


def _tested(row: Row, a: F64, b: F64, repeat: tuple[F64, ...] | None) -> Row:
    """The row with its gap, its interval, the machine's own spread and the uncorrected p."""
    from scipy.stats import mannwhitneyu

    if not len(a) or not len(b):
        return replace(row, reason="no frame that both measured, or every round was disturbed")
    row = replace(row, a_ms=float(np.median(a)), b_ms=float(np.median(b)))
    if min(len(a), len(b)) < ROUNDS:
        few = " and ".join(f"{len(x)} in {run}" for run, x in (("A", a), ("B", b)) if len(x) < ROUNDS)
        return replace(row, gap=gap_between(a, b)[0], reason=f"{few} of {ROUNDS} rounds; run with --rounds {ROUNDS}")
    gap, low, high = gap_between(a, b)
    spread = max(own_spread(a), own_spread(b))
    if repeat and min(map(len, repeat)) >= 2:
        spread = max(spread, abs(gap_between(repeat[0], repeat[1])[0]))
    p = float(mannwhitneyu(a, b, alternative="two-sided").pvalue)
    return replace(row, gap=gap, low=low, high=high, spread=spread, p=p)


def _judged(row: Row, p: float, margin: float) -> Row:
    """The row with its corrected p and its verdict."""
    least = max(margin, row.spread)
    if row.errs:
        return replace(row, p=p, verdict=SLOWER if p < LEVEL and row.gap > least else WRONG, reason="")
    if math.isnan(p):
        return row
    row = replace(row, p=p)
    if p < LEVEL and row.gap < -least and row.unjudged:
        return replace(row, reason="its answers in B were not judged, as those in A were")
    if p < LEVEL and abs(row.gap) > least:
        return replace(row, verdict=SLOWER if row.gap > 0 else FASTER)
    if -margin <= row.low and row.high <= margin:
        return replace(row, verdict=SAME)
    if p < LEVEL and abs(row.gap) > margin:
        return replace(row, reason=f"the machine's own spread is {row.spread:.1%}")
    if p < LEVEL:
        return replace(row, reason=f"a gap within {margin:.0%}, whose interval is not")
    return replace(row, reason="no difference found, and the interval is too wide to exclude one")


def _by_round(points: Sequence[Timed]) -> F64:
    """The time of a point in each round, or the geometric mean of several in each that all have."""
    if len(points) == 1:
        return np.array(list(points[0].rounds.values()), dtype=np.float64)
    numbers = sorted(set.intersection(*(set(one.rounds) for one in points)))
    logs = [[math.log(one.rounds[number]) for one in points] for number in numbers]
    return np.exp(np.mean(logs, axis=1)) if logs else np.zeros(0)
