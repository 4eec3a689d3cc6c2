"""Errors over the distance of the light and the offset of the scene from the origin: counted, stored as CSV, and drawn.

Scenes are recentred before methods get them, which hides the effect of an offset. Here it is added on purpose, equally
for every method and for the judge. All of them get the same rounded triangles, so the counts are errors of the
arithmetic, not of the rounding of the input. Nothing is timed.
"""

import csv
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ...harness.files import write_text
from ...harness.frame.devices import placed_method
from ...harness.frame.session import Session
from ...harness.judge.context import Judge
from ...harness.judge.counts import Score, total
from ...harness.judge.score import score_answers
from ...harness.judge.verdict import EXCUSED, Verdict
from ...harness.runner.machine.lock import MACHINE
from ...harness.runner.planning.experiment import Entry
from ...harness.runner.planning.run_options import Options
from ...harness.runner.progress import Silent, counted
from ...harness.scene.overrides import Lighting
from ...harness.scene.prepared import Prepared, prepare, rounded, weld

DIRECTION = np.array([0.48, 0.6, 0.64])
"""Of the offset: no axis, so that no coordinate stays small. Unit length."""

NAME = "accuracy_heat.csv"
COLUMNS = "scene label method distance offset size status wrong primary_wrong acne leak excused scored pixels".split()


def offset_by(prepared: Prepared, radii: float) -> Prepared:
    """The prepared scene with everything, including eye and lights, moved by a number of its radii."""
    step = DIRECTION * radii * prepared.radius
    centre = prepared.centre - step
    first = np.asarray(prepared.geometry.positions(0), dtype=np.float64).reshape(-1, 3)
    return replace(
        prepared,
        centre=centre,
        middle=prepared.middle + step,
        weld=weld(first - centre),
        points=rounded(prepared.geometry, prepared.faces, centre),
    )


def error_grid(
    prepared: Prepared,
    entries: Sequence[Entry],
    distances: Sequence[float],
    offsets: Sequence[float],
    size: int,
    device: str,
) -> Iterator[dict[str, Any]]:
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
                    yield {**row, "status": f"skipped: {error.name or error} is not installed"}
                    continue
                if reason:
                    yield {**row, "status": f"skipped: {reason}"}
                    continue
                session = Session(method, lit, size, size, place)
                score = score_answers(judge, session.answers(moment)).score
                yield {**row, "status": "ok", **counts(score)}


def counts(score: Score) -> dict[str, int]:
    """What is wrong in a score: wrong primary answers, acne, leaks, excused edges, and pixels with a shadow bit."""
    return {
        "wrong": score.true_errors,
        "primary_wrong": score.primary.true + score.primary.invalid,
        "acne": total(score, Verdict.ACNE),
        "leak": total(score, Verdict.LEAK),
        "excused": sum(total(score, kind) for kind in EXCUSED),
        "scored": sum(light.scored for light in score.shadow),
        "pixels": score.primary.pixels,
    }


def keep_grid(
    options: Options,
    report: Silent,
    entries: Sequence[Entry],
    distances: Sequence[float],
    offsets: Sequence[float],
    size: int,
) -> None:
    """Compute the grid on the run's first scene and write it, unless it is there: its answers do not change."""
    if not kept(options):
        import pandas as pd

        prepared = prepare(options.described(options.preset.scenes[0]))
        rows = error_grid(prepared, entries, distances, offsets, size, options.device)
        count = len(entries) * len(distances) * len(offsets)
        found = list(counted(report, "errors by light distance and offset, untimed", rows, count))
        text = pd.DataFrame(found, columns=COLUMNS).convert_dtypes().to_csv(index=False, lineterminator="\n")
        write_text(options.out / NAME, text)


def kept(options: Options) -> bool:
    """Whether the folder has the grid of the run's first scene; it may have that of another one."""
    try:
        with (options.out / NAME).open(encoding="utf-8") as stream:
            name = next(csv.DictReader(stream), {}).get("scene")
    except OSError:
        return False
    return name == options.described(options.preset.scenes[0]).name
