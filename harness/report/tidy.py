"""One row a point, for tables and drawings: the record's own summary, its errors, rates, and the paper's row.

Statistics are computed here and in :mod:`.results.record`, on reading; nothing here is measured or scored.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ..frame.passes import PARTS
from ..judge.verdict import ERRORS
from ..results.newest import newest as newest_records
from ..results.statistics import part_ms, summarise
from . import paper_table1 as paper
from . import style

COLUMNS = (
    "origin scene scene_title stand_in source source_file source_sha256 triangles "
    "method method_title label settings built "
    "device device_name width height preset status reason "
    "build_ms trace_ms light_build_ms shadow_ms total_ms "
    "build_iqr_ms trace_iqr_ms light_build_iqr_ms shadow_iqr_ms iqr_ms between_ms stage_gap "
    "frames frames_left_out samples primary_mrays_per_s shadow_mrays_per_s frame_mrays_per_s "
    "memory_bytes peak_rss_bytes true_errors pixels_scored excused_share check reference_errors known_inexact unscored "
    "regrown compile_s first_frame_s environment key"
).split()
"""The columns of a tidy CSV, in order. Times in milliseconds, rates in 1e6 rays a second, memory in bytes."""


def row(record: dict[str, Any]) -> dict[str, Any]:
    """The tidy row of a record. Times are absent where the point was not measured.

    ``*_iqr_ms`` is the mean over frames of the interquartile range of repeats of one frame; ``between_ms`` the
    range between rounds. Neither ever mixes different frames of an animation.
    """
    source = record["scene"].get("source") or {}
    result = {
        "origin": "this run",
        **summarise(record),
        "preset": record["point"].get("preset"),
        "source": source.get("kind"),
        "source_file": source.get("file"),
        "source_sha256": source.get("sha256"),
        "environment": record["environment"],
        "known_inexact": record["method"].get("known_inexact"),
        "settings": style.settings_text(record["method"].get("settings")),
        "built": style.settings_text(record["method"].get("built")),
    }
    frames = [frame for frame in record["frames"] if frame["total_ms"]]
    result["frame_numbers"] = tuple(frame["frame"] for frame in frames)
    result["invalid_triangles"] = record["scene"].get("invalid_triangles") or 0
    result["rounds"] = len({number for frame in frames for number in frame.get("round") or ()})
    result["frames_left_out"] = len(record.get("frames_left_out") or ())
    for part in PARTS:
        name = f"{part.replace(' ', '_')}_iqr_ms"
        result[name] = float(np.mean([_part_iqr(frame, part) for frame in frames])) if frames else None
    result.update(_errors(frames))
    result.update(_rates(frames, result["width"] * result["height"]))
    return result


def newest(folder: Path | str) -> tuple[list[dict[str, Any]], int]:
    """As :func:`.results.newest.newest`, with records as JSON has them."""
    records, older = newest_records(folder)
    return [record.to_json() for record in records], older


def rows(records: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """The rows of records: scenes in the paper's order, then others; methods in the registry's order."""
    made = [row(record) for record in records]
    scenes = list(paper.ROWS)
    methods = list(style.colours(r["method"] for r in made))
    return sorted(
        made,
        key=lambda r: (
            scenes.index(r["scene"]) if r["scene"] in scenes else len(scenes),
            r["scene"],
            r["scene_title"],
            methods.index(r["method"]),
            r["label"],
            r["device"],
        ),
    )


def paper_rows(scenes: list[str]) -> list[dict[str, Any]]:
    """The paper's printed entries for these scenes, in the same columns, marked as the paper's own."""
    result = []
    for scene in scenes:
        for column in paper.COLUMNS:
            values = paper.numbers(scene, column.key)
            if scene not in paper.ROWS:
                continue
            printed = paper.ROWS[scene]
            text = paper.cells(scene)[paper.COLUMNS.index(column)]
            result.append(
                {
                    "origin": paper.LABEL,
                    "scene": scene,
                    "scene_title": printed.title,
                    "method": column.title,
                    "label": column.source,
                    "device_name": f"NVIDIA {paper.GPU}",
                    "width": paper.SIZE[0],
                    "height": paper.SIZE[1],
                    "status": "printed" if values else "n/a",
                    "reason": f"printed as {text!r}",
                    "unscored": "the paper states no errors",
                    **{f"{name}_ms": value for name, value in values.items()},
                }
            )
    return result


def _part_iqr(frame: dict[str, Any], part: str) -> float:
    """Interquartile range, in ms, of a part of one frame: of the sums of its passes' samples."""
    steps = [step["ms"] for step in frame["passes"] if step["part"] == part and step["ms"]]
    if not steps:
        return 0.0
    count = min(len(ms) for ms in steps)
    total = np.sum([ms[:count] for ms in steps], axis=0)
    return float(np.subtract(*np.percentile(total, [75, 25])))


