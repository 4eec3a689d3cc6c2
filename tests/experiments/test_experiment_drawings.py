"""What experiments draw and say, from made-up records."""

import numpy as np
import pytest
from helpers.experiment_records import csv_of, record_of, report_of, write_records
from PIL import Image
from shadowbench.experiments import figure2, figure6, figure10, reflection
from shadowbench.harness.errors import UserError
from shadowbench.harness.report import document
from shadowbench.harness.results.folder import image_name
from shadowbench.harness.results.pixel_maps import map_path, write_map
from shadowbench.harness.runner.planning.experiment import Entry, find_experiment
from shadowbench.harness.scene.overrides import Lighting


def test_the_maps_of_figure2_have_one_scale(tmp_path):
    counted = {figure2.DIRECT: (14.0, 1000), figure2.INDIRECT: (10.0, 400), figure2.DIRECT_SMALL: (8.0, 500)}
    for e in figure2.METHODS:
        ms, most = counted.get(e.label, (9.0, 200))
        r = record_of("figure2", e, "buddha", ms=ms, counters={"primary tests, most": most})
        write_records(tmp_path, [r])
        write_map(map_path(tmp_path, r["key"], 0), np.array([[0, 0, 0], [0, 0, most], [0, most // 2, 1]]))
    assert "1.40 times as fast" in report_of("figure2", tmp_path)
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


def test_a_mirrored_ray_lost_in_the_noise_of_its_frame_is_named_and_left_out(tmp_path):
    grid, other, tree = *reflection.GRIDS[:2], reflection.TREES[0]
    for entry, mirrored in ((grid, -0.2), (other, 0.6), (tree, 0.3)):
        for lighting in reflection.LIGHTINGS[:2]:
            bounce = [("bounce 1: mirrored rays", "trace", mirrored)] * (lighting.bounces or 0)
            r = record_of("reflection", entry, "cloth", lighting, passes=[("primary rays", "trace", 1.0), *bounce])
            none = {"primary": {"pixels": 4}, "shadow": [], "true_errors": 0}
            counts = [{**none, "bounce": 1, "rays": 1000, "rays_wrong": 0, "reference_errors": None} for _ in bounce]
            r["frames"][0]["score"]["bounces"] = counts
            write_records(tmp_path, [r])
    said = report_of("reflection", tmp_path)
    assert f"left out: the mirrored rays of Cloth (stand-in), {grid.label or grid.method}, 1 bounce." in said
    assert "takes 2.00 times as long for a mirrored ray" in said, "of the grid that was told"


def distance_records(scene, growth):
    """Unclamped light grids: a light at ten radii takes ``growth`` times as long, and float32 is lost."""
    preset = find_experiment("figure11").presets["quick"]
    counted = {"light 0 chunks": 50, "light 0 lanes": 3200, "light 0 rays": 1600, "light 0 tiles with rays": 9}
    entries = [e for e in preset.methods if e.settings["clamp"] == "none"]
    return [
        record_of("figure11", e, scene, lighting, ms=10.0 * (growth if lighting.distance > 1 else 1.0), counters=counted,
                  status="rejected" if e.settings["precision"] == "float32" and lighting.distance > 1 else "ok")
        for lighting in preset.lightings[1:3] for e in entries
    ]  # fmt: skip


def test_figure11_of_other_methods_is_one_line(tmp_path):
    """Its drawings are by settings that only the paper's method has."""
    lighting = find_experiment("figure11").presets["quick"].lightings[0]
    records = [record_of("figure11", Entry("bvh2"), "cloth", lighting, ms=1.0)]
    with pytest.raises(UserError, match="no point of perspective_spherical"):
        report_of("figure11", tmp_path, records)


def test_figure11_keeps_scenes_and_number_formats_apart(tmp_path):
    text = report_of("figure11", tmp_path, [*distance_records("cloth", 2.0), *distance_records("fairy", 8.0)])
    finding = text.split("\n\n")[1]
    # The second scene grows faster: neither its own numbers nor those of the first are mixed with the other's.
    assert "2.00 times as long (Cloth (stand-in), unclamped)" in finding
    assert "8.00 times as long (Fairy (stand-in), unclamped)" in finding
    drawn = (tmp_path / "figure11.svg").read_text()
    assert all(f"{scene} (stand-in), unclamped, aimed" in drawn for scene in ("Cloth", "Fairy"))
    lines = ("r = 32", "r = 65536 (no balancing)", "float32, r = 64", "float32-centred, r = 64")
    assert all(word in drawn for word in (*lines, "rejected (float32, r = 64)", "scene radii"))
    assert "rejected (aimed, float32)" in (tmp_path / "figure11-tiles.svg").read_text()
    over_r = (tmp_path / "figure11-r.svg").read_text()
    assert all(word in over_r for word in ("lane fill", "blocks, C_total", "r, most rays per block", "65536"))


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


@pytest.mark.parametrize(("name", "methods"), [
    ("figure10", figure10.METHODS), ("key_bits", (Entry("sort"),)),
])  # fmt: skip
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


def test_lightings_with_points_of_their_own_are_missed_by_nobody_and_miss_none(tmp_path):
    few, many = [Entry("warp_bvh", {}, "a")], [Entry("warp_bvh", {}, "a"), Entry("ray_grids", {}, "b")]
    near, far = Lighting("near", distance=1.0), Lighting("far", distance=9.0)
    write_records(tmp_path, [record_of("figure11", e, lighting=near) for e in many])
    write_records(tmp_path, [record_of("figure11", e, lighting=far) for e in few])
    table = document.read(tmp_path)
    assert document.not_measured(table) == ["b, far: no record (Cloth (stand-in))"]
    assert document.not_measured(table, apart=["far"]) == []


def test_rearrangement_is_compared_over_the_frames_that_both_sizes_have(tmp_path):
    (entry,) = figure10.METHODS
    passes = [("light 0: map rays", "shadow", 1.0), ("light 0: shadow rays", "shadow", 3.0)]
    large, small = (record_of("figure10", entry, passes=passes, size=size) for size in (64, 32))
    assert "1.0 times as long at the larger size, same frames" in report_of(
        "figure10", tmp_path / "same", [large, small]
    )
    assert (tmp_path / "same" / "figure10.svg").read_text().count("Cloth (stand-in)") == 1
    small["frames"][0]["frame"] = 5
    assert "larger" not in report_of("figure10", tmp_path / "others", [large, small]).split("## ")[0]


@pytest.mark.filterwarnings("error::UserWarning")
def test_stages_that_add_up_to_more_than_the_frame_stay_within_the_drawing(tmp_path):
    passes = [("build", "build", 400.0), ("primary rays", "trace", 900.0), ("light 0: shadow rays", "shadow", 900.0)]
    report_of("figure10", tmp_path, [record_of("figure10", figure10.METHODS[0], passes=passes)])
    assert (tmp_path / "figure10.svg").stat().st_size > 0
