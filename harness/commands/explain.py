"""``shadowbench explain``: one pixel; every method's answer, Embree's and the exact one."""

from __future__ import annotations

import json
import re
import sys
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..errors import UserError
from .options import Device, Frame, Json, Methods, SceneDir, Settings

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..judge.referee import Hits
    from ..judge.score import Judge
    from ..scene.moment import Moment


def explain(
    scene: Annotated[str, typer.Argument(help="A scene's name or a mesh file.")],
    pixel: Annotated[str, typer.Option("--pixel", help="Column and row of the pixel, from 0: X,Y.")],
    method: Methods = None,
    device: Device = None,
    size: Annotated[str, typer.Option("--size", help="Image size that the pixel belongs to.")] = "256x256",
    frame: Frame = 0,
    setting: Settings = None,
    scene_dir: SceneDir = None,
    as_json: Json = False,
) -> int:
    """Show one pixel: every method's answer, Embree's, and the exact one with its tie set and its nearest edge.

    Distances are given in units of the bound that excuses: below 1, a float32 triangle test may be wrong there.
    Exit code 1 where a method that does not declare itself inexact is wrong beyond that.
    """
    from ..frame.devices import find_device
    from ..frame.registry import method_names
    from ..judge.score import Judge
    from ..runner.experiment import Entry, parse_size
    from ..runner.machine_lock import MACHINE
    from ..runner.points import parse_settings
    from ..scene.catalogue import resolve
    from ..scene.prepared import prepare
    from .answering import answer

    width, height = parse_size(size)
    match = re.fullmatch(r"\s*(\d+)\s*,\s*(\d+)\s*", pixel)
    if not match or int(match[1]) >= width or int(match[2]) >= height:
        raise UserError(f"--pixel {pixel!r}: write it as X,Y with 0 <= X < {width} and 0 <= Y < {height}")
    index = int(match[2]) * width + int(match[1])
    place = find_device(device)
    names = tuple(Entry(name) for name in dict.fromkeys(method or method_names()))
    entries = parse_settings(setting or [], names)
    described = resolve(scene, scene_dir)
    MACHINE.share()
    prepared = prepare(described)
    if not 0 <= frame < prepared.frame_count:
        raise UserError(f"--frame {frame}: {scene} has frames 0 to {prepared.frame_count - 1}")
    moment = prepared.moment(frame, width, height)
    judge = Judge(prepared, moment, device=place)
    facts: dict[str, Any] = {
        "scene": scene,
        "stand_in": prepared.scene.stand_in,
        "pixel": [int(match[1]), int(match[2])],
        "frame": frame,
    }
    facts["exact"] = exact_facts(judge, moment, index)
    rows: list[tuple[Any, ...]] = [("reference", "ok", "", judge.reference.answers(), None)]
    for entry in entries:
        found = answer(entry.method, dict(entry.settings), prepared, moment, place)
        rows.append((entry.method, found.status, found.reason, found.answers, found.known_inexact))
    facts["answers"] = [_row(judge, moment, index, *row) for row in rows]
    facts["bounces"] = [
        {"bounce": bounce, "answers": _bounced(judge, moment, index, rows, bounce)}
        for bounce in range(1, judge.effects.bounces + 1)
    ]
    if as_json:
        print(json.dumps(facts, indent=1))
    else:
        _print(facts)
    rows_shown = facts["answers"][1:] + [row for found in facts["bounces"] for row in found["answers"]]
    return 1 if any(row["wrong"] and not row["known_inexact"] for row in rows_shown) else 0


def exact_hit(judge: Judge, moment: Moment, index: int) -> Hits:
    """The exact closest hit of a pixel's ray: of the moment's primary one, or of its mirrored one."""
    import numpy as np

    pixels = np.array([index])
    return judge.referee.closest(moment.origins(pixels), moment.directions(pixels))


def exact_facts(judge: Judge, moment: Moment, index: int) -> dict[str, Any]:
    """The exact answer at a pixel: tie set, t, the nearest edge in units of the bound, and each shadow."""
    import numpy as np

    from ..judge import arithmetic as exact

    referee = judge.referee
    hits = exact_hit(judge, moment, index)
    ratio = hits.ratio[0]
    if ratio is None:
        return {"triangle": -1, "ties": [], "t": None, "shadows": []}
    nearest, _, bound = referee.ray_to(
        hits.origins.astype(np.float64), hits.directions.astype(np.float64), hits.triangle, edges_only=True
    )
    point = referee.hit_points(hits)
    shadows = []
    for i, light in enumerate(moment.lights):
        if i < len(judge.effects.shadows) and judge.effects.shadows[i]:
            occluder = referee.occluders(hits, light)
            entry: dict[str, Any] = {"light": i, "bit": int(occluder[0] >= 0), "occluder": int(occluder[0])}
            if occluder[0] >= 0:
                corners = moment.points[judge.prepared.faces[occluder]].astype(np.float64)
                away, _ = exact.edge_distance(point, light[None].astype(np.float64), corners)
                entry["edge_in_bounds"] = float(away[0] / exact.edge_bound(point, corners)[0])
            shadows.append(entry)
    return {
        "triangle": int(hits.triangle[0]),
        "ties": list(hits.ties[0]),
        "t": float(hits.t[0]),
        "t_ratio": [str(ratio[0]), str(ratio[1])],
        "point": point[0].tolist(),
        "edge_in_bounds": float(nearest[0] / bound[0]),
        "shadows": shadows,
    }


