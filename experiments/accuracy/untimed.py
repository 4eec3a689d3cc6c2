"""What the experiment counts without timing, kept as CSV: errors over the distance of the light and the offset of the scene
from the origin, and wrong answers of its points on the hard cases.

Scenes are recentred before methods get them, which hides the effect of an offset. Here it is added on purpose, equally
for every method and for the judge. All of them get the same rounded triangles, so the counts are errors of the
arithmetic, not of the rounding of the input.
"""

import csv
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from ...harness.files import write_text
from ...harness.frame.devices import device_for, placed_method
from ...harness.frame.registry import make_method, method_class
from ...harness.frame.session import Session
from ...harness.hardcases import all_cases
from ...harness.hardcases.judge import Judged, judge_method
from ...harness.judge.context import Judge
from ...harness.judge.score import score_answers
from ...harness.judge.verdict import EXCUSED, Score, Verdict, total
from ...harness.report.dataframe import DataFrame, pd
from ...harness.runner.machine.lock import MACHINE
from ...harness.runner.planning.experiment import Entry
from ...harness.runner.planning.planned_point import Options
from ...harness.runner.progress import Silent, counted
from ...harness.scene.overrides import Lighting
from ...harness.scene.prepared import Prepared, prepare, rounded, weld

DIRECTION = np.array([0.48, 0.6, 0.64])  # Of the offset: no axis, so that no coordinate stays small. Unit length.

HEAT, HARD = "accuracy_heat.csv", "accuracy_hard.csv"
HEAT_COLUMNS = (
    "scene label method distance offset size status wrong primary_wrong acne leak excused scored pixels".split()
)
HARD_COLUMNS = "label method device cases cases_wrong true_errors worst left_out".split()
NONE = "none"


def offset_by(prepared: Prepared, radii: float) -> Prepared:
    """The prepared scene with everything, including eye and lights, moved by a number of its radii."""
    step = DIRECTION * radii * prepared.radius
    centre = prepared.centre - step
    first = np.asarray(prepared.geometry.positions(0), dtype=np.float64).reshape(-1, 3)
    return replace(
        prepared, centre=centre, middle=prepared.middle + step, weld=weld(first - centre),
        points=rounded(prepared.geometry, prepared.faces, centre),
    )  # fmt: skip


def error_grid(
    prepared: Prepared, entries: Sequence[Entry], distances: Sequence[float], offsets: Sequence[float], size: int,
    device: str,
) -> Iterator[dict[str, Any]]:  # fmt: skip
    """One row per entry, light distance and offset (both in scene radii): counts of each class, or why there are none.
    The light stands in its own direction from the scene's middle. ``size``: pixels along a side.
    """
    for offset in offsets:
        moved = offset_by(prepared, offset)
        for distance in distances:
            lit = Lighting(label=f"{distance:g}", distance=distance).applied(moved)
            moment = lit.moment(0, size, size)
            judge = Judge.of(lit, moment, device=device)
            for entry in entries:
                MACHINE.give_way()
                row: dict[str, Any] = {"scene": lit.scene.name, "label": entry.label, "method": entry.method}
                row |= {"distance": distance, "offset": offset, "size": size}
                try:
                    method, place, reason = placed_method(entry.method, entry.settings, lit.scene, device)
                except ImportError as error:  # a peer's library that is not installed costs its own rows only
                    reason = f"{error.name or error} is not installed"
                if reason:
                    yield {**row, "status": f"skipped: {reason}"}
                    continue
                score = score_answers(judge, Session(method, lit, size, size, place).answers(moment)).score
                yield {**row, "status": "ok", **counts(score)}


def counts(score: Score) -> dict[str, int]:
    """What is wrong in a score: wrong primary answers, acne, leaks, excused edges, and pixels with a shadow bit."""
    return {
        "wrong": score.true_errors, "primary_wrong": score.primary.true + score.primary.invalid,
        "acne": total(score, Verdict.ACNE), "leak": total(score, Verdict.LEAK),
        "excused": sum(total(score, kind) for kind in EXCUSED), "scored": sum(light.scored for light in score.shadow),
        "pixels": score.primary.pixels,
    }  # fmt: skip


