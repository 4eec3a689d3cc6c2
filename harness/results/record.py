"""One JSON file a point, written atomically from a journal of rounds; and reading them back as tidy tables.

A folder of results holds ``records/KEY.json`` (finished points), ``journal/KEY.jsonl`` (points under way),
``environments/ID.json``, ``scenes.json`` and, outside version control, ``truth/`` and ``answers/``. Records keep
every raw sample; statistics are computed here, on reading.
"""

from __future__ import annotations

import hashlib
import json
import lzma
import os
import tempfile
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from .schema import SCHEMA

STATUSES = ("ok", "skipped", "failed", "timeout", "rejected")
"""What may become of a point. Every planned point yields exactly one record with one of these."""

FAILURES = ("failed", "timeout")
"""Those that nothing was decided by: ``--retry`` measures such a point again."""


def canonical(value: Any) -> str:
    """JSON with sorted keys and no spaces, so that equal configurations have equal text."""
    return json.dumps(value, sort_keys=True, separators=(",", ":"), allow_nan=False)


def digest(value: Any) -> str:
    """Sha256 of the canonical JSON of a value."""
    return hashlib.sha256(canonical(value).encode()).hexdigest()


def write_atomic(path: Path, value: Any) -> None:
    """Write JSON so that a reader sees the old file or the whole new one, whatever happens in between."""
    write_text(path, json.dumps(value, indent=1, allow_nan=False) + "\n")


def write_text(path: Path, text: str) -> None:
    """Write a text file as :func:`write_bytes` does."""
    write_bytes(path, text.encode("utf-8"))


def write_bytes(path: Path, content: bytes) -> None:
    """Write a file atomically: a temporary file beside it, on the disk, then put in its place."""
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        os.chmod(temporary, 0o644)
        os.replace(temporary, path)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise


def write_archive(path: Path, records: Iterable[dict[str, Any]]) -> None:
    """Records as one compressed file, by key, as :func:`.results.schema.read_archive` reads it.

    The same records give the same bytes.
    """
    ordered = sorted(records, key=lambda record: str(record["key"]))
    text = "".join(json.dumps(record, allow_nan=False) + "\n" for record in ordered)
    write_bytes(path, lzma.compress(text.encode(), preset=9 | lzma.PRESET_EXTREME))


class Journal:
    """What is known of a point under way: one JSON object a line, on the disk before :meth:`append` returns.

    A line torn by a crash is cut off when the journal is opened again; the lines before it stay.
    """

    def __init__(self, path: Path):
        self.path = path
        self.events: list[dict[str, Any]] = []
        if path.exists():
            self._recover()

    def _recover(self) -> None:
        whole = 0
        for line in self.path.read_bytes().splitlines(keepends=True):
            try:
                event = json.loads(line) if line.endswith(b"\n") else None
            except ValueError:
                event = None
            if not isinstance(event, dict):
                break
            self.events.append(event)
            whole += len(line)
        if whole != self.path.stat().st_size:
            os.truncate(self.path, whole)

    def append(self, event: dict[str, Any]) -> None:
        """Add an event. Raises OSError where it cannot be kept; the journal is then as it was."""
        self.path.parent.mkdir(parents=True, exist_ok=True)
        line = (canonical(event) + "\n").encode()
        before = self.path.stat().st_size if self.path.exists() else 0
        try:
            with open(self.path, "ab") as file:
                file.write(line)
                file.flush()
                os.fsync(file.fileno())
        except OSError:
            if self.path.exists():
                os.truncate(self.path, before)
            raise
        self.events.append(event)

    def rounds(self) -> dict[int, dict[str, Any]]:
        """The rounds that are complete, by number."""
        return {event["round"]: event for event in self.events if event["event"] == "round"}

    def first(self, kind: str) -> dict[str, Any] | None:
        """The first event of a kind, or None."""
        return next((event for event in self.events if event["event"] == kind), None)

    def remove(self) -> None:
        """Forget the journal: its record is written."""
        self.path.unlink(missing_ok=True)