def _bounced(
    judge: Judge, moment: Moment, index: int, rows: list[tuple[Any, ...]], bounce: int
) -> list[dict[str, Any]]:
    """What each method says of the pixel's mirrored ray, beside the exact answer to that very ray.

    A ray is made from what the method itself hit before, so methods that differ there have rays of their own.
    """
    from ..judge.bounces import answers_of, mirrored

    found = []
    for name, status, reason, answers, known_inexact in rows:
        if (
            answers is None
            or "bounce_active" not in answers
            or answers["bounce_active"][bounce - 1][index] != 1
        ):
            continue
        rays = mirrored(judge.prepared, moment, answers, bounce)
        row = _row(judge, rays, index, name, status, reason, answers_of(answers, bounce), known_inexact)
        found.append({**row, "exact": exact_facts(judge, rays, index)})
    return found


def _row(
    judge: Judge,
    moment: Moment,
    index: int,
    name: str,
    status: str,
    reason: str,
    answers: dict[str, NDArray] | None,
    known_inexact: str | None,
) -> dict[str, Any]:
    """One method's answer at the pixel, and the class of each part of it."""

    from ..judge.consistency import check_consistency
    from ..judge.verdict import Verdict

    row: dict[str, Any] = {"method": name, "status": status, "reason": reason, "known_inexact": known_inexact}
    if answers is None:
        return {**row, "wrong": status == "failed"}
    found = check_consistency(
        judge.prepared, moment, {**answers, "visibility": answers["visibility"][: len(moment.lights)]}
    )
    hits = exact_hit(judge, moment, index)
    verdict = Verdict(int(judge.referee.classify_primary(hits, answers["triangle"][[index]])[0]))
    if found.primary_invalid[index]:
        verdict = Verdict.INVALID
    elif found.t_wrong[index] or found.uv_wrong[index]:
        verdict = Verdict.TRUE
    bits: list[int] = []
    classes: list[Verdict | None] = []
    for i, light in enumerate(moment.lights):
        bits.append(int(answers["visibility"][i][index]))
        if (
            verdict in (Verdict.OK, Verdict.TIE)
            and i < len(judge.effects.shadows)
            and judge.effects.shadows[i]
        ):
            given = answers["visibility"][i][[index]]
            classes.append(Verdict(int(judge.referee.classify_shadow(hits, light, given)[0])))
        else:
            classes.append(None)
    errors = (Verdict.TRUE, Verdict.INVALID, Verdict.ACNE, Verdict.LEAK)
    return {
        **row,
        "triangle": int(answers["triangle"][index]),
        **{part: _number(answers[part][index]) for part in ("t", "u", "v")},
        "shadows": bits,
        "class": verdict.name.lower(),
        "shadow_classes": [None if c is None else c.name.lower() for c in classes],
        "wrong": verdict in errors or any(c in errors for c in classes),
    }


def _number(value: Any) -> float | str:
    number = float(value)
    return number if abs(number) < float("inf") else str(number)


def _print(facts: dict[str, Any]) -> None:
    from rich.console import Console

    console = Console(width=None if sys.stdout.isatty() else 140, highlight=False, markup=False)
    truth = facts["exact"]
    x, y = facts["pixel"]
    stand_in = " (stand-in)" if facts["stand_in"] else ""
    console.print(f"{facts['scene']}{stand_in}, frame {facts['frame']}, pixel {x},{y}")
    if truth["triangle"] < 0:
        console.print("exact: a miss")
    else:
        ties = ", ".join(map(str, truth["ties"]))
        console.print(f"exact: triangle {truth['triangle']} (tie set: {ties}), t = {truth['t']!r}")
        console.print(f"nearest edge of it: {truth['edge_in_bounds']:.3g} bounds from the ray")
        for light in truth["shadows"]:
            if light["bit"]:
                where = f"its nearest edge {light['edge_in_bounds']:.3g} bounds from the shadow ray"
                console.print(f"light {light['light']}: shadowed, by triangle {light['occluder']}; {where}")
            else:
                console.print(f"light {light['light']}: lit")
    console.print(_table(facts["answers"]))
    for found in facts["bounces"]:
        if found["answers"]:
            console.print(f"bounce {found['bounce']}, each method's own ray:")
            console.print(_table(found["answers"]))


def _table(rows: list[dict[str, Any]]) -> Any:
    """Answers, one row a method; the exact triangle too, where each has a ray of its own."""
    from rich.table import Table

    table = Table(box=None, pad_edge=False, header_style="bold")
    bounced = any("exact" in row for row in rows)
    for name in ("method", "triangle", "t", "u", "v", "class", "shadows", *(("exact",) if bounced else ())):
        table.add_column(name)
    for row in rows:
        if "class" not in row:
            table.add_row(row["method"], f"{row['status']}: {row['reason']}")
            continue
        shadows = [
            f"{bit} {kind or ''}".strip()
            for bit, kind in zip(row["shadows"], row["shadow_classes"], strict=True)
        ]
        numbers = [
            f"{row[part]:.9g}" if isinstance(row[part], float) else row[part] for part in ("t", "u", "v")
        ]
        cells = [row["method"], str(row["triangle"]), *numbers, row["class"], ", ".join(shadows)]
        table.add_row(*cells, *((str(row["exact"]["triangle"]),) if bounced else ()))
    return table
