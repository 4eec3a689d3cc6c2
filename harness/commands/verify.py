"""``shadowbench verify`` and ``score``: compare every answer with Embree and the exact referee, in tables of 80 columns."""

import sys
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ..errors import UserError, say, warn
from ..files import write_atomic
from ..frame.devices import find_device, start_warp
from ..frame.registry import make_method
from ..judge.answer_files import read_facts, score_raw
from ..judge.context import Judge
from ..judge.score import score_answers
from ..judge.shared_errors import share_errors
from ..judge.verdict import EXCUSED_LIMIT, ReferenceErrors, Score, Verdict, total
from ..report.terminal import make_table, plain_console, print_legend, print_lines, tell
from ..results.disputes import charge_folder, write_disputes
from ..results.folder import require_plain
from ..results.record import Record
from ..results.schema import read_record
from ..runner.machine.lock import MACHINE
from ..runner.measuring.memory import NOT_STOPPED, stops_allocations
from ..runner.planning.experiment import Entry, parse_size
from ..scene.chosen_view import ChosenView
from ..scene.facts import few_hits, never_hit, triangles
from ..scene.prepared import prepare
from ..typed_json import to_json
from .answering import answer, entries_of, require_frame
from .options import checked_limit, command

COLUMNS = ("differ", "tie", "near\ntie", "edge", "true", "acne", "leak", "t error", "exc.\n%", "check")

SHOWN = (Verdict.TIE, Verdict.NEAR_TIE, Verdict.EDGE, Verdict.TRUE, Verdict.ACNE, Verdict.LEAK)
LEGEND = (
    "differ: hits and shadow bits that differ from the reference; t error: the largest relative error of t",
    f"check: ok if there is no true error, acne or leak, and at most {EXCUSED_LIMIT:.1%} of the pixels are excused (exc. %)",
)


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
    place = find_device(device)
    width, height = parse_size(size)
    entries = entries_of(method, setting)
    scenes = [view.resolved(name, scene_dir) for name in scene]
    limit = checked_limit(memory_limit)
    if limit is not None and not stops_allocations():
        warn(NOT_STOPPED)
    MACHINE.share_beside(place)
    reports = []
    for name, described in zip(scene, scenes, strict=True):
        prepared = prepare(described)
        require_frame(prepared, frame, name)
        judge = Judge.of(prepared, prepared.moment(frame, width, height), device=place)
        if everything:
            judge = judge.with_random_pixels(judge.pixel_count)
        shown = name if not as_json and sys.stderr.isatty() else ""
        reports.append(_report(name, view, judge, _verified(judge, entries, place, limit, shown)))
    passed = all(not row["counts_against"] for report in reports for row in report["methods"])
    facts = {"size": [width, height], "frame": frame, "device": place, "passed": passed, "scenes": reports}
    tell(to_json(facts) if as_json else reports, as_json, print_reports)
    return 0 if passed else 1


def _verified(
    judge: Judge, entries: Sequence[Entry], device: str, memory_limit: int | None, progress: str
) -> list[dict[str, Any]]:
    """A row for each method: its outcome and its score, with the errors that it shares with the reference."""
    rows: list[dict[str, Any]] = []
    scored = []
    for entry in entries:
        if progress:
            say(f"{progress}: {entry.method} ...")
        outcome = answer(entry.method, dict(entry.settings), judge.prepared, judge.moment, device, memory_limit)
        row = outcome.facts("method", "settings", "device", "status", "reason", "known_inexact")
        rows.append({**row, "score": None})
        if outcome.answers is not None:
            scored.append((rows[-1], score_answers(judge, outcome.answers)))
    shared = share_errors([(one.score, one.disputes) for _, one in scored])
    for (row, _), score in zip(scored, shared, strict=True):
        row["score"] = score
    for row in rows:
        wrong = row["score"] is not None and not row["score"].passed
        row["counts_against"] = row["status"] == "failed" or (wrong and not row["known_inexact"])
    return rows


def _report(name: str, view: ChosenView, judge: Judge, rows: list[dict[str, Any]]) -> dict[str, Any]:
    """The facts of a scene and its methods."""
    prepared, moment = judge.prepared, judge.moment
    hits = int((judge.checked_reference.answers["triangle"] >= 0).sum())
    valid = int(moment.valid.sum())
    # Without a triangle that can be hit there is nothing else to say.
    notices = [never_hit(prepared.triangle_count, valid), few_hits(hits, judge.pixel_count) if valid else None]
    return {
        "scene": name, "title": prepared.scene.title, "stand_in": prepared.scene.stand_in,
        "triangles": prepared.triangle_count, "valid_triangles": valid, "hits": hits, "view": view.text(),
        "warning": "; ".join(str(notice) for notice in notices if notice), "sha256": prepared.sha256(moment.index),
        "methods": rows,
    }  # fmt: skip


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
    start_warp()
    files = sorted(path for path in folder.glob("**/*.npz") if path.parent.name == "answers")
    files = [path for path in files if not path.name.startswith(("mesh-", "."))]
    if not files:
        raise UserError(
            f"{folder}: no saved answers in it; name a folder with files answers/*.npz, as `run --save-answers` writes them"
        )
    MACHINE.share_beside("cpu")
    places = [path.parent.parent for path in files]
    for place in set(places):
        require_plain(place)
    found = [_score_file(path, folder, again, scene_dir) for path in files]
    for place in sorted(set(places)):
        changed = charge_folder(place)
        for (row, record), own in zip(found, places, strict=True):
            if own == place and record is not None and record.key in changed:
                frame = changed[record.key].frame(row["frame"])
                row["score"] = frame.score if frame else row["score"]
    for row, record in found:
        row["counts_against"] = row["score"] is None or not (row["score"].passed or _known_inexact(record))
    rows = [row for row, _ in found]
    passed = all(not row["counts_against"] for row in rows)
    tell(to_json({"passed": passed, "answers": rows}) if as_json else rows, as_json, print_scores)
    return 0 if passed else 1


