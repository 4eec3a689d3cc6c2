"""What experiments draw and say, from made-up records."""

from __future__ import annotations

import csv
import json

import numpy as np
import pytest
from helpers.made_records import keep, made
from PIL import Image
from shadowbench.experiments import _paper, figure2, figure6, figure11
from shadowbench.experiments._figures import figure2 as figure2_drawing
from shadowbench.experiments._figures import figure6 as figure6_drawing
from shadowbench.experiments._figures import figure10 as stages
from shadowbench.experiments._figures import figure11 as figure11_drawing
from shadowbench.experiments._figures import two_lights
from shadowbench.harness.commands.show import show
from shadowbench.harness.errors import UserError
from shadowbench.harness.report import points
from shadowbench.harness.results.pixel_maps import map_path, write_map
from shadowbench.harness.runner.experiment import Entry, find_experiment
from shadowbench.harness.scene.overrides import Lighting


def test_figure2_says_how_much_the_most_drops(tmp_path):
    counted = {figure2.DIRECT: (14.0, 1000), figure2.INDIRECT: (10.0, 400), figure2.DIRECT_SMALL: (8.0, 500)}
    for e in figure2.METHODS:
        ms, most = counted.get(e.label, (9.0, 200))
        r = made("figure2", e, "buddha", ms=ms, counters={"primary tests, most": most})
        keep(tmp_path, [r])
        write_map(map_path(tmp_path, r["key"], 0), np.array([[0, 0, 0], [0, 0, most], [0, most // 2, 1]]))
    files = show("figure2", tmp_path, quiet=True)
    text = (tmp_path / "figure2.md").read_text()
    assert "indirect, 2x2 of 8x8 (at most 400 triangles for a pixel" in text
    large, small = (text.index(f"Against {label}") for label in (figure2.DIRECT, figure2.DIRECT_SMALL))
    assert "40% of the maximum, and primary rays are traced 40% faster" in text[large:small]
    assert "80% of the maximum, and primary rays are traced 20% slower" in text[small:]
    table = list(csv.DictReader((tmp_path / "figure2.csv").open()))
    (ours,) = (r for r in table if r["label"] == figure2.INDIRECT)
    assert [float(ours[f"{x}_same_tiles"]) for x in ("speed_up", "most_share")] == pytest.approx([-0.2, 0.8])
    assert all(file.exists() for file in files)
    with Image.open(tmp_path / "figure2-buddha.png") as image:
        assert image.width > 400
        # The one colour scale makes the first map's hottest pixel brighter than any of the others.
        pixels = np.asarray(image.convert("RGB")).astype(int)
    yellow = (pixels[..., 0] > 200) & (pixels[..., 1] > 200) & (pixels[..., 2] < 80)
    third = pixels.shape[1] // 3
    maps = yellow[: int(pixels.shape[0] * 0.7)]
    assert maps[:, :third].sum() > 100
    assert maps[:, third:].sum() == 0
    # Nothing is checked in the first row and column of any map: they are cut off.
    part = figure2_drawing.occupied([np.array([[0, 0, 0], [0, 0, 7]]), np.array([[0, 0, 0], [0, 5, 0]])])
    assert part == (slice(1, 2), slice(1, 3))
    assert figure2_drawing.occupied([np.zeros((2, 3))]) == (slice(0, 2), slice(0, 3))


def test_figure2_without_its_maps_says_so(tmp_path):
    keep(tmp_path, [made("figure2", figure2.METHODS[0], "buddha")])
    with pytest.raises(UserError, match="run figure2 again"):
        show("figure2", tmp_path, quiet=True)


def test_figure6_has_a_captioned_panel_for_each_light(tmp_path):
    counted = {"": 1000, "cone": 250, "rectangle": 300, "cone-fall-off": 400}
    for lighting in figure6.LIGHTINGS:
        rays = {"light 0 rays": counted[lighting.label]}
        keep(tmp_path, [made("figure6", figure6.METHODS[0], "fairy", lighting, counters=rays)])
        name = f"fairy-{lighting.label}" if lighting.label else "fairy"
        (tmp_path / "images").mkdir(exist_ok=True)
        # A square picture with a caption below it, which the sheet has but once.
        Image.new("RGB", (512, 560), (200, 30, 30)).save(tmp_path / "images" / f"{name}.png")
    show("figure6", tmp_path, quiet=True)
    text = (tmp_path / "figure6.md").read_text()
    order = ["cone of 12 degrees: 250 of 1,000 hit points (25%)", "rectangle of 18 x 8 degrees: 300 of 1,000",
             "cone of 20 degrees, falling off to 10%: 400 of 1,000"]  # fmt: skip
    assert [text.index(words) for words in order] == sorted(text.index(words) for words in order)
    with Image.open(tmp_path / "figure6-fairy.png") as image:
        red = (np.asarray(image.convert("RGB")).astype(int) - (200, 30, 30) == 0).all(axis=2)
    assert red.sum() == 4 * figure6_drawing.PANEL**2
    table = list(csv.DictReader((tmp_path / "figure6.csv").open()))
    assert [r["spot"] for r in table] == ["", "cone", "rectangle", "cone"]
    assert [r["spot_rise"] for r in table] == ["", "", "4", ""]


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


def test_figure10_draws_the_largest_size_and_tells_how_rearrangement_grows(tmp_path):
    scenes = ("fairy", "sibenik", "cloth")
    small = [staged(scene, 1.0) for scene in scenes]
    for r in small:
        r["point"].update(width=32, height=32)
        r["key"] += "-small"
    keep(tmp_path, [*(staged(scene, 1.6) for scene in scenes), *small])
    show("figure10", tmp_path, quiet=True)
    text = (tmp_path / "figure10.md").read_text()
    assert (
        "From 32x32 to 64x64, 4 times the pixels, ray mapping and rearrangement takes 1.6 times as long"
        in text
    )
    assert "geometric mean of 3 scenes" in text
    assert "primary traversal 1.0" in text
    assert "1.60 to 1.60 ms over 3 scenes" in text
    assert (tmp_path / "figure10.svg").read_text().count("Cloth (stand-in)") == 1
    # Other frames at the other size: nothing is said of it.
    for r in small:
        r["frames"][0]["frame"] = 5
    keep(tmp_path, small)
    show("figure10", tmp_path, quiet=True)
    assert "times the pixels" not in (tmp_path / "figure10.md").read_text()


def distance_records():
    preset = find_experiment("figure11").presets["quick"]
    records = []
    for lighting in preset.lightings:
        for e in preset.methods:
            lost = e.settings["precision"] == "float32" and lighting.distance > 1e4
            grows = e.settings["clamp"] == "none" and lighting.distance >= 10
            r = int(e.settings["r"])
            ms = 10.0 * (1.0 + grows * (20 if r == 65536 else r / 32))
            ms *= 1.1 if e.settings["precision"] == "float32-centred" else 1.0
            tiles = 4 if grows else 900
            counted = {"light 0 pairs": 1000, "light 0 chunks": 50, "light 0 lanes": 50 * r,
                       "light 0 rays": 1600, "light 0 tiles with rays": tiles}  # fmt: skip
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
    assert "2.00 (r = 32), 3.00 (r = 64), 5.00 (r = 128), 21.00 (r = 65536)" in text
    assert "tiles that hold rays: 900 at 0.1, 900 at 1, 4 at 10, 4 at 1000, 4 at 1e7" in text
    without = "without load balancing (r = 65536), over the fastest r: 1.00 at 0.1, 1.00 at 1, 10.50 at 10"
    assert without in text
    assert "clamped to the hits, world axes, float64" in text
    assert "1.00 (r = 32)" in text
    assert "clamped to the hits, world axes: in float32 1.0 times the frame time" in text
    assert "; rejected at 1e7 radii." in text
    assert "unclamped, aimed: in float32-centred 1.1 times the frame time and 1.0 times the pairs" in text
    assert (
        "workload alone, times 2.00 unclamped and 1.00 clamped to the hits; what changes at the same place and workload "
        "is number format: in float32 frames take 1.00 times as long or are rejected (from 1e7 radii on); in "
        "float32-centred frames take 1.10 times as long, none is rejected." in text
    )
    assert "needs 9 pairs" in text
    drawn = (tmp_path / "figure11.svg").read_text()
    for word in (
        "r = 32",
        "r = 65536 (no balancing)",
        "float32, r = 64",
        "float32-centred, r = 64",
        "rejected (float32)",
        "scene radii",
        "shadow traversal, ms",
        "stand-in",
    ):
        assert word in drawn, word
    assert "not measured" not in drawn
    assert "lane fill" in (tmp_path / "figure11-r.svg").read_text()
    tiles = (tmp_path / "figure11-tiles.svg").read_text()
    for word in (
        "tiles that hold rays",
        "world axes, float32",
        "aimed, float32-centred",
        "rejected (float32)",
    ):
        assert word in tiles, word
    assert all(file.stat().st_size < 300_000 for file in files)
    lines = (tmp_path / "figure11.csv").read_text().splitlines()
    assert len(lines) == 1 + 110
    assert {
        "lane_fill",
        "chunks",
        "traversal_ms",
        "light_distance",
        "tiles_with_rays",
        "without_balancing",
    } <= set(lines[0].split(","))


def test_lane_fill_is_rays_over_lanes():
    r = points.row(distance_records()[0])
    figure11_drawing.add(r, figure11.TRAVERSAL)
    assert r["lane_fill"] == pytest.approx(1600 / (50 * r["r"]))
    assert r["axes"] in figure11_drawing.AXES.values()


def test_two_lights_states_frames_a_second_and_what_each_further_light_costs(tmp_path):
    preset = find_experiment("two_lights").presets["quick"]

    def lit(e, lighting):
        """4 ms for what every frame needs, 8 for the first light, 2 less for each further one."""
        light = 8.0 + 6.0 * (lighting.count - 1)
        passes = [("build", "build", 1.0), ("primary rays", "trace", 3.0), ("light 0: count", "light build", light / 4),
                  ("light 0: shadow rays", "shadow", light * 0.75)]  # fmt: skip
        return made("two_lights", e, "fairy", lighting, ms=(4.0 + light) / 1.01, passes=passes)

    keep(tmp_path, [lit(e, x) for e in preset.methods for x in preset.lightings])
    show("two_lights", tmp_path, quiet=True)
    text = (tmp_path / "two_lights.md").read_text()
    assert "two lights 18.0 ms, 55.6 frames a second (+50% for the second light)" in text
    assert (
        "the first light costs 8.00 of 12.0 ms; each further one, over the first: 0.75 (of 2), 0.75 (of 4)"
        in text
    )
    assert "0.75 (of 16)" in text
    assert "7.6 frames a second against 5.26" in text
    assert "number of lights" in (tmp_path / "two_lights-fairy.svg").read_text()
    header = (tmp_path / "two_lights.csv").read_text().splitlines()[0].split(",")
    assert {"further_ms", "further_over_first"} <= set(header)
    # The frames' noise is no light's.
    line = [
        {"light_count": n, "total_ms": 90.0 - n, "light_build_ms": 1.0 * n, "shadow_ms": 2.0 + n}
        for n in (1, 2, 8)
    ]
    two_lights.add_further(line)
    assert [r.get("further_over_first") for r in line] == [None, pytest.approx(0.5), pytest.approx(0.5)]
    keep(tmp_path / "one", [lit(preset.methods[0], preset.lightings[1])])
    show("two_lights", tmp_path / "one", quiet=True)
    assert "over the first" not in (tmp_path / "one" / "two_lights.md").read_text()


def test_what_a_stopped_run_did_not_come_to_is_told(tmp_path):
    entries = find_experiment("ablation").presets["quick"].methods[:3]
    records = [made("ablation", e, "cloth", ms=10.0) for e in entries]
    keep(tmp_path, [*records, *(made("ablation", e, "buddha", ms=10.0) for e in entries[:1])])
    show("ablation", tmp_path, quiet=True)
    text = (tmp_path / "ablation.md").read_text()
    assert f"no record of {entries[1].label}, {entries[2].label}" in text
    assert text.count("no record of") == 1


def test_lightings_with_points_of_their_own_are_missed_by_nobody_and_miss_none(tmp_path):
    few, many = [Entry("bvh", {}, "a")], [Entry("bvh", {}, "a"), Entry("ray_grids", {}, "b")]
    near, far = Lighting("near", distance=1.0), Lighting("far", distance=9.0)
    keep(tmp_path, [made("figure11", e, lighting=near) for e in many])
    keep(tmp_path, [made("figure11", e, lighting=far) for e in few])
    rows = points.rows(tmp_path)
    assert points.not_measured(rows) == ["Cloth (stand-in), far: no record of b"]
    assert points.not_measured(rows, apart=["far"]) == []


@pytest.mark.filterwarnings("error::UserWarning")
def test_stages_that_add_up_to_more_than_the_frame_stay_within_the_drawing(tmp_path):
    (entry,) = find_experiment("figure10").presets["quick"].methods
    passes = [
        ("build", "build", 400.0),
        ("primary rays", "trace", 900.0),
        ("light 0: shadow rays", "shadow", 900.0),
    ]
    keep(tmp_path, [made("figure10", entry, "cloth", ms=10.0, passes=passes, counters={"light 0 rays": 9})])
    show("figure10", tmp_path, quiet=True)
    assert (tmp_path / "figure10.svg").stat().st_size > 0
