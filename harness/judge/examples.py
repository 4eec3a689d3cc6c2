"""Examples of wrong answers in a score: where, what was given, and what is exact."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..scene.moment import Moment
from .consistency import Consistency
from .referee import Hits, Referee
from .selection import Suspects
from .verdict import ERRORS, EXCUSED, Verdict

EXAMPLES = 10
"""At most so many in a score."""


def examples_of(
    moment: Moment,
    answers: dict[str, NDArray],
    referee: Referee,
    hits: Hits,
    suspects: Suspects,
    found: Consistency,
    primary: NDArray[np.int8],
    shadow: Sequence[NDArray[np.int8]],
) -> list[dict[str, Any]]:
    """Up to :data:`EXAMPLES` judged pixels: errors first, then excused ones."""
    row_of = {int(pixel): row for row, pixel in enumerate(suspects.judged)}
    chosen: list[tuple[int, str, int | None]] = []
    for classes in (ERRORS, EXCUSED):
        for light, verdicts in ((None, primary), *enumerate(shadow)):
            for pixel in np.nonzero(np.isin(verdicts, classes))[0][:EXAMPLES].tolist():
                chosen.append((pixel, Verdict(int(verdicts[pixel])).name.lower(), light))
    result = []
    for pixel, kind, light in chosen[:EXAMPLES]:
        row = row_of.get(pixel)
        entry: dict[str, Any] = {"pixel": [pixel % moment.width, pixel // moment.width], "kind": kind}
        if light is None:
            if kind == "true" and (found.t_wrong[pixel] or found.uv_wrong[pixel]):
                entry["kind"] = "true (t)" if found.t_wrong[pixel] else "true (u, v)"
            entry["got"] = {n: _plain(answers[n][pixel]) for n in ("triangle", "t", "u", "v")}
            if row is not None:
                entry["exact"] = {"triangle": list(hits.ties[row]) or [-1], "t": _plain(hits.t[row])}
        else:
            entry["light"] = light
            entry["got"] = int(answers["visibility"][light][pixel])
            if row is not None:
                occluder = int(referee.occluders(hits.take(np.array([row])), moment.lights[light])[0])
                entry["exact"] = {"bit": int(occluder >= 0), "occluder": occluder}
        result.append(entry)
    return result


def _plain(value: Any) -> int | float | str:
    """A number that JSON can hold; infinities and NaN as text."""
    number = value.item()
    return number if isinstance(number, int) or np.isfinite(number) else str(number)