def keep(path: Path, report: Silent, what: str, rows: Iterable[dict[str, Any]], count: int, columns: list[str]) -> None:
    """Write ``count`` rows as CSV once they are all made."""
    table = pd.DataFrame(counted(report, f"{what}, untimed", rows, count), columns=columns).convert_dtypes()
    write_text(path, table.to_csv(index=False, lineterminator="\n"))


def keep_grid(
    options: Options, report: Silent, entries: Sequence[Entry], distances: Sequence[float], offsets: Sequence[float],
    size: int,
) -> None:  # fmt: skip
    """Compute the grid on the run's first scene and write it, unless it is there: its answers do not change."""
    if not kept(options):
        prepared = prepare(options.described(options.preset.scenes[0]))
        rows = error_grid(prepared, entries, distances, offsets, size, options.device)
        count = len(entries) * len(distances) * len(offsets)
        keep(options.out / HEAT, report, "errors by light distance and offset", rows, count, HEAT_COLUMNS)


def kept(options: Options) -> bool:
    """Whether the folder has the grid of the run's first scene; it may have that of another one."""
    try:
        with (options.out / HEAT).open(encoding="utf-8") as stream:
            name = next(csv.DictReader(stream), {}).get("scene")
    except OSError:
        return False
    return name == options.described(options.preset.scenes[0]).name


def hard_rows(
    entries: Sequence[Entry], device: str, without: tuple[str, ...] = (), but: Sequence[str] = ()
) -> Iterator[dict[str, Any]]:
    """One row per entry: cases run, cases with a true error, true errors in all, the cases with the most, and those left
    out.

    Shadow bits count also where a method declares them to lie outside what it can do. Methods whose library is not
    installed have no row. ``without``: cases whose names begin so are left out, ``but`` for those named. The exact answers
    are made once and shared.
    """
    known = all_cases()
    cases = [case for case in known if case.name in but or not case.name.startswith(without or ("\0",))]
    left_out = "; ".join(case.name for case in known if case not in cases) or NONE
    judged: dict[str, Judged] = {}
    for entry in entries:
        try:
            place = device_for(method_class(entry.method), device)
        except ImportError:  # a peer's library that is not installed: no row
            continue
        method = partial(make_method, entry.method, dict(entry.settings))
        found = judge_method(method, place, cases, judged, every_bit=True)
        run = [finding for finding in found if finding.status != "outside"]
        wrong = sorted((f for f in run if f.status == "error"), key=lambda f: -f.true_errors)
        yield {
            "label": entry.label, "method": entry.method, "device": place, "cases": len(run), "cases_wrong": len(wrong),
            "true_errors": sum(finding.true_errors for finding in run),
            "worst": "; ".join(f"{finding.case} {finding.true_errors}" for finding in wrong[:4]), "left_out": left_out,
        }  # fmt: skip


def keep_hard(
    options: Options, report: Silent, entries: Sequence[Entry], without: tuple[str, ...], but: Sequence[str] = ()
) -> None:
    """Judge the entries on the hard cases and write one row for each, unless that was done."""
    if not (options.out / HARD).exists():
        rows = hard_rows(entries, options.device, without, but)
        keep(options.out / HARD, report, "hard cases", rows, len(entries), HARD_COLUMNS)


def read_hard(folder: Path) -> DataFrame:
    """The stored rows; none if a folder has none. Older folders have no ``left_out``: it is not known."""
    path = folder / HARD
    return (pd.read_csv(path) if path.exists() else pd.DataFrame()).reindex(columns=HARD_COLUMNS)


def described(hard: DataFrame) -> list[str]:
    """What the counts on the hard cases cover, as sentences for the report."""
    if hard.empty:
        return []
    text = f"Wrong answers on the hard cases: up to {int(hard['cases'].max())} of them per point, each in {HARD}"
    if hard["left_out"].isna().all():
        return [f"{text}; which of the others were left out was not recorded."]
    names = str(hard["left_out"].iloc[0]).split("; ")
    if names == [NONE]:
        return [f"{text}; none was left out."]
    return [f"{text}. {len(names)} were not tried, in which a point may still be wrong: {', '.join(names)}."]
