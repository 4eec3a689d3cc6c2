"""The least time that the stages of ray grids could take on a device: the floor that frame_time draws.

Bytes over bandwidth or tests over rate, and a launch each. The rates of devices are measured or, where noted, estimated.
The floor is not a prediction: it includes no latency except that of launches. Each input is read once and each output
written once, whatever a cache or a gather adds; each ray is tested once, though every triangle before or beside its first
one costs a test as well.
"""

import re
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from ..harness.report.dataframe import DataFrame, Series, pd


@dataclass(frozen=True)
class Work:
    """The least work of a stage: bytes read and written once, ray-triangle tests, kernels one after another.

    stage  what it is a share of, where passes that run beside each other make up a stage; "": the pass is all of it
    """

    bytes: float = 0.0
    tests: float = 0.0
    launches: int = 1
    stage: str = ""


@dataclass(frozen=True)
class Machine:
    """The rates of a device; ``launch_ms``: from one kernel to the next."""

    bytes_per_s: float
    tests_per_s: float
    launch_ms: float


UNKNOWN = Work(float("nan"), float("nan"))
MACHINES = {  # devices whose rates are known, by the name that records give them
    # A copy counted both ways; 132 multiprocessors of 4 x 32 lanes at 1.98 GHz, 20 instructions a test of edge
    # planes (not measured); a hundred tiny kernels in a graph.
    "NVIDIA H200": Machine(4.3e12, 1.65e12, 0.001)
}

WorkOf = Callable[[dict[str, Any], str], Work | None]  # a tidy row and a pass to its work, if known

SCENE = ["scene", "width", "height"]
COLUMNS = [*SCENE, "stage", "part", "ms", "floor_ms", "times", "bytes_mb", "tests_m", "launches"]


def least_ms(work: Any, machine: Machine) -> Any:
    """The floor of a :class:`Work`, or of a table with its columns: bytes and tests can overlap, launches cannot."""
    moving, testing = work.bytes / machine.bytes_per_s, work.tests / machine.tests_per_s
    return 1e3 * np.maximum(moving, testing) + machine.launch_ms * work.launches


def stages(frames: DataFrame, work_of: WorkOf) -> DataFrame:
    """Means over frames of time, floor, work, by scene, size and stage, on known devices. Passes of a stage run together."""
    counted = ["shadow_rays", "vertices", *(c for c in frames if c.startswith("counter."))]
    known = frames[frames["device_name"].isin(list(MACHINES))].fillna(dict.fromkeys(counted, 0))
    rows, stage = [], [*SCENE, "stage", "part"]
    for frame in known.to_dict("records"):
        for column in [name for name, ms in frame.items() if name.startswith("pass.") and ms == ms]:
            _, part, name = column.split(".", 2)
            work = work_of(frame, name) or UNKNOWN
            rows.append({**frame, **asdict(work), "stage": work.stage or name, "part": part, "ms": frame[column]})
    if not rows:
        return pd.DataFrame(columns=COLUMNS)
    groups = pd.DataFrame(rows).groupby([*stage, "frame", "device_name"], sort=False)
    found = groups[["ms", "bytes", "tests"]].agg(lambda values: values.sum(skipna=False))
    found = found.join(groups["launches"].max()).reset_index("device_name")
    floors = [least_ms(own, MACHINES[name]) for name, own in found.groupby("device_name")]
    mean = found.assign(floor_ms=pd.concat(floors)).groupby(stage, sort=False).mean(numeric_only=True)
    return mean.assign(
        times=mean["ms"] / mean["floor_ms"], bytes_mb=mean["bytes"] / 1e6, tests_m=mean["tests"] / 1e6,
        launches=mean["launches"].where(mean["floor_ms"].notna()),
    ).reset_index()[COLUMNS]  # fmt: skip


def of_frames(found: DataFrame) -> Series:
    """The floor of a whole frame in ms, by scene and image size: of those all of whose stages have one."""
    floors = found.groupby(SCENE, sort=False)["floor_ms"].agg(lambda own: own.sum(skipna=False))
    return floors.dropna().rename("frame_floor_ms")


TRIANGLE = 12 + 1  # bytes of a triangle's indices and of whether it is valid
VERTEX = 12
WORD = 8  # bytes of a pixel's nearest word
ANSWER = 4 * 4  # bytes of a pixel's triangle, distance and weights
POINT, OWN, SLOT = 16, 4, 8  # bytes of a ray's hit point in float32, of its own triangle and of its slot in the cells
ITEM, RECORD, GROUP, PAIR = 16, 64, 128, 8  # bytes: queued item, triangle's planes, light's rows, undecided pair
FORMER = {"chunks": "parts", "undecided pairs": "doubtful pairs"}
"""Names of counters in the records of earlier versions, whose passes have these words, too."""


def ray_grids(row: dict[str, Any], name: str) -> Work | None:
    """The work of a pass of ``ray_grids``, by its name; queues by the counters of the frame. ``row``: of a tidy table."""
    pixels, rays = row["pixels"], row["shadow_rays"]
    mesh = row["triangles"] * TRIANGLE + row["vertices"] * VERTEX
    match = re.fullmatch(r"(camera|light \d+): (.+?)(?:, share \d+ of (\d+))?", name)
    if match is None:
        return None
    who, what, shares = match.groups()
    share = 1.0 / int(shares or 1)
    stage = f"{who}: {what}"

    def queued(kind: str) -> float:
        return share * sum(row.get(f"counter.{who} {name}", 0) for name in {kind, FORMER.get(kind, kind)})

    if what == "stream triangles":
        # The camera writes words; a light reads rays. Queued work is written.
        own = pixels * WORD if who == "camera" else rays * POINT
        tests = pixels if who == "camera" else rays
        return Work(share * (mesh + own) + queued("items") * ITEM, share * tests, stage=stage)
    group = ITEM + RECORD if who == "camera" else GROUP
    stages = {
        "clear": Work(pixels * WORD),
        "resolve": Work(pixels * (WORD + ANSWER)),
        "aim": Work(0.0),
        "map rays": Work(pixels * (WORD + 1) + rays * (POINT + OWN)),
        "count and scan": Work(rays * SLOT),
        "scatter rays": Work(rays * (SLOT + 2 * POINT)),
        "split large": Work(queued("items") * (ITEM + GROUP), stage=stage),
        "queued rows": Work(queued("items") * group, stage=stage),
        "further chunks": Work(queued("chunks") * (PAIR + group), stage=stage),
        "undecided pairs": Work(queued("undecided pairs") * PAIR, stage=stage),
    }
    for now, former in FORMER.items():
        what = what.replace(former, now)
    if what == "further chunks, undecided pairs":
        return Work(stages["further chunks"].bytes + stages["undecided pairs"].bytes, stage=stage)
    return stages.get(what)
