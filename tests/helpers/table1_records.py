"""Made-up records of Table 1, as a run would write them, with plausible times: for tests of tables and drawings."""

from typing import Any

import numpy as np
from helpers.experiment_records import record_of
from shadowbench.harness.runner.planning.experiment import Entry

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
