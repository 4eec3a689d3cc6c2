"""Examples of wrong answers in a score: the pixel, the given answer and the exact one."""

from typing import Any

import numpy as np

from .classify import Judgement
from .verdict import ERRORS, EXCUSED, Verdict

EXAMPLES = 10
"""Largest number of examples in a score."""


def examples_of(found: Judgement) -> list[dict[str, Any]]:
    """Up to :data:`EXAMPLES` pixels: errors first, then excused ones."""
    checked, classes, hits = found.checked, found.classes, found.exact.hits
    row_of = {int(pixel): row for row, pixel in enumerate(found.selection.judged)}
    chosen: list[tuple[int, str, int | None]] = []
    for kinds in (ERRORS, EXCUSED):
        for light, verdicts in ((None, classes.primary), *enumerate(classes.shadow)):
            for pixel in np.nonzero(np.isin(verdicts, kinds))[0][:EXAMPLES].tolist():
                chosen.append((pixel, Verdict(int(verdicts[pixel])).key, light))
    result, width = [], found.judge.moment.width
    for pixel, kind, light in chosen[:EXAMPLES]:
        row = row_of.get(pixel)
        entry: dict[str, Any] = {"pixel": [pixel % width, pixel // width], "kind": kind}
        if light is None:
            if kind == Verdict.TRUE.key and (checked.t_wrong[pixel] or checked.uv_wrong[pixel]):
                entry["kind"] = "true (t)" if checked.t_wrong[pixel] else "true (u, v)"
            entry["got"] = {n: _plain(checked.answers[n][pixel]) for n in ("triangle", "t", "u", "v")}
            if row is not None:
                entry["exact"] = {"triangle": list(hits.ties[row]) or [-1], "t": _plain(hits.t[row])}
        else:
            entry["light"] = light
            entry["got"] = int(checked.answers["shadowed"][light][pixel])
            if row is not None:
                outside = checked.outside[light, pixel]
                occluder = -1 if outside else int(found.exact.occluders[light, row])
                entry["exact"] = {"bit": int(occluder >= 0), "occluder": occluder}
        result.append(entry)
    return result


def _plain(value: Any) -> int | float | str:
    """A number that JSON can hold; infinities and NaN as text."""
    number = value.item()
    return number if isinstance(number, int) or np.isfinite(number) else str(number)
