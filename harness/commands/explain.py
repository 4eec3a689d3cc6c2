"""``shadowbench explain``: the answer of every method, of the reference and of exact arithmetic at one pixel."""

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import UserError
from ..frame.devices import find_device
from ..judge.arithmetic import edge_bound
from ..judge.classify import json_number
from ..judge.context import Judge
from ..judge.distances import edge_distance
from ..judge.receivers import not_receivers
from ..judge.score import Judgement, judge_frame, judge_rays
from ..judge.verdict import ERRORS, Verdict
from ..report.terminal import make_table, plain_console, print_legend, print_lines, tell
from ..runner.machine.lock import MACHINE
from ..runner.planning.experiment import parse_size
from ..scene.chosen_view import ChosenView
from ..scene.prepared import prepare
from .answering import answer, entries_of, require_frame
from .options import command


@command(
    """
    Show every answer at one pixel, and the exact one.
    shadowbench explain cloth --pixel 120,80

    scene        Name of a scene, or a mesh file.
    --pixel X,Y  Column and row of the pixel, counted from 0: X,Y.
    """
)
def explain(
    scene: str, pixel: str, method: list[str] | None = None, device: str | None = None, size: str = "256x256",
    frame: int = 0, setting: list[str] | None = None, scene_dir: Path | None = None, as_json: bool = False, *,
    view: ChosenView,
) -> int:  # fmt: skip
    """Show the answer of every method at one pixel with its class, the answer of the reference, and the exact answer.

    The classes are those that `verify --every-pixel` counts. Distances to edges are in units of the error bound of a
    float32 triangle test: below 1, a wrong answer is excused. Exit code 1 if an answer is wrong and not excused, and
    the method does not declare itself inexact.
    """
    width, height = parse_size(size)
    match = re.fullmatch(r"\s*(\d+)\s*,\s*(\d+)\s*", pixel)
    if not match or int(match[1]) >= width or int(match[2]) >= height:
        raise UserError(f"--pixel {pixel!r}: write it as X,Y with 0 <= X < {width} and 0 <= Y < {height}")
    x, y = int(match[1]), int(match[2])
    place = find_device(device)
    entries = entries_of(method, setting)
    described = view.resolved(scene, scene_dir)
    MACHINE.share_beside(place)
    prepared = prepare(described)
    require_frame(prepared, frame, scene)
    moment = prepared.moment(frame, width, height)
    # A frame of only that pixel: it has the same ray and is judged like any other frame.
    alone = replace(moment, column=moment.column[[x]], row=moment.row[[y]])
    judge = Judge.of(prepared, alone, device=place)
    of_reference = judge_rays(judge, judge.checked_reference.answers)
    facts: dict[str, Any] = {
        "scene": scene, "stand_in": prepared.scene.stand_in, "pixel": [x, y], "frame": frame,
        "exact": exact_facts(of_reference),
        "answers": [{"method": "reference", "status": "ok", "reason": "", "known_inexact": None, **_row(of_reference)}],
        "bounces": [{"bounce": bounce, "answers": []} for bounce in range(1, judge.effects.bounces + 1)],
    }  # fmt: skip
    for entry in entries:
        outcome = answer(entry.method, dict(entry.settings), prepared, moment, place)
        row = outcome.facts("method", "status", "reason", "known_inexact")
        if outcome.answers is None:
            facts["answers"].append({**row, "wrong": outcome.status == "failed"})
            continue
        primary, *mirrored = judge_frame(judge, answers_at(outcome.answers, y * width + x))
        facts["answers"].append({**row, **_row(primary)})
        for shown, found in zip(facts["bounces"], mirrored, strict=True):
            if outcome.answers["bounce_active"][shown["bounce"] - 1][y * width + x] == 1 or _row(found)["wrong"]:
                shown["answers"].append({**row, **_row(found), "exact": exact_facts(found)})
    tell(facts, as_json, _print)
    rows = facts["answers"][1:] + [row for shown in facts["bounces"] for row in shown["answers"]]
    return 1 if any(row["wrong"] and not row["known_inexact"] for row in rows) else 0


def answers_at(answers: dict[str, NDArray], index: int) -> dict[str, NDArray]:
    """The answers at one pixel of a frame, as the answers to a frame of only that pixel."""
    vectors = ("bounce_origin", "bounce_direction")
    return {
        name: values[..., [index], :] if name in vectors else values[..., [index]] for name, values in answers.items()
    }


