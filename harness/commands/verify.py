"""``shadowbench verify`` and ``score``: compare every answer with Embree and the exact referee.

The functions declare their own command-line options and return an exit code. They import what they need when called,
so that ``--help`` is fast.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import UserError, say, warn
from ..runner.machine.lock import MACHINE
from ..typed_json import to_json
from .answering import answer
from .options import checked_limit, command
from .verify_tables import print_reports, print_scores

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ..scene.chosen_view import ChosenView


@command(
    """
    Compare every answer of every method with the reference.
    shadowbench verify cloth bunny.ply --method warp_bvh --json

    scene          Names of scenes, or mesh files.
    --every-pixel  Decide every pixel exactly, not only those where two answers differ.
    """
)
def verify(
    scene: list[str], method: list[str] | None = None, setting: list[str] | None = None, device: str | None = None,
    size: str = "256x256", frame: int = 0, everything: bool = False, memory_limit: int | None = None,
    scene_dir: Path | None = None, as_json: bool = False, *, view: ChosenView,
) -> int:  # fmt: skip
    """Compare every answer of every method with Embree. Where any two differ, exact arithmetic decides the pixel.

    Each frame is repeated up to 16 times, and a method whose answers change has failed.
    Exit code 1 if a method has a true error, fails, or has more than 0.1 % of its pixels excused. A method that
    declares itself inexact is reported and does not change the exit code.
    """
    from ..frame.devices import find_device
    from ..frame.registry import method_names
    from ..runner.measuring.memory import NOT_STOPPED, stops_allocations
    from ..runner.planning.experiment import Entry, parse_size
    from ..runner.planning.planned_point import parse_settings

    place = find_device(device)
    width, height = parse_size(size)
    names = list(dict.fromkeys(method or method_names()))
    entries = parse_settings(setting or [], tuple(Entry(name) for name in names))
    scenes = [view.resolved(name, scene_dir) for name in scene]
    limit = checked_limit(memory_limit)
    if limit is not None and not stops_allocations():
        warn(NOT_STOPPED)
    MACHINE.share_beside(place)
    reports = []
    for name, described in zip(scene, scenes, strict=True):
        reports.append(
            _verify_scene(
                name, described, entries, place, width, height, frame, everything, as_json, limit, view.text()
            )
        )
    passed = all(not row["counts_against"] for report in reports for row in report["methods"])
    if as_json:
        facts = {"size": [width, height], "frame": frame, "device": place, "passed": passed}
        print(json.dumps(to_json({**facts, "scenes": reports}), indent=1))
    else:
        print_reports(reports)
    return 0 if passed else 1


def _verify_scene(
    name: str,
    described: Any,
    entries: Sequence[Any],
    device: str,
    width: int,
    height: int,
    frame: int,
    everything: bool,
    quiet: bool,
    memory_limit: int | None,
    view: str,
) -> dict[str, Any]:
    from ..judge.context import Judge
    from ..judge.score import Scored, score_answers
    from ..judge.shared_errors import share_errors
    from ..scene.facts import few_hits, never_hit
    from ..scene.prepared import prepare

    prepared = prepare(described)
    if not 0 <= frame < prepared.frame_count:
        raise UserError(f"--frame {frame}: {name} has frames 0 to {prepared.frame_count - 1}")
    moment = prepared.moment(frame, width, height)
    judge = Judge.of(prepared, moment, device=device)
    if everything:
        judge = judge.with_random_pixels(judge.pixel_count)
    rows: list[dict[str, Any]] = []
    scored: list[Scored] = []
    for entry in entries:
        if not quiet and sys.stderr.isatty():
            say(f"{name}: {entry.method} ...")
        outcome = answer(entry.method, dict(entry.settings), prepared, moment, device, memory_limit)
        row: dict[str, Any] = {
            "method": entry.method,
            "settings": dict(entry.settings),
            "device": outcome.device,
            "status": outcome.status,
            "reason": outcome.reason,
            "known_inexact": outcome.known_inexact,
            "score": None,
        }
        if outcome.answers is not None:
            scored.append(score_answers(judge, outcome.answers))
            row["score"] = scored[-1].score
        rows.append(row)
    shared = iter(share_errors([(one.score, one.disputes) for one in scored]))
    for row in rows:
        row["score"] = next(shared) if row["score"] else None
        wrong = row["score"] is not None and not row["score"].passed
        row["counts_against"] = row["status"] == "failed" or (wrong and not row["known_inexact"])
    hits = int((judge.checked_reference.answers["triangle"] >= 0).sum())
    valid = int(moment.valid.sum())
    # Without a triangle that can be hit there is nothing else to say.
    warnings = [never_hit(prepared.triangle_count, valid), few_hits(hits, judge.pixel_count) if valid else ""]
    return {
        "scene": name,
        "title": described.title,
        "stand_in": described.stand_in,
        "triangles": prepared.triangle_count,
        "valid_triangles": valid,
        "hits": hits,
        "view": view,
        "warning": "; ".join(filter(None, warnings)),
        "sha256": prepared.sha256(frame),
        "methods": rows,
    }


@command(
    """
    Score answers that a run saved without a score.
    shadowbench score results/local/table1-quick

    folder   A results folder with saved answers.
    --again  Also score answers that already have a score.
    """
)
def score(folder: Path, again: bool = False, scene_dir: Path | None = None, as_json: bool = False) -> int:
    """Score the answers that a run saved without a score, and write the scores into the records.

    Exit code 1 if answers cannot be scored, or if a method that does not declare itself inexact has true errors.
    """
    from ..files import write_atomic
    from ..frame.warp_init import start_warp
    from ..results.folder import require_plain

    start_warp()
    files = sorted(path for path in folder.glob("**/*.npz") if path.parent.name == "answers")
    files = [path for path in files if not path.name.startswith(("mesh-", "."))]
    if not files:
        raise UserError(
            f"{folder}: no saved answers in it; name a folder with files answers/*.npz, as `run --save-answers` writes them"
        )
    MACHINE.share_beside("cpu")
    for place in {path.parent.parent for path in files}:
        require_plain(place)
    rows = []
    for path in files:
        row = _score_file(path, folder, again, scene_dir)
        if row.pop("changed"):
            write_atomic(row["record_path"], row["record"].to_json())
        rows.append(row)
    _share_errors(rows, {path.parent.parent for path in files})
    for row in rows:
        inexact = _known_inexact(row)
        row["counts_against"] = row["score"] is None or not (row["score"].passed or inexact)
        row["record_path"] = str(row["record_path"] or "")
        row.pop("record")
    passed = all(not row["counts_against"] for row in rows)
    if as_json:
        print(json.dumps(to_json({"passed": passed, "answers": rows}), indent=1))
    else:
        print_scores(rows)
    return 0 if passed else 1


def _score_file(path: Path, folder: Path, again: bool, scene_dir: Path | None) -> dict[str, Any]:
    """Score one file of saved answers, and write the score into its record, if there is one."""
    from ..judge.answer_files import read_facts, score_raw
    from ..results.disputes import write_disputes
    from ..results.record import Frame as RecordFrame
    from ..results.schema import read_record

    row: dict[str, Any] = {
        "answers": str(path),
        "scene": "",
        "method": "",
        "frame": None,
        "status": "scored",
        "reason": "",
        "score": None,
        "changed": False,
        "record": None,
        "record_path": None,
    }
    try:
        facts = read_facts(path)
        row["scene"], row["frame"] = facts["scene"], facts["frame"]
        record_path = path.parent.parent / "records" / f"{facts['extra'].get('key', '')}.json"
        frame: RecordFrame | None = None
        if record_path.is_file():
            record = read_record(record_path)
            if record.key != facts["extra"]["key"]:  # a file of answers may name any
                raise UserError(f"{record_path}: the record of other answers; remove them, or it")
            row["record"], row["record_path"] = record, record_path
            row["method"] = record.method["name"]
            frame = next((f for f in record.frames if f.frame == facts["frame"]), None)
        if frame and frame.score and not again:
            row["status"], row["score"] = "had a score", frame.score
        else:
            scored = score_raw(path, scene_dir, folder / "truth")
            row["score"] = scored.score
            if frame:
                frame.score, frame.unscored, row["changed"] = scored.score, None, True
                write_disputes(path.parent.parent, record.key, frame.frame, scored.disputes)
    except UserError as error:
        row["status"], row["reason"] = "not scored", str(error)
    return row


def _share_errors(rows: list[dict[str, Any]], folders: set[Path]) -> None:
    """Add the errors that an answer shares with the reference to the scores of each folder and of these rows."""
    from ..results.disputes import charge_folder

    for folder in sorted(folders):
        changed = charge_folder(folder)
        for row in rows:
            if row["record"] is not None and row["record_path"].parent.parent == folder:
                own = changed.get(row["record"].key)
                frames = own.frames if own else ()
                charged = (f.score for f in frames if f.frame == row["frame"])
                row["score"] = next(charged, row["score"])


def _known_inexact(row: dict[str, Any]) -> str | None:
    """Why the method of a record declares itself inexact under its settings; None if it does not."""
    from ..frame.registry import make_method

    if row["record"] is None:
        return None
    try:
        method = make_method(row["method"], row["record"].method.get("settings"))
    except (UserError, ImportError):
        return None  # the method is not installed here; its answers are judged like any others
    return getattr(method, "known_inexact", None)