def _errors(frames: list[dict[str, Any]]) -> dict[str, Any]:
    """True errors over all frames measured, or why there is no such number (then it is None, never 0)."""
    scores = [frame.get("score") for frame in frames]
    known = [score for score in scores if score]
    result: dict[str, Any] = {
        "true_errors": None,
        "excused_share": None,
        "check": None,
        "reference_errors": None,
    }
    result["pixels_scored"] = sum(score["primary"]["pixels"] for score in known)
    result["unscored"] = None
    if len(known) < len(scores):
        reasons = [frame.get("unscored") for frame in frames if not frame.get("score")]
        result["unscored"] = next((reason for reason in reasons if reason), "no truth")
        if known:
            result["unscored"] = f"{len(known)} of {len(scores)} frames scored: {result['unscored']}"
    if known:
        result["excused_share"] = max(score["excused_share"] for score in known)
        result["check"] = "ok" if all(score["check"] in (True, "ok") for score in known) else "failed"
        result["reference_errors"] = sum(reference_errors(score) for score in known)
        wrong = sum(score["true_errors"] for score in known)
        # What was found wrong counts even where other frames have no truth; "none found" needs all of them.
        if wrong or not result["unscored"]:
            result["true_errors"] = wrong
    elif not scores:
        result["unscored"] = "not measured"
    return result


def reference_errors(score: dict[str, Any]) -> int:
    """How many answers of the reference the judge found wrong while it decided this score's disputes."""
    counts = score.get("reference_errors") or {}
    groups = [counts.get("primary") or {}, *(counts.get("shadow") or [])]
    return sum(int(group.get(kind.key, 0)) for group in groups for kind in ERRORS)


def _rates(frames: list[dict[str, Any]], pixels: int) -> dict[str, float | None]:
    """Million rays a second: primary over trace time, shadow over shadow time, both over the whole frame."""
    result: dict[str, float | None] = dict.fromkeys(
        ("primary_mrays_per_s", "shadow_mrays_per_s", "frame_mrays_per_s")
    )
    if not frames:
        return result
    trace = sum(part_ms(frame, "trace") for frame in frames)
    shadow = sum(part_ms(frame, "shadow") for frame in frames)
    total = sum(float(np.median(frame["total_ms"])) for frame in frames)
    shadow_rays = [shadow_ray_count(frame) for frame in frames]
    known = [n for n in shadow_rays if n is not None]
    result["primary_mrays_per_s"] = pixels * len(frames) / trace / 1e3 if trace else None
    if len(known) == len(frames):
        result["shadow_mrays_per_s"] = sum(known) / shadow / 1e3 if shadow else None
        result["frame_mrays_per_s"] = (pixels * len(frames) + sum(known)) / total / 1e3 if total else None
    return result


def shadow_ray_count(frame: dict[str, Any]) -> int | None:
    """How many shadow rays a frame asks for: one a light and hit pixel. None where the record does not say."""
    if frame.get("shadow_rays") is not None:
        return int(frame["shadow_rays"])
    score = frame.get("score")
    if not score:
        return None
    return sum(int(light["scored"]) for light in score["shadow"])