def make_record(
    key: str,
    point: dict[str, Any],
    scene: dict[str, Any],
    method: dict[str, Any],
    environment: str,
    events: Iterable[dict[str, Any]] = (),
    status: str = "ok",
    reason: str = "",
) -> dict[str, Any]:
    """The record of a point from its journal. Rounds are joined in their order; no sample is dropped."""
    if status not in STATUSES:
        raise ValueError(f"status {status!r} is not one of {STATUSES}")
    known = list(events)
    # The first preparation compiled; a later one, after a restart, found the kernels ready.
    prepared: dict[str, Any] = next((e for e in known if e["event"] == "prepared"), {})
    finished: dict[str, Any] = next((e for e in known if e["event"] == "finished"), {})
    rounds = sorted((e for e in known if e["event"] == "round"), key=lambda e: e["round"])
    frames = _join_rounds(rounds)
    for extra in (*prepared.get("frames", ()), *finished.get("frames", ())):
        frames.setdefault(extra["frame"], _empty_frame(extra["frame"])).update(extra)
    stops = sorted({frame["stopped_by"] for event in rounds for frame in event["frames"]})
    return {
        "schema": SCHEMA,
        "key": key,
        "experiment": point.get("experiment", ""),
        "status": status,
        "reason": reason,
        "point": point,
        "scene": scene,
        "method": {
            **method,
            **prepared.get("method", {}),
            **(rounds[-1].get("method", {}) if rounds else {}),
        },
        "environment": environment,
        "compile_s": prepared.get("compile_s"),
        "load_s": scene.get("load_s"),
        "first_frame_s": prepared.get("first_frame_s"),
        "rounds": [
            {k: v for k, v in event.items() if k not in ("event", "frames", "method")} for event in rounds
        ],
        "frames": [frames[index] for index in sorted(frames)],
        "frames_left_out": prepared.get("frames_left_out", []),
        "peak_rss_bytes": max((event["peak_rss_bytes"] or 0 for event in rounds), default=None),
        "baseline_rss_bytes": prepared.get("baseline_rss_bytes"),
        "stopped_by": " and ".join(stops),
    }


def _empty_frame(index: int) -> dict[str, Any]:
    return {
        "frame": index,
        "regrown": 0,
        "total_ms": [],
        "wall_ms": [],
        "round": [],
        "passes": [],
        "stage_round": [],
        "started": [],
        "stopped_by": [],
        "memory_bytes": None,
        "counters": {},
        "score": None,
        "unscored": "not answered",
    }


def _join_rounds(rounds: list[dict[str, Any]]) -> dict[int, dict[str, Any]]:
    frames: dict[int, dict[str, Any]] = {}
    for event in rounds:
        for part in event["frames"]:
            frame = frames.setdefault(part["frame"], _empty_frame(part["frame"]))
            frame["total_ms"] += part["total_ms"]
            frame["wall_ms"] += part["wall_ms"]
            frame["round"] += [event["round"]] * len(part["total_ms"])
            frame["started"].append(part["started"])
            frame["stopped_by"].append(part["stopped_by"])
            frame["regrown"] = max(frame["regrown"], part["regrown"])
            frame["memory_bytes"] = max(frame["memory_bytes"] or 0, part["memory_bytes"])
            frame["memory_source"] = part["memory_source"]
            # Passes are joined by place: a method's pass list is the same in every round of a point.
            if not frame["passes"]:
                frame["passes"] = [{**step, "ms": []} for step in part["passes"]]
            for step, new in zip(frame["passes"], part["passes"], strict=True):
                step["ms"] += new["ms"]
            count = len(part["passes"][0]["ms"]) if part["passes"] else 0
            frame["stage_round"] += [event["round"]] * count
    return frames


def identity(record: dict[str, Any]) -> dict[str, Any]:
    """The columns that say which point a row belongs to."""
    scene, method, point = record["scene"], record["method"], record["point"]
    return {
        "key": record["key"],
        "experiment": record["experiment"],
        "scene": scene["name"],
        "scene_title": scene.get("title") or scene["name"],
        "stand_in": scene.get("stand_in"),
        "triangles": scene.get("triangles"),
        "method": method["name"],
        "method_title": method.get("title") or method["name"],
        "label": method.get("label") or method.get("title") or method["name"],
        "device": method["device"],
        "device_name": method.get("device_name"),
        "width": point["width"],
        "height": point["height"],
        "lights": len(scene.get("lights") or ()),
        "lighting": (scene.get("lighting") or {}).get("label", ""),
        "status": record["status"],
        "reason": record["reason"],
    }


