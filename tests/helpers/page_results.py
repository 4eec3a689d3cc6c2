"""Made-up results for tests of the page, five folders with pictures, maps and a drawing; and the command for the page."""

import json
from pathlib import Path

import numpy as np
import pytest
from helpers.called_command import exit_code
from helpers.experiment_records import record_of, write_records
from helpers.kept import kept, session_folder
from PIL import Image
from shadowbench.harness.report.picture import answered_path, reference_path
from shadowbench.harness.results.pixel_maps import map_path, write_map, wrong_path
from shadowbench.harness.runner.planning.experiment import Entry
from shadowbench.harness.scene.overrides import Lighting

GRIDS, TREE, MAP = (Entry("ray_grids", {}, "grids"), Entry("bvh", {}, "tree"), Entry("shadow_map", {}, "map & <b>"))
HYBRID = Entry("hybrid", {}, "hybrid")
FACTS = {"cpu": {"model": "A CPU", "usable_cores": 2}, "warp": "1.0", "python": "3", "os": "x"}


def wrong(record, count):
    record["frames"][0]["score"].update(true_errors=count, check="failed")
    return record


def write_machine(folder: Path, records: list[dict], gpu: str) -> None:
    """Records and the facts of the machine that they were measured on."""
    write_records(folder, records)
    (folder / "environments").mkdir()
    facts = {**FACTS, "gpus": [{"name": gpu}]}
    (folder / "environments" / f"{records[0]['environment']}.json").write_text(json.dumps(facts))


def make_results(root: Path) -> Path:
    """Two scenes and three methods, one with wrong answers and one rejected, the same on another machine on a busy day; a
    light at three distances, one of them with three frames; a table like the paper's; effects of which two have two lights.
    Pictures, maps and a drawing.
    """
    times = [record_of("frame_time", e, scene, ms=ms * k) for scene, k in (("cloth", 1.0), ("buddha", 3.0))
             for e, ms in ((GRIDS, 0.5), (TREE, 2.0))]  # fmt: skip
    times += [
        wrong(record_of("frame_time", MAP, "cloth", ms=0.25), 7),
        record_of("frame_time", MAP, "buddha", status="rejected"),
    ]
    times[1]["method"]["source_sha256"] = "an earlier version"
    far = [
        record_of(
            "figure11", e, "cloth", Lighting(label=f"{d:g} radii", distance=d), ms=ms * d**0.5,
            counters={"pairs": 9 * d}, frames=3 if d == 1 else 1,
        )
        for d in (0.1, 1.0, 10.0)
        for e, ms in ((GRIDS, 1.0), (TREE, 4.0))
    ]  # fmt: skip
    far[3]["method"]["source_sha256"] = "an earlier version"
    far[1]["method"]["source_sha256"], far[1]["frames"][0]["started"] = "a later version", [9.0]
    table = [
        record_of("table1", e, scene, ms=ms * k)
        for scene, k in (("cloth", 1.0), ("buddha", 3.0))
        for e, ms in ((GRIDS, 0.5), (TREE, 2.0))
    ]
    lit = [Lighting("one light", count=1), Lighting("two lights", count=2), Lighting("spot, two", count=2, spot=9.0)]
    effects = [record_of("effects", GRIDS, "cloth", one, ms=ms) for one, ms in zip(lit, (1.0, 1.5, 9.0), strict=True)]
    effects[0]["frames"][0]["passes"][0]["ms"] = [-0.0013, -0.0013]
    elsewhere = [record_of("frame_time", e, ms=ms, frames=n) for e, ms, n in ((GRIDS, 0.7, 3), (TREE, 2.7, 1))]
    for one in elsewhere:
        one["method"]["device"] = "cpu"
        one["rounds"], one["environment"] = [{"round": 0, "clock": {"load": 9.0}}], "other"
    folders = {"frame_time": times, "figure11": far, "table1": table, "effects": effects, "other/frame_time": elsewhere}
    for name, records in folders.items():
        write_machine(root / name, records, "Another GPU" if "/" in name else "A GPU")
    folder, key = root / "frame_time", times[4]["key"]
    (folder / "frame_time.svg").write_text('<svg xmlns="http://www.w3.org/2000/svg" width="9" height="9"/>')
    Image.new("RGB", (9, 9)).save(folder / "gallery.png")
    (folder / "images").mkdir()
    picture = np.full((16, 16, 3), 200, np.uint8)
    Image.fromarray(picture).save(reference_path(folder, "cloth", 0))
    picture[:4] = 0
    Image.fromarray(picture).save(answered_path(folder, key, 0))
    classes = np.ones((16, 16), int)
    classes[:4] = 7
    write_map(wrong_path(folder, key, 0), classes)
    for record, most in ((times[0], 300), (times[1], 9)):
        write_map(map_path(folder, record["key"], 0), np.arange(256).reshape(16, 16) * most // 255)
    return root


def shared_results() -> Path:
    """The folder of :func:`make_results` with its page, ``page.html``: made once, for tests that only read it."""
    return kept("results with a page", _with_page)


def _with_page() -> Path:
    folder = make_results(session_folder() / "results")
    with pytest.MonkeyPatch.context() as patch:
        assert command(patch, folder, "--out", folder / "page.html") == 0
    return folder


def command(monkeypatch, *words):
    return exit_code(monkeypatch, "report", *words)
