"""Errors over how far the light is and how far the scene lies from the origin: where a method stops being right.

Scenes are recentred before anyone sees them, which hides what an offset does. Here it is put back on purpose, alike
for every method and for the judge: all of them get the same rounded triangles, so what is counted is what the
arithmetic gets wrong and not what the rounding of the input moved. Nothing is timed.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ..harness.frame.devices import device_for
from ..harness.frame.registry import make_method
from ..harness.frame.session import Session
from ..harness.judge.score import Judge
from ..harness.runner.experiment import Entry
from ..harness.runner.machine_lock import MACHINE
from ..harness.scene.overrides import Lighting
from ..harness.scene.prepared import Prepared, rounded, weld

DIRECTION = np.array([0.48, 0.6, 0.64])
"""Of the offset: no axis, so that no coordinate stays small. Unit length."""


def offset_by(prepared: Prepared, radii: float) -> Prepared:
    """The prepared scene with everything, eye and lights too, moved from where it was by so many of its radii."""
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
    """One row an entry, light distance and offset (both in scene radii): counts of each class, or why there are none.

    The light stands in its own direction from the scene's middle. ``size``: pixels along a side.
    """
    for offset in offsets:
        moved = offset_by(prepared, offset)
        for distance in distances:
            lit = Lighting(label=f"{distance:g}", distance=distance).applied(moved)
            moment = lit.moment(0, size, size)
            judge = Judge(lit, moment, device=device)
            for entry in entries:
                MACHINE.give_way()
                row: dict[str, Any] = {"scene": lit.scene.name, "label": entry.label, "method": entry.method}
                row |= {"distance": distance, "offset": offset, "size": size}
                try:
                    method = make_method(entry.method, dict(entry.settings))
                except ImportError as error:  # a peer's library that is not installed costs its own rows only
                    yield {**row, "status": f"skipped: {error.name or error} is not installed"}
                    continue
                place = device_for(type(method), device)
                reason = method.applies(lit.scene, place)
                if reason:
                    yield {**row, "status": f"skipped: {reason}"}
                    continue
                session = Session(method, lit, size, size, place)
                score = judge.score(session.answers(moment))
                yield {**row, "status": "ok", **counts(score)}


def counts(score: dict[str, Any]) -> dict[str, int]:
    """What is wrong in a score: wrong primary answers, acne, leaks, excused edges, and pixels with a shadow bit."""
    primary, shadow = score["primary"], score["shadow"]
    return {
        "wrong": int(score["true_errors"]),
        "primary_wrong": int(primary["true"] + primary["invalid"]),
        "acne": sum(int(light["acne"]) for light in shadow),
        "leak": sum(int(light["leak"]) for light in shadow),
        "excused": int(primary["near_tie"] + primary["edge"]) + sum(int(light["edge"]) for light in shadow),
        "scored": sum(int(light["scored"]) for light in shadow),
        "pixels": int(primary["pixels"]),
    }
