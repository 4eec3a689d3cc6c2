"""The results of a folder as pandas DataFrames: :func:`tidy`, one row per point and frame; :func:`samples`, one row per
sample.

>>> from shadowbench.harness.results import tidy
>>> table = tidy("results/nvidia-h200/frame_time")
>>> table.pivot_table(index="scene", columns="label", values="total_ms")

pandas is imported when a table is made, not when this module is: most commands need none.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..arrays import F64, I64
from ..frame.registry import label_of
from ..frame.schedule.passes import BUILD_PARTS, PARTS
from ..judge.counts import Score, total
from ..judge.verdict import ERRORS
from ..texts import scalar
from . import costs
from .newest import newest_as, settings_text
from .record import Frame, Record
from .schema import folders_with_records, place_name

if TYPE_CHECKING:
    from pandas import DataFrame, Series

PART_COLUMNS = {part: part.replace(" ", "_") for part in PARTS}
"""The names of a frame's parts in the names of columns: ``light build`` is ``light_build_ms``."""

BACKWARDS = 0.05
"""A part that would take less than minus this share of its frame shows that the times of passes contradict each other."""

COUNTS = (
    "triangles vertices invalid_triangles frame_count width height pixels lights targets rounds frames_left_out frame "
    "samples regrown memory_bytes peak_rss_bytes shadow_rays mirrored_rays pixels_scored true_errors reference_errors "
    "pass_count build_count"
).split()
"""Columns of whole numbers: ``Int64``, ``<NA>`` where not known."""

NUMBERS = (
    "light_distance light_turns compile_s first_frame_s total_ms q1_ms q3_ms iqr_ms wall_ms submitted_ms "
    "build_ms trace_ms light_build_ms shadow_ms build_iqr_ms trace_iqr_ms light_build_iqr_ms shadow_iqr_ms "
    "excused_share flip started"
).split() + [*costs.NUMBERS, *costs.LATENCIES]
"""Columns of numbers: ``float64``, ``NaN`` where not known."""

TEXTS = (
    "key folder run experiment scene scene_title stand_in scene_sha256 source source_file source_sha256 left_out "
    "method method_title label settings built known_inexact method_sha256 device device_name preset status reason "
    "view light_label moved environment unscored check flip_missing stopped_by"
).split() + [*costs.MISSING]
"""Columns of text: "" where not known, never missing."""