def _score_file(path: Path, folder: Path, again: bool, scene_dir: Path | None) -> tuple[dict[str, Any], Record | None]:
    """Score one file of saved answers, and write the score into its record, if there is one: a row, and the record."""
    row: dict[str, Any] = {
        "answers": str(path), "scene": "", "method": "", "frame": None, "status": "scored", "reason": "", "score": None,
        "record_path": "",
    }  # fmt: skip
    record = frame = None
    try:
        facts = read_facts(path)
        row |= {"scene": facts["scene"], "frame": facts["frame"]}
        record_path = path.parent.parent / "records" / f"{facts['extra'].get('key', '')}.json"
        if record_path.is_file():
            known = read_record(record_path)
            if known.key != facts["extra"]["key"]:  # a file of answers may name any
                raise UserError(f"{record_path}: the record of other answers; remove them, or it")
            record = known
            row |= {"record_path": str(record_path), "method": record.method["name"]}
            frame = record.frame(facts["frame"])
        if frame and frame.score and not again:
            return {**row, "status": "had a score", "score": frame.score}, record
        scored = score_raw(path, scene_dir, folder / "truth")
        row["score"] = scored.score
        if record and frame:
            frame.score, frame.unscored = scored.score, None
            write_disputes(path.parent.parent, record.key, frame.frame, scored.disputes)
            write_atomic(record_path, record.to_json())
    except UserError as error:
        row |= {"status": "not scored", "reason": str(error)}
    return row, record


def _known_inexact(record: Record | None) -> str | None:
    """Why the method of a record declares itself inexact under its settings; None if it does not."""
    if record is None:
        return None
    try:
        method = make_method(record.method["name"], record.method.get("settings"))
    except (UserError, ImportError):
        return None  # the method is not installed here; its answers are judged like any others
    return getattr(method, "known_inexact", None)


def print_reports(reports: list[dict[str, Any]]) -> None:
    """Print the result of ``verify``, one table per scene."""
    notes: list[str] = []
    for report in reports:
        scene = Path(report["scene"]).name + (" (stand-in)" if report["stand_in"] else "")
        table = make_table("method", numbers=COLUMNS)
        for row in report["methods"]:
            table.add_row(row["method"], *_cells(row["score"], row["status"], row["known_inexact"]))
            if row["score"] is None:
                notes.append(f"{row['method']} on {scene}: {row['status']}: {row['reason']}")
            elif row["known_inexact"] and not row["score"].passed:
                notes.append(f"* {row['method']} declares itself inexact: {row['known_inexact']}")
        if report["warning"]:
            notes.append(f"{scene}: {report['warning']}")
        most = max(
            (row["score"] for row in report["methods"] if row["score"]),
            key=lambda score: score.primary.judged,
            default=None,
        )
        if most is not None and most.reference_errors:
            table.add_row("reference", "", *_counts(most.reference_errors), "", "", "")
            notes.append(
                f"reference on {scene}: wrong answers of Embree among {most.primary.judged:,} pixels decided exactly"
            )
        facts = [scene, triangles(report["triangles"]), *filter(None, [report["view"]])]
        print_lines(", ".join(facts))
        plain_console().print(table)
    print_lines(*dict.fromkeys(notes))
    print_legend(SHOWN, *LEGEND)


def print_scores(rows: list[dict[str, Any]]) -> None:
    """Print the result of ``score``: one table per scene, one row per file of answers."""
    for scene in dict.fromkeys(row["scene"] for row in rows):
        table = make_table("method", numbers=COLUMNS)
        for row in (one for one in rows if one["scene"] == scene):
            label = row["method"] if row["frame"] is None else f"{row['method']} frame {row['frame']}"
            table.add_row(label.strip(), *_cells(row["score"], row["status"]))
        print_lines(scene)
        plain_console().print(table)
    statuses = Counter(row["status"] for row in rows)
    counted = ", ".join(f"{count} {status}" for status, count in statuses.items())
    print_lines(counted, *(row["reason"] for row in rows if row["reason"]))
    print_legend(SHOWN, *LEGEND)


def _cells(score: Score | None, status: str, known_inexact: str | None = None) -> list[str]:
    """The columns of a score; without a score, only the status."""
    if score is None:
        return [""] * (len(COLUMNS) - 1) + [status]
    primary = score.primary
    disputed = primary.disputed + sum(light.disputed for light in score.shadow)
    check = score.check + ("*" if known_inexact and not score.passed else "")
    share = f"{100 * score.excused_share:.3f}"
    counts = _counts(score, primary.unjudged)
    return [str(disputed), *counts, f"{primary.t_max_relative_error:.1e}", share, check]


def _counts(found: Score | ReferenceErrors, unjudged: int = 0) -> list[str]:
    """The columns from "tie" to "leak"."""
    excused = [total(found, kind) for kind in (Verdict.TIE, Verdict.NEAR_TIE, Verdict.EDGE)]
    wrong = total(found, Verdict.TRUE) + total(found, Verdict.INVALID) + unjudged
    return [str(count) for count in (*excused, wrong, total(found, Verdict.ACNE), total(found, Verdict.LEAK))]
