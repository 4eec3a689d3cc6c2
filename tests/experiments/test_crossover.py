"""Who wins where: the fastest of each setting, exact ones apart, ties marked; and the scenes of the sweeps."""

import numpy as np
import pytest
import trimesh
from helpers.experiment_records import record_of, report_of, write_records
from shadowbench.experiments import crossover
from shadowbench.harness.runner.planning.experiment import Entry, find_experiment
from shadowbench.harness.scene.overrides import Lighting
from shadowbench.harness.scene.prepared import prepare
from shadowbench.harness.scene.standins import balls

OURS, TREE, LOOSE = (
    Entry("ray_grids", {}, "ours"),
    Entry("bvh2", {}, "tree"),
    Entry("bvh2", {"precision": "float32"}, "loose"),
)


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("balls-1k", balls.Name(1000)),
        ("balls-2m-seen5", balls.Name(2_000_000, seen=0.05)),
        ("balls-300-moving0", balls.Name(300, moving=0.0)),
        ("balls-1k-seen100-moving30", balls.Name(1000, 1.0, 0.3)),
        ("balls-1k-swirl150", balls.Name(1000, swirl=1.5)),
        ("balls-1k-moving30-swirl5", None),
        ("balls-1k-seen0", None),
        ("balls-1k-seen101", None),
        ("balls-1k-moving30-seen5", None),
    ],
)
def test_a_name_says_what_the_scene_is(name, said):
    assert balls.read_name(name) == said


@pytest.mark.parametrize("percent", [5, 30, 80])
def test_about_that_share_of_the_pixels_sees_the_ground(percent):
    prepared = prepare(balls.scene(f"balls-300-seen{percent}"))
    moment = prepared.moment(0, 48, 48)
    directions = moment.directions(np.arange(48 * 48))
    mesh = trimesh.Trimesh(moment.points, prepared.faces, process=False)
    hits = mesh.ray.intersects_any(np.broadcast_to(moment.eye, directions.shape), directions)
    # Balls stand out over the ground's edge.
    assert percent / 100 - 0.02 <= hits.mean() <= 1.5 * percent / 100


@pytest.mark.parametrize(("percent", "share"), [(0, 0.0), (30, 0.3), (60, 0.6), (100, 1.0)])
def test_about_that_share_of_the_triangles_moves(percent, share):
    geometry = balls.scene(f"balls-3k-moving{percent}").geometry()
    assert geometry.frame_count == balls.FRAMES
    moved = (geometry.positions(0) != geometry.positions(10)).any(axis=1)
    assert moved[geometry.faces].any(axis=1).mean() == pytest.approx(share, abs=0.03)
    heights = (geometry.positions(0)[:, 1], geometry.positions(10)[:, 1])
    np.testing.assert_array_equal(*heights)


def test_a_swirl_turns_the_middle_and_leaves_the_rim():
    geometry = balls.scene("balls-3k-swirl25").geometry()
    first, last = geometry.positions(0), geometry.positions(balls.FRAMES - 1)
    away = np.hypot(first[:, 0], first[:, 2])
    turned = np.degrees(np.angle((last[:, 0] + 1j * last[:, 2]) * (first[:, 0] - 1j * first[:, 2])))
    some = away > 0.0
    expected = 90.0 * np.clip(1 - away / balls.HALF, 0, None)
    np.testing.assert_allclose(np.abs(turned)[some], expected[some], atol=1e-3)
    np.testing.assert_allclose(np.hypot(last[:, 0], last[:, 2]), away, atol=1e-5)
    np.testing.assert_array_equal(first[:, 1], last[:, 1])


def test_the_sweeps_cross_in_one_setting():
    for preset in find_experiment("crossover").presets.values():
        parts = preset.parts()
        settings = [(part.width, scene, one.label) for part in parts for scene in part.scenes for one in part.lightings]
        assert len(set(settings)) == len(settings), "nothing is measured twice"


def records():
    """Ours wins at few triangles, the tree at many; the loose one is the fastest everywhere but wrong, or as fast."""
    made = []
    for scene, own, tree, loose in (("balls-1k", 1.0, 2.0, 0.999), ("balls-10k", 2.0, 1.5, 1.2)):
        for size, times in ((64, 1.0), (128, 4.0)):
            made += [record_of("crossover", OURS, scene, ms=own * times, size=size)]
            made += [record_of("crossover", TREE, scene, ms=tree * times, size=size)]
            wrong = record_of("crossover", LOOSE, scene, ms=loose * times, size=size)
            wrong["frames"][0]["score"]["true_errors"] = 3
            wrong["method"]["known_inexact"] = "float32"
            made.append(wrong)
    return made


def test_the_fastest_of_exact_methods_and_of_all(tmp_path):
    table = crossover.read(write_records(tmp_path, records()))
    first = table.drop_duplicates(["triangles", "pixels"]).set_index(["triangles", "pixels"])
    assert set(first.loc[1000, "fastest_exact"]) == {"ours"}
    assert set(first.loc[10_000, "fastest_exact"]) == {"tree"}
    assert set(first["fastest"]) == {"loose"}
    winners = crossover.winners(table).set_index(["triangles", "pixels"])
    assert not winners.loc[(1000, 64 * 64), "told"], "a thousandth is within the spread"
    assert winners.loc[(10_000, 64 * 64), "told"]
    assert winners.loc[(10_000, 64 * 64), "times"] == pytest.approx(1.5 / 1.2)


def test_text_and_pictures(tmp_path):
    text = report_of("crossover", tmp_path, records())
    assert (
        "Grids of rays are the fastest on 2 of 4 settings, trees on 2, with every answer right: ours on 2, tree on 2. loose,"
        " which is not exact" in text
    )
    assert (tmp_path / "crossover.svg").exists()
    assert "| 1k | ours, 4.04 ms | tree, 2.00x | loose, 4.04 ms | ours, a tie |" in text
    assert "## Fastest over triangles (pixels: 128², lights: 1)" in text
    assert "Over lights: not measured." in text
    drawn = (tmp_path / "crossover-maps.svg").read_text()
    assert ">64²<" in drawn
    assert ">128²<" in drawn


def test_nothing_measured_is_said(tmp_path):
    text = report_of("crossover", tmp_path, [record_of("crossover", OURS, "balls-1k", status="rejected")])
    assert "Nothing was measured." in text
    assert not list(tmp_path.glob("*.svg"))


def test_lights_in_a_room_are_told_apart_from_balls(tmp_path):
    made = records()
    for count, own, tree in ((1, 1.0, 2.0), (4, 3.0, 3.0), (16, 9.0, 5.0)):
        lit = Lighting(f"{count} lights", count=count)
        made += [record_of("crossover", e, "sibenik", lit, ms=ms) for e, ms in ((OURS, own), (TREE, tree))]
    text = report_of("crossover", tmp_path, made)
    assert "Grids of rays are the fastest on 2 of 4 settings" in text, "those of the balls"
    assert " from 1 to 16 lights the fastest exact method is first ours, from 16 tree." in text
    assert (tmp_path / "crossover-rooms.svg").exists()