def tidy(folder: Path | str) -> DataFrame:
    """The results of a folder, or of the folders in it where it has no records itself: one row per point and measured frame;
    a point without one has one row, with its reason.

    Of several records of one table entry the one asked for last counts (:func:`.results.newest.newest`);
    ``table.attrs["older"]`` is the number of the others. Raises :class:`~.errors.UserError` where there are none.

    ==================  ========  ==========================================================================
    column              dtype     meaning
    ==================  ========  ==========================================================================
    key                 text      the point: one method with its settings on one scene, size and device
    folder              text      name of the folder; in a tree the way to it, which is before each ``key`` too
    run                 text      one value for all points of one run, which are interleaved; times of different
                                  runs must not be compared. Older records have the ``environment`` here
    experiment, preset  text      what was run
    scene, scene_title  text      its name, and its title
    stand_in            text      what the scene stands in for; "": it is the original
    scene_sha256        text      hash of its arrays
    source, source_file, source_sha256  text  procedural or file, and the file
    left_out            text      what of the file was left out or approximated
    triangles, vertices, invalid_triangles, frame_count  Int64  of the scene
    method, method_title, label  text  its name, its title, and the name of its column in the experiment
    settings, built     text      what was set, "-" for nothing; what was really built
    known_inexact       text      why the method declares itself inexact
    method_sha256       text      hash of its code: its version
    device, device_name  text     ``cpu`` or ``cuda:0``, and what it is
    width, height, pixels  Int64  of the image
    view                text      a camera or lights given on the command line; "": the scene's own
    light_label         text      how the experiment placed the lights; "": as the scene has them
    lights              Int64     number of lights
    targets             Int64     points that shadow rays are traced to: as many as lights, more where one has an area
    light_distance      float     of the lights from the middle of the scene, in its radii; NaN: the scene's own
    light_turns         float     full turns of the lights over the frames
    moved               text      what alone changed since the last frame; "": everything is rebuilt
    status, reason      text      ok, skipped, failed, timeout or rejected; and why
    rounds              Int64     rounds in which the point was measured
    frames_left_out     Int64     frames beyond the budget
    compile_s, first_frame_s  float  seconds
    peak_rss_bytes      Int64     of the worker's process
    environment         text      file in ``environments/``: machine, driver, versions, commit
    frame               Int64     number of the frame in the scene's animation; <NA>: none was measured
    total_ms            float     median of the samples of the whole frame, on the device's clock
    q1_ms, q3_ms, iqr_ms  float   their quartiles, and the range between them
    wall_ms             float     the same median on the host's clock
    submitted_ms        float     of frames that are no graph on a GPU: median of the host's time to submit one
    samples             Int64     how many there are
    build_ms, trace_ms, light_build_ms, shadow_ms  float  the parts: sums of the medians of their passes
    build_iqr_ms, trace_iqr_ms, light_build_iqr_ms, shadow_iqr_ms  float  interquartile range of the sums of a part's passes
    memory_bytes        Int64     structures and work buffers
    regrown             Int64     how often a capacity grew before the frame was measured
    pass_count, build_count  Int64  passes that the frame launches, and those that build structures
    shadow_rays         Int64     number of shadow rays: one for each light and each pixel that needs one
    mirrored_rays       Int64     of all bounces; <NA>: not judged
    true_errors         Int64     wrong pixels and shadow bits; <NA>: the frame was not judged
    unscored            text      why it was not judged
    check               text      ok or failed: no true error, and at most 0.1 % of the pixels excused
    excused_share       float     pixels too close to an edge to decide, over all pixels
    pixels_scored       Int64     pixels that were judged
    reference_errors    Int64     answers of the reference that the referee found wrong
    flip, flip_missing  float, text  mean FLIP against the reference's picture; why there is none
    started, stopped_by  float, text  start of the last samples, seconds since the epoch; what ended them
    p50_ms, p95_ms, p99_ms  float  percentiles of the samples of all frames of the point, each frame counting equally;
                                  NaN for one frame
    energy_mj, idle_w   float     millijoules of the frame above those of the idle card, and the watts of that
    alone_ms, pair_ms   float     milliseconds a frame of frames one after another, and of two at the same time
    energy_missing, flight_missing  text  why there is no energy, and no two frames in flight
    primary_tests, shadow_tests  float  triangle tests a ray, where the method counts them
    expected_nodes, expected_tests, sah_cost  float  nodes and triangles that a ray through the scene's box meets in a tree
                                  in the mean, by the areas of its boxes; and 1.2 times the nodes plus the tests
    bytes_per_ray       float     ``memory_bytes`` over the primary and shadow rays
    round.N             float     median of the whole frame's samples of round N, ms
    pass.PART.NAME      float     median of a pass, ms. Missing, like the times of parts, where they contradict each
                                  other: on a GPU a pass is the difference of two graphs, and one was disturbed
    counter.NAME        float     work counters
    primary.CLASS       float     pixels by the class of their primary ray's answer
    shadow.CLASS        float     shadow bits by class, of all lights
    set.NAME            object    settings and all other parameters of the method
    light.NAME          object    what the experiment changed of the scene's lights: distance, target, angle, spot, ...
    point.NAME          object    what the run asked for: samples, rounds, budget_s, ...
    ==================  ========  ==========================================================================
    """
    folder = Path(folder)
    places, rows, older = folders_with_records(folder), list[dict[str, Any]](), 0
    for place in places[:1] if places[0] == folder else places:
        name = place_name(place, folder)
        before = "" if place == folder else f"{name}/"
        found, more = newest_as(place, partial(_rows, folder=name))
        rows += ({**row, "key": before + row["key"]} for own in found for row in own)
        older += more
    table = _typed(rows)
    table.attrs["older"] = older
    return table


def table_of(records: Iterable[Record], folder: str = "") -> DataFrame:
    """The rows of records, as :func:`tidy` describes them."""
    return _typed([row for record in records for row in _rows(record, folder)])


def _typed(rows: list[dict[str, Any]]) -> DataFrame:
    """Rows as a table whose declared columns have their types."""
    import pandas as pd

    table = pd.DataFrame(rows)
    for names, kind, missing in ((COUNTS, "Int64", None), (NUMBERS, "float64", np.nan), (TEXTS, "object", "")):
        kinds = {name: table[name].astype(kind) if name in table else missing for name in names}
        table = table.assign(**kinds)
    table[TEXTS] = table[TEXTS].fillna("")
    return table.copy()  # in one piece


