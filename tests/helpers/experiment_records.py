"""Made-up records of any experiment and of Table 1, as a run would write them: for tests of drawings and of claims."""

import csv
import json
from typing import Any

import numpy as np
from shadowbench.harness.commands.show import show
from shadowbench.harness.runner.planning.experiment import Entry
from shadowbench.harness.scene.overrides import Lighting


def record_of(
    name, entry, scene="cloth", lighting=None, ms=10.0, counters=None, status="ok", size=64, frames=1, passes=()
):
    """A record as a run would write it; ``passes``: (name, part, ms)."""
    passes = passes or [("build", "build", ms * 0.2), ("primary rays", "trace", ms * 0.3),
                        ("light 0: count", "light build", ms * 0.1),
                        ("light 0: shadow rays", "shadow", ms * 0.4)]  # fmt: skip
    lighting = lighting or Lighting()
    lights = [{}] * max(1, lighting.count)
    one = {
        "total_ms": [ms, ms * 1.02], "wall_ms": [ms, ms], "round": [0, 0], "regrown": 0, "started": [0.0],
        "stage_round": [0, 0], "stopped_by": ["samples"], "memory_bytes": 1, "counters": counters or {},
        "score": {"true_errors": 0, "excused_share": 0.0, "check": "ok", "primary": {"pixels": 4}, "shadow": []},
        "unscored": None, "shadow_rays": 100,
        "passes": [{"name": n, "part": p, "ms": [x, x]} for n, p, x in passes],
    }  # fmt: skip
    parameters = {"k": 2, "r": 64, "clamp": "hits", "aimed": True, "precision": "float64", **entry.settings}
    key = f"{scene}-{lighting.label}-{entry.label or entry.method}-{size}".replace(" ", "_").replace("/", "_")
    return {
        "schema": 1, "key": key, "experiment": name, "status": status, "reason": "needs 9 pairs" * (status != "ok"),
        "point": {"preset": "quick", "width": size, "height": size},
        "scene": {"name": scene, "title": f"{scene.title()} (stand-in)", "stand_in": "the original", "triangles": 90_000,
                  "lights": lights, "lighting": lighting.facts(), "frame_count": frames, "source": {}},
        "method": {"name": entry.method, "title": entry.method, "label": entry.label or entry.method,
                   "settings": dict(entry.settings), "parameters": {"build": parameters, "trace": {}},
                   "device": "cuda:0", "device_name": "Imaginary GPU", "built": {}},
        "environment": "e", "compile_s": 0.0, "load_s": 0.0, "first_frame_s": 0.0, "peak_rss_bytes": 1,
        "stopped_by": "samples",
        "frames": [] if status != "ok" else [{**one, "frame": i} for i in range(frames)],
    }  # fmt: skip


def write_records(folder, records):
    place = folder / "records"
    place.mkdir(parents=True, exist_ok=True)
    for r in records:
        (place / f"{r['key']}.json").write_text(json.dumps(r))
    return folder


def report_of(name, folder, records=()):
    """What the report of an experiment says, drawn from the records of a folder and these."""
    show(name, write_records(folder, records), quiet=True)
    return (folder / f"{name}.md").read_text()


def csv_of(name, folder):
    """The rows of the CSV that an experiment has written."""
    with open(folder / f"{name}.csv", newline="") as file:
        return list(csv.DictReader(file))


SCENES = {
    "fairy": ("Fairy Forest (stand-in)", 174_117, 3),
    "sibenik": ("Sibenik Cathedral (stand-in)", 81_952, 1),
    "cloth": ("Cloth (stand-in)", 92_210, 3),
    "buddha": ("Buddha (stand-in)", 1_087_716, 1),
    "bunny": ("Bunny (file)", 12_180, 1),
}
METHODS = {
    "perspective_spherical": ("Perspective and light grids", (40.0, 20.0, 25.0, 30.0)),
    "uniform_grid": ("Grid, uniform", (50.0, 60.0, 0.0, 55.0)),
    "warp_bvh": ("Warp Mesh, rebuilt", (70.0, 15.0, 0.0, 20.0)),
    "embree": ("Embree, 2 threads", (30.0, 4.0, 0.0, 5.0)),
}
PARTS = ("build", "trace", "light build", "shadow")


def record(scene: str, method: str, size: int = 256, seed: int = 0, **changes: Any) -> dict[str, Any]:
    """A measured point with plausible times and no wrong answer; ``changes`` replace top-level fields."""
    random = np.random.default_rng([seed, *map(ord, scene + method)])
    title, triangles, count = SCENES[scene]
    label, base = METHODS[method]
    times = np.array(base) * (triangles / 174_000) ** 0.7
    stand_in = f"the paper's {title.split(' (')[0]}" if "stand-in" in title else None
    made = record_of("table1", Entry(method, {}, label), scene, size=size, frames=count)
    made["point"]["preset"] = "quick" if size == 256 else "paper"
    made["scene"] |= {
        "title": title, "stand_in": stand_in, "triangles": triangles, "vertices": triangles // 2,
        "source": {"kind": "procedural" if stand_in else "file", "file": "", "sha256": ""},
    }  # fmt: skip
    made["method"] |= {
        "title": label.split(",")[0], "device": "cpu", "device_name": "Imaginary CPU",
        "built": {"warp_bvh": {"constructor": "sah"}, "embree": {"threads": 2}}.get(method, {}),
    }  # fmt: skip
    for i, frame in enumerate(made["frames"]):
        frame |= repeats(times * (1 + 0.2 * i), random) | {"score": score(size)}
    return {**made, "key": f"{scene}-{method}-{size}", "peak_rss_bytes": 500_000_000, **changes}


def repeats(parts: np.ndarray, random: np.random.Generator) -> dict[str, Any]:
    """What a record has of a frame that was repeated ten times in two rounds, with one pass a part."""
    taken = {
        part: (ms * (1 + 0.02 * random.standard_normal(10))).tolist()
        for part, ms in zip(PARTS, parts, strict=True)
        if ms
    }
    total = (np.sum(list(taken.values()), axis=0) * 1.01).tolist()
    passes = [{"name": f"the {part}", "part": part, "ms": ms} for part, ms in taken.items()]
    rounds = [0] * 5 + [1] * 5
    return {
        "total_ms": total,
        "wall_ms": total,
        "round": rounds,
        "stage_round": rounds,
        "passes": passes,
        "memory_bytes": 45_000_000,
    }


def score(size: int, wrong: int = 0) -> dict[str, Any]:
    """The score of a frame with ``wrong`` wrong pixels."""
    pixels = size * size
    return {
        "primary": {"pixels": pixels, "disputed": 40 + wrong, "ok": pixels - wrong, "true": wrong},
        "shadow": [{"light": 0, "scored": pixels // 2, "disputed": 3, "ok": pixels // 2}],
        "true_errors": wrong,
        "excused_share": 2e-5,
        "check": "ok" if not wrong else "failed",
        "reference_errors": {"primary": {"judged": 300, "ok": 299, "true": 1}, "shadow": [{"light": 0, "leak": 2}]},
    }
