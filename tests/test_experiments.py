"""Experiments: what they declare is valid, what they draw from made-up records, and each of them run for real, small."""

from __future__ import annotations

import dataclasses
import json

import numpy as np
import pytest
from PIL import Image
from runs import write_scene
from shadowbench.experiments import _paper, figure2, figure11
from shadowbench.experiments.claims import CLAIMS
from shadowbench.harness.commands.show import show
from shadowbench.harness.errors import UserError
from shadowbench.harness.figures import ablation, claims, points, stages, two_lights
from shadowbench.harness.figures import figure11 as figure11_drawing
from shadowbench.harness.lighting import Lighting
from shadowbench.harness.maps import map_path, write_map
from shadowbench.harness.plan import check_entries, experiment_names, find_experiment, find_preset
from shadowbench.harness.progress import Silent
from shadowbench.harness.run import Options, Run
from shadowbench.harness.scenes.catalogue import scene_names

OWN = ("figure2", "figure6", "figure9", "figure10", "figure11", "two_lights", "moving", "ablation")


# --- declarations -------------------------------------------------------------------------------------------


def test_every_experiment_of_the_paper_is_there_and_helpers_are_not():
    assert set(OWN) | {"table1", "claims"} <= set(experiment_names())
    assert not [name for name in experiment_names() if name.startswith("_")]


@pytest.mark.parametrize("name", OWN)
def test_declarations_are_valid(name):
    declared = find_experiment(name)
    assert declared.name == name
    assert set(declared.presets) == {"quick", "paper"}
    for preset in declared.presets.values():
        check_entries(preset.methods)
        labels = [entry.label or entry.method for entry in preset.methods]
        assert len(set(labels)) == len(labels), "labels tell the lines of a drawing apart"
        assert set(preset.scenes) <= set(scene_names())
        names = [lighting.label for lighting in preset.lightings]
        assert len(set(names)) == len(names)
    assert (declared.presets["paper"].width, declared.presets["paper"].height) == (1024, 1024)


def test_what_the_issue_asks_of_figure_11():
    quick = find_experiment("figure11").presets["quick"]
    assert quick.scenes == ("cloth",)
    assert quick.frames == 3
    assert [x.distance for x in quick.lightings][-1] == 1e7
    assert len(quick.lightings) == 5
    fine = [e.settings for e in quick.methods if e.settings["precision"] == "float64"]
    assert {(s["clamp"], s["aimed"]) for s in fine} == {
        (c, a) for c in ("none", "hits") for a in ("true", "false")
    }
    assert len({s["r"] for s in fine}) == 4
    assert len(fine) == 16


def test_direct_and_indirect_mapping_trace_with_blocks_of_one_size():
    blocks = [int(e.settings["tile"]) * int(e.settings["k"]) for e in figure2.METHODS]
    assert len(set(blocks)) == 1
    assert len({e.settings["tile"] for e in figure2.METHODS}) == len(blocks)


def test_an_experiment_without_presets_says_what_to_do():
    with pytest.raises(UserError, match="claims measures nothing; run the others"):
        find_preset(find_experiment("claims"), None, "cpu")


# --- drawings from made-up records --------------------------------------------------------------------------