def samples(folder: Path | str) -> DataFrame:
    """Every sample of a folder's results, in long form: tens of bytes for each.

    ========  ========  ====================================================================================
    key       category  the point, as in :func:`tidy`
    frame     int       number of the frame
    round     int       the round that the sample was taken in
    part      category  ``frame``: the whole frame; ``wall``: the same on the host's clock; else a part of the frame
    pass      category  name of the pass; "" for whole frames
    sample    int       number of the sample
    ms        float     milliseconds
    ========  ========  ====================================================================================
    """
    import pandas as pd

    series = [one for found in newest_as(folder, _series)[0] for one in found]
    lengths = np.array([len(one.ms) for one in series], dtype=np.int64)
    empty = [np.zeros(0)]

    def repeated(values: list[Any]) -> Any:
        return pd.Categorical(values, dict.fromkeys(values)).repeat(lengths)

    return pd.DataFrame(
        {
            "key": repeated([one.key for one in series]),
            "frame": np.repeat(np.array([one.frame for one in series], dtype=np.int64), lengths),
            "round": np.concatenate([one.rounds for one in series] or empty).astype(np.int64),
            "part": repeated([one.part for one in series]),
            "pass": repeated([one.name for one in series]),
            "sample": np.concatenate([np.arange(n) for n in lengths] or empty).astype(np.int64),
            "ms": np.concatenate([one.ms for one in series] or empty),
        }
    )


class _Samples(NamedTuple):
    """The samples of one pass, or of whole frames. ``rounds``, ``ms``: [sample]."""

    key: str
    frame: int
    part: str
    name: str
    rounds: I64
    ms: F64


def _series(record: Record) -> list[_Samples]:
    found = []
    for frame in record.measured:
        lines = [("frame", "", frame.round, frame.total_ms), ("wall", "", frame.round, frame.wall_ms)]
        lines += [(step.part, step.name, frame.stage_round, step.ms) for step in frame.passes if step.ms]
        for part, name, rounds, ms in lines:
            numbers = np.array(rounds, dtype=np.int64)
            found.append(_Samples(record.key, frame.frame, part, name, numbers, np.array(ms, dtype=np.float64)))
    return found


def stage_ms(table: DataFrame, part: str, pattern: str = "") -> Series:
    """Milliseconds of the passes of a part whose names match ``pattern`` (a regular expression), row by row."""
    found = table.filter(regex=rf"^pass\.{part}\..*(?:{pattern})").sum(axis=1)
    return found.where(table["build_ms"].notna())


def _rows(record: Record, folder: str) -> list[dict[str, Any]]:
    point = _point(record, folder)
    pixels = point["pixels"]
    rows = [(frame, _times(frame)) for frame in record.measured]
    return [
        {**point, **row, **costs.costs_of(frame, pixels, row["shadow_rays"]), **_score(frame)} for frame, row in rows
    ] or [point]


def _point(record: Record, folder: str) -> dict[str, Any]:
    """The columns that all frames of a point share."""
    scene, method, point = record.scene, record.method, record.point
    lighting, source = scene.get("lighting") or {}, scene.get("source") or {}
    parameters = method.get("parameters") or {}
    values = {**(method.get("settings") or {}), **parameters.get("build", {}), **parameters.get("trace", {})}
    asked = {k: v for k, v in point.items() if isinstance(v, str | int | float)}
    runs = dict.fromkeys(one["run"] for one in record.rounds or () if "run" in one)
    return {
        "key": record.key,
        "folder": folder,
        "run": "+".join(runs) or record.environment,
        "experiment": record.experiment,
        "preset": point.get("preset"),
        "scene": scene["name"],
        "scene_title": scene.get("title") or scene["name"],
        "stand_in": scene.get("stand_in"),
        "scene_sha256": scene.get("arrays_sha256"),
        "source": source.get("kind"),
        "source_file": source.get("file"),
        "source_sha256": source.get("sha256"),
        "left_out": source.get("left_out"),
        "triangles": scene.get("triangles"),
        "vertices": scene.get("vertices"),
        "invalid_triangles": scene.get("invalid_triangles") or 0,
        "frame_count": scene.get("frame_count"),
        "method": method["name"],
        "method_title": method.get("title") or method["name"],
        "label": label_of(method),
        "settings": settings_text(method.get("settings")),
        "built": settings_text(method.get("built")),
        "known_inexact": method.get("known_inexact"),
        "method_sha256": method.get("source_sha256"),
        "device": method["device"],
        "device_name": method.get("device_name"),
        "width": point["width"],
        "height": point["height"],
        "pixels": point["width"] * point["height"],
        "view": scene.get("view") or "",
        "light_label": lighting.get("label", ""),
        "lights": len(scene.get("lights") or ()),
        "targets": sum(light.get("samples", 1) for light in scene.get("lights") or ()),
        "light_distance": lighting.get("distance") or None,
        "light_turns": lighting.get("turns") or None,
        "moved": lighting.get("moved"),
        "status": record.status,
        "reason": record.reason,
        **costs.latencies(record.measured),
        "rounds": len({number for frame in record.measured for number in frame.round}),
        "frames_left_out": len(record.frames_left_out or ()),
        "compile_s": record.compile_s,
        "first_frame_s": record.first_frame_s,
        "peak_rss_bytes": record.peak_rss_bytes,
        "environment": record.environment,
        "stopped_by": record.stopped_by,
        "unscored": "" if record.measured else "not measured",
        **{f"set.{name}": scalar(value) for name, value in values.items()},
        **{f"light.{name}": scalar(value) for name, value in lighting.items() if name != "label"},
        **{f"point.{name}": value for name, value in asked.items()},
    }


