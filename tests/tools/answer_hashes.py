"""Hashes of all answers of methods, compared with those that are kept: whether a change has changed a bit.

    python tests/tools/answer_hashes.py                                  every row on every scene; about twenty minutes
    python tests/tools/answer_hashes.py --method bvh2 --scene fairy      the rows of bvh2 on one scene
    python tests/tools/answer_hashes.py --method bvh2:builder=lbvh,radius=4 --scene buddha:alpha=3 --cases H
    python tests/tools/answer_hashes.py --keep                           keep what is found now

A row is a method with settings, a scene as in :mod:`helpers.asked_scene`; of each scene the first frame and the middle one
are traced, one after the other in one session. ``--cases H`` are the hard cases whose names begin so. A hash is 32 bits for
each array of answers. The package is the one that this Python finds: the same program hashes another version's answers.

A kept file holds the rows, and for each frame the hash that most of them have and what differs from it in others. Exit
code 1 if a hash differs from the kept one; what is not kept is only counted. Exact methods differ in the sign of a weight
of zero.
"""

import argparse
import hashlib
import json
import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # as a program it finds the tests' helpers, too

from helpers.asked_scene import AskedScene
from shadowbench.harness import api
from shadowbench.harness.errors import CapacityRejected
from shadowbench.harness.frame.devices import start_warp
from shadowbench.harness.hardcases import all_cases
from shadowbench.harness.scene.moment import Moment
from shadowbench.harness.scene.prepared import Prepared

KEPT = Path(__file__).resolve().parents[2] / "results" / "hashes"

SCENES = (
    "fairy", "sibenik", "bunny_dragon", "conference", "cloth", "buddha", "cloth:alpha=3,bounces=2,count=2",
    "conference:bounces=2,facing=true", "fairy:directional=true,alpha=5", "buddha:spot=8,count=3,facing=true",
)  # fmt: skip

ROWS = (
    "accuracy_ladder", "accuracy_ladder:test=float64,leaf_size=4", "bvh2", "bvh2:builder=lbvh",
    "bvh2:threads=1", "bvh2:update=refit", "coherent_grid", "hybrid", "hybrid:shadows=tree,update=refit",
    "hybrid:shadows=grid", "kdtree", "perspective_spherical",
    "perspective_spherical:light_map=cube,clamp=none,balancing=algorithm-1,r=3",
    "perspective_spherical:light_map=two-angle,aimed=false,clamp=view,tile=5,staging=none", "ray_grids",
    "ray_grids:occluders=last,trial=region=triangles",
    "ray_grids:trial=inline_cells=0+region=triangles+groups=split",
    "ray_grids:trial=inline_cells=0+groups=stream+overlaps=false", "ray_grids:trial=spacing=rays",
    "two_level_bvh", "two_level_grid", "uniform_grid", "visibility_buffer", "warp_bvh", "warp_bvh:update=bvh_rebuild",
    "warp_bvh:constructor=lbvh,leaf_size=4",
)  # fmt: skip
"""The exact methods, with settings that take other ways to the same answers."""

FORMER = {"visibility": "shadowed", "bounce_visibility": "bounce_shadowed"}
"""Former names of arrays of answers."""

Found = dict[str, dict[str, str]]
"""By frame ("fairy #0") and row: the hash of its answers, "not run" or "rejected"."""


def hash_of(answers: dict[str, NDArray]) -> str:
    """32 bits for each array, by its name."""
    named = {FORMER.get(name, name): np.ascontiguousarray(values) for name, values in answers.items()}
    return " ".join(f"{name}={hashlib.sha256(named[name].tobytes()).hexdigest()[:8]}" for name in sorted(named))


def hashes_of(row: str, prepared: Prepared, moments: list[Moment], device: str) -> list[str]:
    """The hash of each moment's answers, in one session."""
    name, _, settings = row.partition(":")
    method = api.make_method(name, dict(pair.split("=", 1) for pair in settings.split(",") if pair))
    if method.applies(prepared.scene, device):
        return ["not run"] * len(moments)
    session = api.Session(method, prepared, moments[0].width, moments[0].height, device)
    try:
        return [hash_of(session.answers(moment)) for moment in moments]
    except CapacityRejected:
        return ["rejected"] * len(moments)


