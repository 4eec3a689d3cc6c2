"""One JSON file a point, written atomically from a journal of rounds; and reading them back as tidy tables.

A folder of results holds ``records/KEY.json`` (finished points), ``journal/KEY.jsonl`` (points under way),
``environments/ID.json``, ``scenes.json`` and, outside version control, ``truth/`` and ``answers/``. Records keep
every raw sample; statistics are computed here, on reading.
"""

from __future__ import annotations
from ..files import write_bytes

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












def write_archive(path: Path, records: Iterable[dict[str, Any]]) -> None:
    """Records as one compressed file, by key, as :func:`.results.schema.read_archive` reads it.

    The same records give the same bytes.
    """
    ordered = sorted(records, key=lambda record: str(record["key"]))
    text = "".join(json.dumps(record, allow_nan=False) + "\n" for record in ordered)
    write_bytes(path, lzma.compress(text.encode(), preset=9 | lzma.PRESET_EXTREME))




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














