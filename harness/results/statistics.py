"""Statistics of a record's samples, computed on reading."""

from __future__ import annotations
import numpy as np
from typing import Any


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