def _median(samples: list[float] | None) -> float:
    return float(np.median(samples)) if samples else np.nan


def _times(frame: Frame) -> dict[str, Any]:
    low, middle, high = np.percentile(frame.total_ms, [25, 50, 75])
    total, rounds = np.asarray(frame.total_ms), np.asarray(frame.round)
    row: dict[str, Any] = {
        "frame": frame.frame,
        "total_ms": float(middle),
        "q1_ms": float(low),
        "q3_ms": float(high),
        "iqr_ms": float(high - low),
        "wall_ms": float(np.median(frame.wall_ms)),
        "submitted_ms": _median(frame.submitted_ms),
        "samples": len(frame.total_ms),
        "memory_bytes": frame.memory_bytes,
        "regrown": frame.regrown,
        "pass_count": len(frame.passes),
        "build_count": sum(step.part in BUILD_PARTS for step in frame.passes),
        "shadow_rays": _shadow_rays(frame),
        "started": max(frame.started, default=0.0),
    }
    row |= {f"round.{n}": float(np.median(total[rounds == n])) for n in dict.fromkeys(frame.round)}
    steps = [step for step in frame.passes if step.ms]
    medians = {step.name: float(np.median(step.ms)) for step in steps}
    counters = {f"counter.{name}": value for name, value in (frame.counters or {}).items()}
    parts = {column: [step for step in steps if step.part == part] for part, column in PART_COLUMNS.items()}
    sums = {column: float(sum(medians[step.name] for step in own)) for column, own in parts.items()}
    untimed = bool(frame.passes) and not steps
    if untimed or min(sums.values()) < -BACKWARDS * middle:
        unknown = (f"{column}_{kind}" for column in parts for kind in ("ms", "iqr_ms"))
        return row | dict.fromkeys(unknown, math.nan) | counters
    row |= {f"pass.{step.part}.{step.name}": medians[step.name] for step in steps}
    for column, own in parts.items():
        row[f"{column}_ms"] = sums[column]
        row[f"{column}_iqr_ms"] = _range(np.sum([step.ms for step in own], axis=0)) if own else 0.0
    return row | counters


def _range(values: Sequence[float] | Any) -> float:
    return float(np.subtract(*np.percentile(values, [75, 25])))


def _score(frame: Frame) -> dict[str, Any]:
    """The score of a frame: true errors, or why there is no such number (then it is missing, never 0)."""
    row: dict[str, Any] = {"flip": frame.flip, "flip_missing": frame.flip_missing}
    score = frame.score
    if score is None:
        return {**row, "unscored": frame.unscored or "not judged", "pixels_scored": 0}
    row |= {f"primary.{name}": value for name, value in vars(score.primary).items()}
    for light in score.shadow:
        for name, value in vars(light).items():
            if name != "light":
                row[f"shadow.{name}"] = row.get(f"shadow.{name}", 0) + value
    return {
        **row,
        "unscored": "",
        "mirrored_rays": sum(bounce.rays for bounce in score.bounces),
        "true_errors": score.true_errors,
        "excused_share": score.excused_share,
        "check": score.check,
        "pixels_scored": score.primary.pixels,
        "reference_errors": reference_errors(score),
    }


def reference_errors(score: Score) -> int:
    """How many answers of the reference the referee found wrong while it decided this score's disputes."""
    counts = score.reference_errors
    return sum(total(counts, kind) for kind in ERRORS) if counts else 0


def _shadow_rays(frame: Frame) -> int | None:
    """The number of shadow rays of a frame. Old records do not have it, but the number that was judged."""
    if frame.shadow_rays is not None or not frame.score:
        return frame.shadow_rays
    return sum(light.scored for light in frame.score.shadow)
