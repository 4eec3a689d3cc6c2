"""Made-up records of any experiment, as a run would write them: for tests of drawings and of claims."""

import csv
import json

from shadowbench.harness.commands.show import show
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
