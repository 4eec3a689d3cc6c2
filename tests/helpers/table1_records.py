"""Made-up records of Table 1, as a run would write them, with plausible times: for tests of tables and drawings."""

from typing import Any

import numpy as np
from helpers.experiment_records import write_records  # noqa: F401

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
    scale = (triangles / 174_000) ** 0.7
    stand_in = f"the paper's {title.split(' (')[0]}" if "stand-in" in title else None
    made = {
        "schema": 1,
        "key": f"{scene}-{method}-{size}",
        "experiment": "table1",
        "status": "ok",
        "reason": "",
        "point": {"preset": "quick" if size == 256 else "paper", "width": size, "height": size},
        "scene": {
            "name": scene,
            "title": title,
            "stand_in": stand_in,
            "source": {"kind": "procedural" if stand_in else "file", "file": "", "sha256": ""},
            "triangles": triangles,
            "vertices": triangles // 2,
            "frame_count": count,
            "lights": [{}],
        },
        "method": {
            "name": method,
            "title": label.split(",")[0],
            "label": label,
            "settings": {},
            "built": {"constructor": "sah"} if method == "warp_bvh" else {"threads": 2} if method == "embree" else {},
            "device": "cpu",
            "device_name": "Imaginary CPU",
        },
        "environment": "0123456789abcdef",
        "compile_s": 1.5,
        "load_s": 0.2,
        "first_frame_s": 0.3,
        "frames": [frame(i, np.array(base) * scale * (1 + 0.2 * i), size, random) for i in range(count)],
        "peak_rss_bytes": 500_000_000,
        "stopped_by": "samples",
    }
    return {**made, **changes}


def frame(index: int, parts: np.ndarray, size: int, random: np.random.Generator) -> dict[str, Any]:
    """One frame of a record: ten repeats in two rounds, one pass a part."""
    repeats = {
        part: [float(x) for x in ms * (1 + 0.02 * random.standard_normal(10))]
        for part, ms in zip(PARTS, parts, strict=True)
        if ms
    }
    total = [float(x) for x in np.sum(list(repeats.values()), axis=0) * 1.01]
    return {
        "frame": index,
        "regrown": 0,
        "total_ms": total,
        "wall_ms": total,
        "round": [0] * 5 + [1] * 5,
        "stage_round": [0] * 5 + [1] * 5,
        "passes": [{"name": f"the {part}", "part": part, "ms": ms} for part, ms in repeats.items()],
        "memory_bytes": 45_000_000,
        "counters": {},
        "score": score(size),
        "unscored": None,
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