def made(
    name,
    entry,
    scene="cloth",
    lighting=None,
    ms=10.0,
    counters=None,
    status="ok",
    size=64,
    frames=1,
    passes=(),
):
    """A record as a run would write it; ``passes``: (name, part, ms)."""
    passes = passes or [("build", "build", ms * 0.2), ("primary rays", "trace", ms * 0.3),
                        ("light 0: count", "light build", ms * 0.1),
                        ("light 0: shadow rays", "shadow", ms * 0.4)]  # fmt: skip
    lighting = lighting or Lighting()
    lights = [{}] * max(1, lighting.count)
    one = {
        "total_ms": [ms, ms * 1.02], "wall_ms": [ms, ms], "round": [0, 0], "regrown": 0, "started": [0.0],
        "stage_round": [0], "stopped_by": ["samples"], "memory_bytes": 1, "counters": counters or {},
        "score": {"true_errors": 0, "excused_share": 0.0, "check": "ok", "primary": {"pixels": 4}, "shadow": []},
        "unscored": None, "shadow_rays": 100,
        "passes": [{"name": n, "part": p, "ms": [x]} for n, p, x in passes],
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


def keep(folder, records):
    place = folder / "records"
    place.mkdir(parents=True, exist_ok=True)
    for r in records:
        (place / f"{r['key']}.json").write_text(json.dumps(r))
    return folder


def test_figure2_says_how_much_the_most_drops(tmp_path):
    records = [
        made("figure2", e, "buddha", ms=ms, counters={"primary tests, most": most})
        for e, ms, most in zip(figure2.METHODS, (14.0, 10.0, 9.0), (1000, 400, 200), strict=True)
    ]
    keep(tmp_path, records)
    for r, most in zip(records, (1000, 400, 200), strict=True):
        write_map(map_path(tmp_path, r["key"], 0), np.array([[0, most], [most // 2, 1]]))
    files = show("figure2", tmp_path, quiet=True)
    text = (tmp_path / "figure2.md").read_text()
    assert "at most 400 triangles for a pixel against 1,000" in text
    assert "40% of it" in text
    assert "40% faster" in text
    assert all(file.exists() for file in files)
    with Image.open(tmp_path / "figure2-buddha.png") as image:
        assert image.width > 400
        # The one colour scale makes the direct map's hottest pixel brighter than any of the indirect one.
        pixels = np.asarray(image.convert("RGB")).astype(int)
    yellow = (pixels[..., 0] > 200) & (pixels[..., 1] > 200) & (pixels[..., 2] < 80)
    half = pixels.shape[1] // 2
    maps = yellow[: int(pixels.shape[0] * 0.7)]
    assert maps[:, :half].sum() > 100
    assert maps[:, half:].sum() == 0


def test_figure2_without_its_maps_says_so(tmp_path):
    keep(tmp_path, [made("figure2", figure2.METHODS[0], "buddha")])
    with pytest.raises(UserError, match="run figure2 again"):
        show("figure2", tmp_path, quiet=True)


def staged(scene, rearranged):
    passes = [("camera grid: sort pairs", "build", 1.0), ("primary rays", "trace", 2.0),
              ("light 0: map rays", "shadow", rearranged / 2), ("light 0: sort rays", "shadow", rearranged / 2),
              ("light 0: count", "light build", 1.5), ("light 0: shadow rays", "shadow", 3.0)]  # fmt: skip
    entry = _paper.faithful("paper-faithful")
    return made("figure10", entry, scene, ms=7.5 + rearranged, passes=passes, counters={"light 0 rays": 1000})


def test_figure10_counts_every_pass_once_and_judges_the_spread(tmp_path):
    keep(tmp_path, [staged(scene, 1.0 + 0.01 * i) for i, scene in enumerate(("fairy", "sibenik", "cloth"))])
    show("figure10", tmp_path, quiet=True)
    text = (tmp_path / "figure10.md").read_text()
    assert 'for all models" holds here' in text
    assert "longer than primary traversal on 3 of 3" in text
    rows = [points.row(json.loads(p.read_text())) for p in sorted((tmp_path / "records").glob("*.json"))]
    from shadowbench.experiments.figure10 import STAGES

    for r in rows:
        stages.add(r, STAGES)
        assert r["other_ms"] == pytest.approx(0.0, abs=1e-9)
        assert r["shadow_traversal_ms"] == pytest.approx(3.0)
    keep(tmp_path, [staged(scene, 1.0 + 4.0 * i) for i, scene in enumerate(("fairy", "sibenik", "cloth"))])
    show("figure10", tmp_path, quiet=True)
    assert "does not hold here" in (tmp_path / "figure10.md").read_text()


def distance_records():
    preset = find_experiment("figure11").presets["quick"]
    records = []
    for lighting in preset.lightings:
        for e in preset.methods:
            lost = e.settings["precision"] == "float32" and lighting.distance > 1e4
            grows = e.settings["clamp"] == "none" and lighting.distance >= 10
            ms = 10.0 * (1.0 + grows * int(e.settings["r"]) / 32)
            counted = {"light 0 pairs": 1000, "light 0 chunks": 50, "light 0 lanes": 50 * int(e.settings["r"]),
                       "light 0 rays": 1600}  # fmt: skip
            records.append(
                made(
                    "figure11",
                    e,
                    lighting=lighting,
                    ms=ms,
                    counters=counted,
                    status="rejected" if lost else "ok",
                )
            )
    return records


def test_figure11_tells_work_from_number_format(tmp_path):
    keep(tmp_path, distance_records())
    files = show("figure11", tmp_path, quiet=True)
    text = (tmp_path / "figure11.md").read_text()
    assert (
        "unclamped, aimed, float64: shadow traversal with the light 10 radii away or more, over that" in text
    )
    assert "2.00 (r = 32), 3.00 (r = 64), 5.00 (r = 128), 9.00 (r = 256)" in text
    assert "clamped to the hits, world axes, float64" in text
    assert "1.00 (r = 32)" in text
    assert "rejected from 1e7 radii on" in text
    assert "needs 9 pairs" in text
    drawn = (tmp_path / "figure11.svg").read_text()
    for word in (
        "r = 32",
        "r = 256",
        "float32",
        "not measured",
        "scene radii",
        "shadow traversal, ms",
        "stand-in",
    ):
        assert word in drawn, word
    assert "lane fill" in (tmp_path / "figure11-r.svg").read_text()
    assert all(file.stat().st_size < 300_000 for file in files)
    lines = (tmp_path / "figure11.csv").read_text().splitlines()
    assert len(lines) == 1 + 100
    assert {"lane_fill", "chunks", "traversal_ms", "light_distance"} <= set(lines[0].split(","))


def test_lane_fill_is_rays_over_lanes():
    r = points.row(distance_records()[0])
    figure11_drawing.add(r, figure11.TRAVERSAL)
    assert r["lane_fill"] == pytest.approx(1600 / (50 * r["r"]))
    assert r["axes"] in figure11_drawing.AXES.values()


def test_two_lights_states_frames_a_second_and_the_slope(tmp_path):
    preset = find_experiment("two_lights").presets["quick"]
    keep(tmp_path, [
        made("two_lights", e, "fairy", x, ms=4.0 + 6.0 * x.count) for e in preset.methods for x in preset.lightings
    ])  # fmt: skip
    show("two_lights", tmp_path, quiet=True)
    text = (tmp_path / "two_lights.md").read_text()
    assert "two lights 16.2 ms, 61.9 frames a second (+60% for the second light)" in text
    assert "from 1 to 16 lights each adds 6.06 ms" in text
    assert "7.6 frames a second against 5.26" in text
    assert "number of lights" in (tmp_path / "two_lights-fairy.svg").read_text()
    rows = [{"light_count": n, "total_ms": 3.0 + 2.0 * n} for n in (1, 2, 8)]
    assert two_lights.slope(rows) == pytest.approx(2.0)


def test_moving_has_a_row_a_frame(tmp_path):
    preset = find_experiment("moving").presets["quick"]
    records = [
        made("moving", e, s, preset.lightings[0], frames=8)
        for e in preset.methods
        for s in ("cloth", "fairy")
    ]
    for i, frame in enumerate(records[0]["frames"]):
        frame["total_ms"] = [10.0 + i] * 2
    keep(tmp_path, records)
    show("moving", tmp_path, quiet=True)
    lines = (tmp_path / "moving.csv").read_text().splitlines()
    assert len(lines) == 1 + 8 * len(records)
    assert (
        "10.0 to 17.0 ms over 8 places of the light (slowest +70% over fastest)"
        in (tmp_path / "moving.md").read_text()
    )
    assert "turns of the light" in (tmp_path / "moving.svg").read_text()


def test_what_a_stopped_run_did_not_come_to_is_told(tmp_path):
    entries = find_experiment("ablation").presets["quick"].methods[:3]
    records = [made("ablation", e, "cloth", ms=10.0) for e in entries]
    keep(tmp_path, [*records, *(made("ablation", e, "buddha", ms=10.0) for e in entries[:1])])
    show("ablation", tmp_path, quiet=True)
    text = (tmp_path / "ablation.md").read_text()
    assert f"no record of {entries[1].label}, {entries[2].label}" in text
    assert text.count("no record of") == 1


def test_ablation_compares_with_its_base_on_the_same_scene(tmp_path):
    declared = find_experiment("ablation")
    entries = declared.presets["quick"].methods
    records = []
    for scene, base in (("cloth", 10.0), ("buddha", 40.0)):
        for i, e in enumerate(entries):
            lost = "culled" in e.label and scene == "cloth"
            records.append(
                made("ablation", e, scene, ms=base * (1 + 0.1 * i), status="skipped" if lost else "ok")
            )
    keep(tmp_path, records)
    show("ablation", tmp_path, quiet=True)
    text = (tmp_path / "ablation.md").read_text()
    assert "direct mapping, 16x16 tiles 1.10 (2 scenes)" in text
    assert "back faces culled, primary 1.90 (1 scene)" in text
    assert "Not measured" in text
    assert len((tmp_path / "ablation.csv").read_text().splitlines()) == 1 + len(records)
    rows = [{"label": "a", "ratio": 0.5, "scene": "x"}, {"label": "a", "ratio": 2.0, "scene": "y"}]
    assert ablation.mean_ratios(rows)["a"] == pytest.approx(1.0)


# --- claims -------------------------------------------------------------------------------------------------


def judged(folder):
    show("claims", folder, quiet=True)
    return {r["claim"]: r for r in claims.judge_all(CLAIMS, claims.collect(folder))}


def test_every_claim_has_a_verdict_and_says_what_is_missing(tmp_path):
    keep(tmp_path / "a", [made("figure2", figure2.METHODS[0], "buddha")])
    found = judged(tmp_path)
    assert len(found) == len(CLAIMS)
    assert {r["verdict"] for r in found.values()} == {claims.OPEN}
    assert all("run " in r["numbers"] for r in found.values())
    assert (tmp_path / "claims.md").read_text().count("**can't tell**") == len(CLAIMS)
    with pytest.raises(UserError, match="no records in it"):
        show("claims", tmp_path / "a" / "records", quiet=True)


def test_claims_follow_the_records(tmp_path):
    entries = {e.label: e for e in find_experiment("ablation").presets["paper"].methods}

    def ablated(label, ms, scene="cloth", **counters):
        return made("ablation", entries[label], scene, ms=ms, counters=counters)

    base = "paper-faithful"
    keep(tmp_path / "ablation", [ablated(base, 10.0), ablated("light not clamped", 20.0), ablated("cube map", 8.0),
                                 ablated("two-angle map", 11.0), ablated("direct mapping, 16x16 tiles", 10.1),
                                 ablated("4x4 of 4x4 tiles", 10.2)])  # fmt: skip
    keep(tmp_path / "figure2", [made("figure2", e, "buddha", ms=ms, counters={"primary tests, most": most})
                                for e, ms, most in zip(figure2.METHODS[:2], (14.0, 10.0), (9, 5), strict=True)])  # fmt: skip
    found = judged(tmp_path)
    assert found["Clamping the light's rectangle to the view helps"]["verdict"] == claims.HOLDS
    assert found["A spherical map is better than a cube map"]["verdict"] == claims.FAILS
    assert found["2x2 sorting tiles in a tracing tile are best"]["verdict"] == claims.OPEN
    assert found["Indirect mapping makes Buddha 30-50 % faster"]["verdict"] == claims.HOLDS
    dropped = next(r for text, r in found.items() if "drop by more than half" in text)
    assert dropped["verdict"] == claims.FAILS
    assert "56%" in dropped["numbers"]


def test_our_own_claim_is_judged_within_one_run(tmp_path):
    entries = {e.label: e for e in find_experiment("frame_time").presets["paper"].methods}
    ours = next(e for e in entries.values() if e.method == _paper.METHOD)
    scenes = (("cloth", 1.5), ("fairy", 2.5))
    records = [made("frame_time", ours, scene, ms=ms) for scene, ms in scenes]
    records += [made("frame_time", entries["mesh rebuilt"], scene, ms=2.0) for scene, _ in scenes]
    (found,) = [
        r for text, r in judged(keep(tmp_path / "a", records).parent).items() if text.startswith("Ours")
    ]
    assert found["verdict"] == claims.FAILS
    assert "1 of 2 scenes; our time over the tree's: cloth 0.75, fairy 1.25" in found["numbers"]


def test_scenes_of_one_name_are_told_apart_and_the_run_of_more_frames_is_taken(tmp_path):
    """A real mesh beside the stand-in of its name; another run of fewer frames, though it came later."""
    entries = {e.label: e for e in find_experiment("frame_time").presets["paper"].methods}
    ours = next(e for e in entries.values() if e.method == _paper.METHOD)

    def pair(ms, scene="cloth", title="", frames=1, started=0.0):
        records = [
            made("frame_time", entry, scene, ms=m)
            for entry, m in ((ours, ms), (entries["mesh rebuilt"], 2.0))
        ]
        for record in records:
            record["scene"]["title"] = title or record["scene"]["title"]
            record["frames"][0]["started"] = [started]
            record["frames"] = [{**record["frames"][0], "frame": k} for k in range(frames)]
        return records

    keep(tmp_path / "a", [*pair(1.0, frames=2, started=1.0), *pair(1.2, "sibenik")])
    keep(tmp_path / "b", pair(1.6, started=2.0))
    keep(tmp_path / "c", pair(1.8, "sibenik", "sibenik.ply"))
    (found,) = [r for text, r in judged(tmp_path).items() if text.startswith("Ours")]
    assert "Sibenik (stand-in) 0.60, cloth 0.50, sibenik.ply 0.90" in found["numbers"]


def test_records_of_a_later_version_of_ours_stand_in_and_the_older_are_named(tmp_path):
    entries = {e.label: e for e in find_experiment("frame_time").presets["paper"].methods}
    ours = next(e for e in entries.values() if e.method == _paper.METHOD)
    best = find_experiment("ablation").presets["paper"].methods[-1]

    def version(record, source, started):
        record["method"]["source_sha256"] = source
        record["frames"][0]["started"] = [started]
        return record

    old = version(made("frame_time", ours, "cloth", ms=3.0), "old", 1.0)
    keep(tmp_path / "a", [old, made("frame_time", entries["mesh rebuilt"], "cloth", ms=2.0)])
    keep(tmp_path / "b", [version(made("ablation", best, "cloth", ms=1.0), "new", 2.0)])
    (found,) = [r for text, r in judged(tmp_path).items() if text.startswith("Ours")]
    assert found["verdict"] == claims.HOLDS
    assert (
        "cloth 0.50; ours of ablation, a later version than in frame_time and not of one run"
        in found["numbers"]
    )
    text = (tmp_path / "claims.md").read_text()
    assert f"Records of an earlier version of {_paper.METHOD}: frame_time." in text


def test_a_cpu_decides_nothing_about_times(tmp_path):
    records = [made("figure2", e, "buddha", ms=ms, counters={"primary tests, most": most})
               for e, ms, most in zip(figure2.METHODS[:2], (14.0, 10.0), (9, 4), strict=True)]  # fmt: skip
    for r in records:
        r["method"].update(device="cpu")
    keep(tmp_path / "figure2", records)
    found = judged(tmp_path)
    assert found["Indirect mapping makes Buddha 30-50 % faster"]["verdict"] == claims.OPEN
    assert "40% faster" in found["Indirect mapping makes Buddha 30-50 % faster"]["numbers"]
    dropped = next(r for text, r in found.items() if "drop by more than half" in text)
    assert dropped["verdict"] == claims.HOLDS


# --- the experiments themselves, at 16 x 16 -----------------------------------------------------------------

CUT = {
    "figure10": (lambda e: True, 1),
    "figure11": (lambda e: e.settings["r"] == "64" and e.settings["clamp"] == "none", 2),
    "ablation": (lambda e: e.label in ("paper-faithful", "cube map", "back faces culled, primary"), 1),
    "two_lights": (lambda e: e.label.endswith("best") or e.method == "bvh", 2),
    "moving": (lambda e: e.method in (_paper.METHOD, "bvh"), 1),
}
"""Which entries and how many lightings are run of an experiment that has many."""


@pytest.mark.parametrize("name", OWN)
def test_each_experiment_runs_and_draws(name, tmp_path):
    declared = find_experiment(name)
    wanted, count = CUT.get(name, (lambda e: True, 99))
    quick = declared.presets["quick"]
    tiny = dataclasses.replace(
        quick, width=16, height=16, scenes=(write_scene(tmp_path / "tetra.obj"),), samples=1, most=1, stage_samples=1,
        rounds=1, methods=tuple(e for e in quick.methods if wanted(e)), lightings=quick.lightings[:count],
    )  # fmt: skip
    out = tmp_path / "out"
    records = Run(Options(declared, "quick", tiny, "cpu", out, score=False), Silent()).go()
    assert len(records) == len(tiny.methods) * len(tiny.lightings)
    assert {r["status"] for r in records} <= {"ok", "skipped"}, [r["reason"] for r in records]
    assert sum(r["status"] == "ok" for r in records) >= len(records) - 2
    files = show(name, out, quiet=True)
    assert {f"{name}.csv", f"{name}.md"} <= {file.name for file in files}
    assert any(file.suffix in (".svg", ".png") for file in files) or name == "figure2"
    assert all(file.stat().st_size > 0 for file in files)
    if name == "figure2":
        assert len(list((out / "maps").glob("*.png"))) == len(records)
    if name == "figure6":
        rays = {
            r["scene"]["lighting"].get("label", ""): r["frames"][0]["counters"]["light 0 rays"]
            for r in records
        }
        assert rays[""] > 0
        assert rays["spot"] < rays[""], "the tetrahedron does not stand where the spot looks"
    if name == "moving":
        assert all(len(r["frames"]) == 8 for r in records)