def samples(records: list[dict[str, Any]]):
    """A tidy table of whole frames: one row per point, frame and sample; times in milliseconds."""
    import pandas as pd

    rows = []
    for record in records:
        who = identity(record)
        for frame in record["frames"]:
            triples = zip(frame["round"], frame["total_ms"], frame["wall_ms"], strict=True)
            for i, (number, total, wall) in enumerate(triples):
                rows.append({**who, "frame": frame["frame"], "round": number, "sample": i})
                rows[-1].update(total_ms=total, wall_ms=wall)
    return pd.DataFrame(rows)


def stages(records: list[dict[str, Any]]):
    """A tidy table of passes: one row per point, frame, pass and sample; times in milliseconds."""
    import pandas as pd

    rows = []
    for record in records:
        who = identity(record)
        for frame in record["frames"]:
            for place, step in enumerate(frame["passes"]):
                for i, (number, ms) in enumerate(zip(frame["stage_round"], step["ms"], strict=True)):
                    rows.append({**who, "frame": frame["frame"], "round": number, "sample": i})
                    rows[-1].update(place=place, name=step["name"], part=step["part"], ms=ms)
    return pd.DataFrame(rows)


def summary(records: list[dict[str, Any]]):
    """One row a point: medians, spread, parts, memory, error counts. Times in milliseconds.

    A frame's time is the median of its samples; a point's is the mean over its frames, as an animation's time is
    the sum over its frames. ``iqr_ms`` is the mean interquartile range of repeats of the same frame;
    ``between_ms`` the range of the round's own medians. ``stage_gap`` is (sum of passes - total) / total.
    """
    import pandas as pd

    return pd.DataFrame([summarise(record) for record in records])


def summarise(record: dict[str, Any]) -> dict[str, Any]:
    """The row of :func:`summary` of one record."""
    row = identity(record)
    frames = [frame for frame in record["frames"] if frame["total_ms"]]
    row.update(frames=len(frames), samples=min((len(f["total_ms"]) for f in frames), default=0))
    row.update(
        compile_s=record["compile_s"],
        first_frame_s=record["first_frame_s"],
        built=record["method"].get("built"),
    )
    row["stopped_by"] = record["stopped_by"]
    row["peak_rss_bytes"] = record["peak_rss_bytes"]
    row["unscored"] = next((f["unscored"] for f in record["frames"] if f["unscored"]), None)
    if not frames:
        return row
    row["total_ms"] = float(np.mean([np.median(f["total_ms"]) for f in frames]))
    row["wall_ms"] = float(np.mean([np.median(f["wall_ms"]) for f in frames]))
    row["iqr_ms"] = float(np.mean([np.subtract(*np.percentile(f["total_ms"], [75, 25])) for f in frames]))
    row["between_ms"] = between_rounds(frames)
    for part in ("build", "trace", "light build", "shadow"):
        row[f"{part.replace(' ', '_')}_ms"] = float(np.mean([part_ms(frame, part) for frame in frames]))
    stage_sum = sum(row[f"{part}_ms"] for part in ("build", "trace", "light_build", "shadow"))
    row["stage_gap"] = (stage_sum - row["total_ms"]) / row["total_ms"] if row["total_ms"] else None
    row["memory_bytes"] = max((f["memory_bytes"] or 0) for f in frames)
    row["regrown"] = max(f["regrown"] for f in frames)
    return row


def part_ms(frame: dict[str, Any], part: str) -> float:
    """The sum over a part's passes of the median of their samples."""
    return float(
        sum(np.median(step["ms"]) for step in frame["passes"] if step["part"] == part and step["ms"])
    )


def between_rounds(frames: list[dict[str, Any]]) -> float:
    """The range between rounds of the point's time (mean over frames of each round's median); 0 with one round."""
    numbers = sorted({number for frame in frames for number in frame["round"]})
    times = []
    for number in numbers:
        per_frame = []
        for frame in frames:
            own = [t for t, r in zip(frame["total_ms"], frame["round"], strict=True) if r == number]
            if own:
                per_frame.append(float(np.median(own)))
        if len(per_frame) == len(frames):
            times.append(float(np.mean(per_frame)))
    return max(times) - min(times) if times else 0.0