def exact_facts(found: Judgement) -> dict[str, Any]:
    """The exact answer at a judged pixel: tied triangles, t, distance to an edge in bounds, each shadow bit."""
    judge, hits = found.judge, found.exact.hits
    referee, ratio = judge.referee, hits.ratio[0]
    if ratio is None:
        return {"triangle": -1, "ties": [], "t": None, "shadows": []}
    nearest, _, bound = referee.ray_to(
        hits.origins.astype(np.float64), hits.directions.astype(np.float64), hits.triangle, edges_only=True
    )
    point = hits.points
    outside, _ = not_receivers(judge.prepared, judge.moment, hits.triangle)
    shadows = []
    for i in np.nonzero(judge.wanted)[0].tolist():
        entry: dict[str, Any] = {"light": i, "bit": 0, "occluder": -1, "shadow_ray": not outside[i, 0]}
        occluder = found.exact.occluders[i]
        if entry["shadow_ray"] and occluder[0] >= 0:
            corners = referee.corners(occluder)
            away, _ = edge_distance(point, judge.moment.lights[i][None].astype(np.float64), corners)
            entry |= {"bit": 1, "occluder": int(occluder[0])}
            entry["edge_in_bounds"] = float(away[0] / edge_bound(point, corners)[0])
        shadows.append({**entry, "shadow_ray": bool(entry["shadow_ray"])})
    return {
        "triangle": int(hits.triangle[0]), "ties": list(hits.ties[0]), "t": float(hits.t[0]),
        "t_ratio": [str(ratio[0]), str(ratio[1])], "point": point[0].tolist(),
        "edge_in_bounds": float(nearest[0] / bound[0]), "shadows": shadows,
    }  # fmt: skip


def _row(found: Judgement) -> dict[str, Any]:
    """The answer at a judged pixel, and the class of each of its parts as the score counts them."""
    answers, classes = found.checked.answers, found.classes
    primary = Verdict(int(classes.primary[0]))
    shadow = [None if kind < 0 else Verdict(kind) for kind in classes.shadow[:, 0].tolist()]
    return {
        "triangle": int(answers["triangle"][0]),
        **{part: json_number(answers[part][0]) for part in ("t", "u", "v")},
        "shadows": answers["shadowed"][:, 0].tolist(),
        "class": primary.key,
        "shadow_classes": [None if kind is None else kind.key for kind in shadow],
        "wrong": any(kind in ERRORS for kind in (primary, *shadow)),
    }


def _print(facts: dict[str, Any]) -> None:
    exact = facts["exact"]
    x, y = facts["pixel"]
    stand_in = " (stand-in)" if facts["stand_in"] else ""
    lines = [f"{facts['scene']}{stand_in}, frame {facts['frame']}, pixel {x},{y}"]
    if exact["triangle"] < 0:
        lines.append("exact: a miss")
    else:
        ties = ", ".join(map(str, exact["ties"]))
        lines.append(f"exact: triangle {exact['triangle']} (tie set: {ties}), t = {exact['t']!r}")
        lines.append(f"its nearest edge: {exact['edge_in_bounds']:.3g} bounds from the ray")
        for light in exact["shadows"]:
            lead = f"light {light['light']}: "
            if light["bit"]:
                where = f"its nearest edge is {light['edge_in_bounds']:.3g} bounds from the shadow ray"
                lines.append(f"{lead}shadowed, by triangle {light['occluder']}; {where}")
            elif light["shadow_ray"]:
                lines.append(f"{lead}lit")
            else:
                lines.append(f"{lead}no shadow ray: outside the spotlight, or facing away")
    print_lines(*lines)
    _print_rows(facts["answers"])
    for shown in facts["bounces"]:
        if shown["answers"]:
            print_lines(f"bounce {shown['bounce']}, each method's own ray:")
            _print_rows(shown["answers"])
    rows = facts["answers"] + [row for shown in facts["bounces"] for row in shown["answers"]]
    named = {kind for row in rows for kind in (row.get("class"), *row.get("shadow_classes", ()))}
    legend = "class: of triangle, t, u and v; shadows: each light's bit and its class"
    print_legend((kind for kind in Verdict if kind.key in named), legend)


def _print_rows(rows: list[dict[str, Any]]) -> None:
    """The answers, one row per method, then the reason of each method without an answer. Where each method has a ray
    of its own, the row also holds the exact triangle for that ray.
    """
    bounced = any("exact" in row for row in rows)
    table = make_table("method", "triangle", "t", "u", "v", "class", "shadows", *["exact"] * bounced)
    for row in (one for one in rows if "class" in one):
        shadows = [
            f"{bit} {kind or ''}".strip() for bit, kind in zip(row["shadows"], row["shadow_classes"], strict=True)
        ]
        numbers = [f"{row[part]:.9g}" if isinstance(row[part], float) else row[part] for part in ("t", "u", "v")]
        exact = [str(row["exact"]["triangle"])] if bounced else []
        table.add_row(row["method"], str(row["triangle"]), *numbers, row["class"], ", ".join(shadows), *exact)
    plain_console().print(table)
    for row in rows:
        if "class" not in row:
            print_lines(f"{row['method']}: {row['status']}: {row['reason']}")
