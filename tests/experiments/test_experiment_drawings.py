"""What experiments draw and say, from made-up records."""

import numpy as np
import pytest
from helpers.experiment_records import csv_of, record_of, report_of, write_records
from PIL import Image
from shadowbench.experiments import figure2, figure6, figure10, figure11
from shadowbench.harness.errors import UserError
from shadowbench.harness.report import document
from shadowbench.harness.results.folder import image_name
from shadowbench.harness.results.pixel_maps import map_path, write_map
from shadowbench.harness.runner.planning.experiment import Entry, find_experiment
from shadowbench.harness.scene.overrides import Lighting


def test_figure2_says_how_much_the_most_drops(tmp_path):
    counted = {figure2.DIRECT: (14.0, 1000), figure2.INDIRECT: (10.0, 400), figure2.DIRECT_SMALL: (8.0, 500)}
    for e in figure2.METHODS:
        ms, most = counted.get(e.label, (9.0, 200))
        r = record_of("figure2", e, "buddha", ms=ms, counters={"primary tests, most": most})
        write_records(tmp_path, [r])
        write_map(map_path(tmp_path, r["key"], 0), np.array([[0, 0, 0], [0, 0, most], [0, most // 2, 1]]))
    text = report_of("figure2", tmp_path)
    told = "blocks of {}: {} as many triangles checked for the costliest pixel, primary rays traced {} times as fast"
    assert told.format("16x16 pixels", "40%", "1.40") in text
    assert told.format("8x8", "80%", "0.800") in text
    (ours,) = (r for r in csv_of("figure2", tmp_path) if r["label"] == figure2.INDIRECT)
    assert [float(ours[f"{x}_same_tiles"]) for x in ("speed_up", "most_share")] == pytest.approx([-0.2, 0.8])
    with Image.open(tmp_path / "figure2-buddha.png") as image:
        assert image.width > 400
        # The one colour scale makes the first map's hottest pixel brighter than any of the others.
        pixels = np.asarray(image.convert("RGB")).astype(int)
    yellow = (pixels[..., 0] > 200) & (pixels[..., 1] > 200) & (pixels[..., 2] < 80)
    third = pixels.shape[1] // 3
    maps = yellow[: int(pixels.shape[0] * 0.7)]
    assert maps[:, :third].sum() > 100
    assert maps[:, third:].sum() == 0


def test_figure2_without_its_maps_says_so(tmp_path):
    with pytest.raises(UserError, match="run figure2 again"):
        report_of("figure2", tmp_path, [record_of("figure2", figure2.METHODS[0], "buddha")])


def test_figure6_has_a_captioned_panel_for_each_light(tmp_path):
    counted = {"": 1000, "cone": 250, "rectangle": 300, "cone-fall-off": 400}
    for lighting in figure6.LIGHTINGS:
        rays = {"light 0 rays": counted[lighting.label]}
        r = record_of("figure6", figure6.METHODS[0], "fairy", lighting, counters=rays)
        write_records(tmp_path, [r])
        (tmp_path / "images").mkdir(exist_ok=True)
        # A square picture with a caption below it, which the sheet has but once.
        name = image_name(r["scene"]["name"], lighting.label, r["point"]["width"], r["point"]["height"])
        Image.new("RGB", (512, 560), (200, 30, 30)).save(tmp_path / "images" / name)
    assert "leaves 25% of the hit points a shadow ray and takes" in report_of("figure6", tmp_path)
    with Image.open(tmp_path / "figure6-fairy.png") as image:
        red = (np.asarray(image.convert("RGB")).astype(int) - (200, 30, 30) == 0).all(axis=2)
    across = [0, *red.any(axis=0).astype(int), 0]
    down = [0, *red.any(axis=1).astype(int), 0]
    assert (np.diff(across) == 1).sum() == (np.diff(down) == 1).sum() == 2, "two by two, none with its own caption"
    assert red.sum() > 4 * 300**2
    table = csv_of("figure6", tmp_path)
    assert [r["spot"] for r in table] == ["", "cone", "rectangle", "cone"]
    assert [r["light"] for r in table] == [
        "everywhere", "cone of 12 degrees", "rectangle of 18 x 8 degrees", "cone of 20 degrees, falling off to 10%"
    ]  # fmt: skip
    assert [(r["hit_pixels"], r["shadow_rays"]) for r in table] == [("1000", f"{n}") for n in counted.values()]
    assert [r["light.rise"] for r in table] == ["", "", "4", ""]


def distance_records(scene="cloth", growth=1.0):
    preset = find_experiment("figure11").presets["quick"]
    records = []
    for lighting in preset.lightings:
        for e in preset.methods:
            lost = e.settings["precision"] == "float32" and lighting.distance > 1e4
            grows = e.settings["clamp"] == "none" and lighting.distance >= 10
            r = int(e.settings["r"])
            ms = 10.0 * (1.0 + grows * growth * (20 if r == 65536 else r / 32))
            ms *= 1.1 if e.settings["precision"] == "float32-centred" else 1.0
            tiles = 4 if grows else 900
            counted = {"light 0 pairs": 1000, "light 0 chunks": 50, "light 0 lanes": 50 * r,
                       "light 0 rays": 1600, "light 0 tiles with rays": tiles}  # fmt: skip
            status = "rejected" if lost else "ok"
            records.append(record_of("figure11", e, scene, lighting, ms=ms, counters=counted, status=status))
    return records


def test_figure11_of_other_methods_is_one_line(tmp_path):
    """Its drawings are by settings that only the paper's method has."""
    lighting = find_experiment("figure11").presets["quick"].lightings[0]
    records = [record_of("figure11", Entry("bvh2"), "cloth", lighting, ms=1.0)]
    with pytest.raises(UserError, match="no point of perspective_spherical"):
        report_of("figure11", tmp_path, records)


def test_figure11_tells_work_from_number_format(tmp_path):
    records = distance_records()
    text = report_of("figure11", tmp_path, records)
    for row in (
        "r = 32 | 4.00 | 4.00 | 8.00 | 8.00 | 8.00",
        "r = 65536 (no balancing) | 4.00 | 4.00 | 84.0 | 84.0 | 84.0",
        "float32, r = 64 | 4.00 | 4.00 | 12.0 | 12.0 | rejected",
    ):
        assert f"| Cloth (stand-in) | unclamped | aimed | {row} |" in text
    assert "1.00 times as long (Cloth (stand-in), clamped to the hits) and 2.00 times as long" in text
    assert "needs 9 pairs" in text
    drawn = (tmp_path / "figure11.svg").read_text()
    lines = ("r = 32", "r = 65536 (no balancing)", "float32, r = 64", "float32-centred, r = 64")
    for word in (*lines, "rejected (float32, r = 64)", "scene radii", "shadow traversal, ms", "stand-in"):
        assert word in drawn, word
    assert "not measured" not in drawn
    tiles = (tmp_path / "figure11-tiles.svg").read_text()
    for word in ("tiles that hold rays", "world axes, float32", "aimed, float32-centred", "rejected (aimed, float32)"):
        assert word in tiles, word
    over_r = (tmp_path / "figure11-r.svg").read_text()
    for word in ("lane fill", "blocks, C_total", "r, most rays per block", "65536"):
        assert word in over_r, word
    assert all(file.stat().st_size < 300_000 for file in tmp_path.glob("figure11*"))
    rows = csv_of("figure11", tmp_path)
    assert len(rows) == len(records)
    assert {"lane_fill", "counter.light 0 chunks", "traversal_ms", "counter.light 0 tiles with rays"} <= rows[0].keys()


def test_figure11_keeps_scenes_apart(tmp_path):
    text = report_of("figure11", tmp_path, [*distance_records(), *distance_records("fairy", 7.0)])
    finding = text.split("\n\n")[1]
    # The second scene grows faster: neither its own numbers nor those of the first are mixed with the other's.
    assert "2.00 times as long (Cloth (stand-in), unclamped)" in finding
    assert "8.00 times as long (Fairy (stand-in), unclamped)" in finding
    drawn = (tmp_path / "figure11.svg").read_text()
    assert all(f"{scene} (stand-in), unclamped, aimed" in drawn for scene in ("Cloth", "Fairy"))


def test_lane_fill_is_rays_over_lanes(tmp_path):
    table = figure11.read(write_records(tmp_path, distance_records()[:1]))
    assert table["lane_fill"].tolist() == pytest.approx(1600 / (50 * table["r"]))
    assert set(table["axes"]) <= set(figure11.AXES.values())


def test_two_lights_states_frames_a_second_and_what_each_further_light_costs(tmp_path):
    preset = find_experiment("two_lights").presets["quick"]

    def lit(e, lighting):
        """4 ms for what every frame needs, 8 for the first light, 2 less for each further one."""
        light = 8.0 + 6.0 * (lighting.count - 1)
        passes = [("build", "build", 1.0), ("primary rays", "trace", 3.0), ("light 0: count", "light build", light / 4),
                  ("light 0: shadow rays", "shadow", light * 0.75)]  # fmt: skip
        return record_of("two_lights", e, "fairy", lighting, ms=(4.0 + light) / 1.01, passes=passes)

    text = report_of("two_lights", tmp_path, [lit(e, x) for e in preset.methods for x in preset.lightings])
    assert "| Fairy (stand-in) | mesh rebuilt | 12.0 | 18.0 | 30.0 | 54.0 | 102 |" in text
    assert "| Fairy (stand-in) | mesh rebuilt | 0.750 | 0.750 | 0.750 | 0.750 |" in text
    assert "has 55.6 frames a second" in text
    assert "on Fairy: 7.6, its kd-tree peer 5.26" in text
    assert "number of lights" in (tmp_path / "two_lights.svg").read_text()


def test_what_a_further_light_costs_is_not_the_noise_of_the_frames(tmp_path):
    entry = find_experiment("two_lights").presets["quick"].methods[0]
    records = [
        record_of("two_lights", entry, "fairy", Lighting(f"{n}", count=n), ms=90.0 - n,
             passes=[("count", "light build", 1.0 * n), ("rays", "shadow", 2.0 + n)])
        for n in (1, 2, 8)
    ]  # fmt: skip
    report_of("two_lights", tmp_path, records)
    found = {row["light_count"]: row["further_over_first"] for row in csv_of("two_lights", tmp_path)}
    assert found == {"1": "", "2": "0.5", "8": "0.5"}


def test_a_light_whose_rays_are_traced_with_the_primary_ones_has_no_time_of_its_own(tmp_path):
    entry = find_experiment("two_lights").presets["quick"].methods[0]
    records = [
        record_of("two_lights", entry, "fairy", Lighting(f"{n}", count=n), ms=4.0 * n,
             passes=[("set up", "light build", 0.01), (f"rays {n}", "trace" if n == 1 else "shadow", 4.0 * n)])
        for n in (1, 2)
    ]  # fmt: skip
    report_of("two_lights", tmp_path, records)
    found = {row["light_count"]: row for row in csv_of("two_lights", tmp_path)}
    assert [found[n]["further_over_first"] for n in "12"] == ["", ""]
    assert [found[n]["ms_per_light"] for n in "12"] == ["", "4.005"]


def test_a_share_that_its_spread_does_not_carry_has_fewer_digits_and_a_mark(tmp_path):
    entry = find_experiment("two_lights").presets["quick"].methods[0]
    records = [record_of("two_lights", entry, "fairy", Lighting(f"{n}", count=n), ms=10.0 * n) for n in (1, 2)]
    for r in records:
        r["frames"][0].update(total_ms=[r["frames"][0]["total_ms"][0] * x for x in (0.6, 1.0, 1.4, 1.8)],
                              wall_ms=[1.0] * 4, round=[0, 0, 1, 1])  # fmt: skip
    text = report_of("two_lights", tmp_path, records)
    assert "| ~12 | ~24 |" in text
    assert "carries no more" in text


@pytest.mark.parametrize(
    ("name", "methods"), [("figure10", figure10.METHODS),
                          ("key_bits", (Entry("sort"),))],
)  # fmt: skip
def test_times_of_one_repeat_have_fewer_digits_and_a_mark(tmp_path, name, methods):
    passes = [("sort pairs", "build", 1.234), ("map rays", "shadow", 1.234), ("shadow rays", "shadow", 1.234),
              ("primary rays", "trace", 1.234), ("light 0: count", "light build", 1.234)]  # fmt: skip
    r = record_of(name, methods[0], passes=passes)
    r["point"].update(bits=18, pairs=4096)
    r["frames"][0]["stage_round"] = [0]
    for step in r["frames"][0]["passes"]:
        del step["ms"][1:]
    write_map(map_path(tmp_path, r["key"], 0), np.array([[0, 1], [2, 3]]))
    text = report_of(name, tmp_path, [r])
    assert "~1.2 |" in text
    assert "1.23 |" not in text
    assert "carries no more" in text


def test_two_lights_without_one_light_has_nothing_to_compare(tmp_path):
    preset = find_experiment("two_lights").presets["quick"]
    text = report_of("two_lights", tmp_path, [record_of("two_lights", preset.methods[0], "fairy", preset.lightings[1])])
    assert "| method | 2 |" in text
    assert "| - |" in text[text.index("Each light after the first") :]


def test_what_a_stopped_run_did_not_come_to_is_told(tmp_path):
    entries = find_experiment("ablation").presets["quick"].methods[:3]
    records = [record_of("ablation", e, "cloth", ms=10.0) for e in entries]
    records.append(record_of("ablation", entries[0], "buddha", ms=10.0))
    text = report_of("ablation", tmp_path, records)
    for entry in entries[1:]:
        assert f"{entry.label}: no record (Buddha (stand-in))" in text
    assert text.count("no record") == 2


def test_lightings_with_points_of_their_own_are_missed_by_nobody_and_miss_none(tmp_path):
    few, many = [Entry("warp_bvh", {}, "a")], [Entry("warp_bvh", {}, "a"), Entry("ray_grids", {}, "b")]
    near, far = Lighting("near", distance=1.0), Lighting("far", distance=9.0)
    write_records(tmp_path, [record_of("figure11", e, lighting=near) for e in many])
    write_records(tmp_path, [record_of("figure11", e, lighting=far) for e in few])
    table = document.read(tmp_path)
    assert document.not_measured(table) == ["b, far: no record (Cloth (stand-in))"]
    assert document.not_measured(table, apart=["far"]) == []