def traced(scenes: list[str], cases: list[str], side: int) -> Iterator[tuple[dict[str, Moment], Prepared]]:
    """What every row is run on: moments by name, in order, and their scene."""
    for text in scenes:
        asked = AskedScene.read(text, side)
        prepared = asked.prepared()
        frames = sorted({0, prepared.frame_count // 2} if asked.frame is None else {asked.frame})
        yield ({f"{text.partition('#')[0]} #{k}": prepared.moment(k, asked.side, asked.side) for k in frames}, prepared)
    for case in all_cases():
        if case.name.startswith(tuple(cases)) and not case.refused:
            trial = case.make()
            earlier = {f"case {case.name} before {k}": moment for k, moment in enumerate(trial.before)}
            yield {**earlier, f"case {case.name}": trial.moment}, trial.prepared


def difference(found: str, kept: str) -> str:
    """The names of the arrays that differ; what both say, if one is no hash."""
    if "=" not in found or "=" not in kept:
        return f"{found}, before {kept}"
    return ", ".join(sorted({part.partition("=")[0] for part in set(found.split()) ^ set(kept.split())}))


def packed(rows: list[str], found: Found) -> str:
    """The text of a kept file, a line for each frame."""
    lines = []
    for frame, hashes in found.items():
        most = Counter(hashes.values()).most_common(1)[0][0]
        others: dict[str, list[int]] = {}
        for row, text in hashes.items():
            if text != most:
                others.setdefault(without(text, most), []).append(rows.index(row))
        lines.append(f"{json.dumps(frame)}: {json.dumps([most, others])}")
    frames = ",\n".join(lines)
    return f'{{"rows": {json.dumps(rows, indent=1)},\n"frames": {{\n{frames}\n}}}}\n'


def without(text: str, most: str) -> str:
    """The arrays of a hash that are not those of another one."""
    return " ".join(part for part in text.split() if part not in most.split()) if "=" in text else text


def unpacked(path: Path) -> Found:
    """The hashes of a kept file; none if there is no such file."""
    if not path.exists():
        return {}
    kept = json.loads(path.read_text(encoding="utf-8"))
    found: Found = {}
    for frame, (most, others) in kept["frames"].items():
        found[frame] = dict.fromkeys(kept["rows"], most)
        for text, numbers in others.items():
            known = f"{most} {text}".split() if "=" in text else []
            parts = dict(part.split("=") for part in known if "=" in part)
            whole = " ".join(f"{name}={digits}" for name, digits in sorted(parts.items())) or text
            found[frame] |= {kept["rows"][number]: whole for number in numbers}
    return found


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--method", action="append", help="NAME: its rows; NAME:SETTING=VALUE,...: that row")
    parser.add_argument("--scene", action="append", help="NAME[@SIDE][:CHANGE=VALUE,...][#FRAME]; none: no scene")
    parser.add_argument("--cases", action="append", default=[], help="hard cases whose names begin so")
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--side", type=int, default=256)
    parser.add_argument("--file", type=Path, help="the kept file; default: results/hashes/DEVICE-SIDE.json")
    parser.add_argument("--keep", action="store_true", help="write what is found into the file")
    given = parser.parse_args(arguments)
    path = given.file or KEPT / f"{given.device.partition(':')[0]}-{given.side}.json"
    rows = [row for row in ROWS if given.method is None or row.partition(":")[0] in given.method]
    rows += [row for row in given.method or [] if ":" in row and row not in rows]
    scenes = [text for text in given.scene or SCENES if text != "none"]
    start_warp()
    kept, found, differ, unknown = unpacked(path), {}, 0, 0
    for moments, prepared in traced(scenes, given.cases, given.side):
        for row in rows:
            for frame, text in zip(
                moments, hashes_of(row, prepared, list(moments.values()), given.device), strict=True
            ):
                found.setdefault(frame, {})[row] = text
                before = kept.get(frame, {}).get(row)
                unknown += before is None
                if before not in (None, text):
                    differ += 1
                    print(f"{frame}, {row}: {difference(text, before)}", flush=True)
    print(f"{sum(map(len, found.values()))} frames hashed: {differ} differ from {path.name}, {unknown} are not in it")
    if given.keep:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(packed(rows, found), encoding="utf-8")
    return int(differ > 0)


if __name__ == "__main__":
    sys.exit(main())
