"""The least that the stages of our fastest method must read, write and test: the floor that frame_time draws.

Each input is read once and each output written once, whatever a cache or a gather adds; each ray is tested once,
though every triangle before or beside its first one costs a test as well.
"""

from __future__ import annotations

import re
from typing import Any

from ..harness.report.roofline import Work

TRIANGLE = 12 + 1
"""Bytes of a triangle's indices and of whether it is valid."""
VERTEX = 12
WORD = 8
"""Bytes of a pixel's nearest word."""
ANSWER = 4 * 4
"""Bytes of a pixel's triangle, distance and weights."""
HIT, POINT, PLACE, SLOT = 24, 16, 16, 8
"""Bytes of a pixel's hit point in float64, in float32, of its place (with its depth) and its slot in the cells."""
ITEM, RECORD, LINES, PAIR = 16, 64, 48, 8
"""Bytes of a queued item, of a triangle's planes, of an item's lines, of a doubtful pair."""


def ray_grids(row: dict[str, Any], name: str) -> Work | None:
    """The work of a pass of ``ray_grids``, by its name; queues by the counters of the frame. ``row``: of a tidy table."""
    pixels, rays = row["pixels"], row["shadow_rays"]
    mesh = row["triangles"] * TRIANGLE + row["vertices"] * VERTEX
    match = re.fullmatch(r"(camera|light \d+): (.+?)(?:, share \d+ of (\d+))?", name)
    if match is None:
        return None
    who, what, shares = match.groups()
    share = 1.0 / int(shares or 1)
    stage = f"{who}: {what}"

    def queued(kind: str) -> float:
        return share * row.get(f"counter.{who} {kind}", 0)

    if what == "stream triangles":
        # The camera writes words; a light reads rays. Queued work is written.
        own = pixels * WORD if who == "camera" else rays * POINT
        tests = pixels if who == "camera" else rays
        return Work(share * (mesh + own) + queued("items") * ITEM, share * tests, stage=stage)
    stages = {
        "clear": Work(pixels * WORD),
        "resolve": Work(pixels * (WORD + ANSWER + HIT)),
        "aim": Work(0.0),
        "map rays": Work(pixels * (HIT + 4 + PLACE + POINT + 1)),
        "count and scan": Work(pixels * (PLACE + SLOT), 0.0, 2),
        "scatter rays": Work(pixels * SLOT + rays * 2 * POINT),
        "split large": Work(queued("items") * (2 * ITEM + LINES), stage=stage),
        "queued rows": Work(queued("items") * (ITEM + RECORD), stage=stage),
        "further parts": Work(queued("parts") * (PAIR + ITEM + RECORD), stage=stage),
        "doubtful pairs": Work(queued("doubtful pairs") * PAIR, stage=stage),
    }
    return stages.get(what)
