"""Sweeps, of scaling and of crossover: the scenes of balls, runs one after another, and exponents fitted."""

import dataclasses
import itertools

import numpy as np
import pandas as pd
import pytest
import trimesh
from shadowbench.experiments import crossover, scaling
from shadowbench.harness.commands.run import plan_run
from shadowbench.harness.commands.show import show
from shadowbench.harness.runner.planning.experiment import find_experiment
from shadowbench.harness.runner.progress import Silent
from shadowbench.harness.runner.run import Options, Run
from shadowbench.harness.scene.catalogue import resolve
from shadowbench.harness.scene.prepared import prepare
from shadowbench.harness.scene.standins import balls

pytestmark = pytest.mark.usefixtures("unpainted")

# --- the scene ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("count", [1000, 10_000, 300_000])
def test_a_scene_has_about_the_triangles_asked_for(count):
    prepared = prepare(resolve(f"balls-{count}"))
    assert prepared.triangle_count == pytest.approx(count, rel=0.1)
    assert prepared.moment(0, 8, 8).valid.all(), "no triangle without an area"


def test_every_count_samples_the_same_surfaces():
    """The middle of each ball, and its size, do not depend on the count."""
    few, many = (balls.geometry(n).positions(0) for n in (3000, 30_000))
    np.testing.assert_allclose(few.min(axis=0), many.min(axis=0), atol=0.05)
    np.testing.assert_allclose(few.max(axis=0), many.max(axis=0), atol=0.05)


def test_a_ball_is_closed_but_for_its_seam():
    """Every edge has two faces in opposite directions, once points that coincide are one."""
    vertices, faces = balls.ball(np.zeros(3), 1.0, np.array([3.0, 5.0, 7.0]), 6, 12)
    _, weld = np.unique(np.round(vertices, 9), axis=0, return_inverse=True)
    edges = [tuple(e) for f in weld.ravel()[faces] for e in itertools.pairwise([*f, f[0]])]
    assert (len(set(edges)), {(b, a) for a, b in edges}) == (len(edges), set(edges))


@pytest.mark.parametrize(("name", "said"), [
    ("balls-1k", balls.Name(1000)), ("balls-2m-seen5", balls.Name(2_000_000, seen=0.05)),
    ("balls-300-moving0", balls.Name(300, moving=0.0)), ("balls-1k-seen100-moving30", balls.Name(1000, 1.0, 0.3)),
    ("balls-1k-swirl150", balls.Name(1000, swirl=1.5)), ("balls-1k-moving30-swirl5", None), ("balls-1k-seen0", None),
    ("balls-1k-seen101", None), ("balls-1k-moving30-seen5", None),
    *((name, None) for name in ("ball-1k", "balls-0", "balls-1g", "balls", "balls-1k.ply")),
])  # fmt: skip
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


# --- the sweeps ---------------------------------------------------------------------------------------------


def test_named_scenes_or_a_size_leave_the_other_sweeps_out(tmp_path):
    everything = plan_run("scaling", device="cpu", out=tmp_path, methods=["ray_grids"], overrides={"rounds": 1})
    assert (len(everything.preset.also), {part.rounds for part in everything.preset.parts()}) == (4, {1})
    assert {len(part.methods) for part in everything.preset.parts()} == {1}
    for one in ({"scenes": ["balls-1k"]}, {"size": "32x32"}):
        assert plan_run("scaling", device="cpu", out=tmp_path, **one).preset.also == ()


@pytest.mark.slow
def test_sweeps_run_one_after_another_into_one_folder(tmp_path):
    declared = find_experiment("scaling")
    base = dataclasses.replace(
        declared.presets["quick"], width=16, height=16, scenes=("balls-300",), methods=scaling.METHODS[:1],
        samples=1, most=1, rounds=1, also=(),
    )  # fmt: skip
    small = scaling.sweeps(base, ("balls-1k",), (8, 24), (2,))
    out = tmp_path / "out"
    records = Run(Options(declared, "quick", small, "cpu", out, score=False), Silent()).go()
    assert [r.status for r in records] == ["ok"] * 5
    assert [(r.scene["name"], r.point["width"], len(r.scene["lights"])) for r in records] == [
        ("balls-300", 16, 1), ("balls-1k", 16, 1), ("balls-300", 8, 1), ("balls-300", 24, 1), ("balls-300", 16, 2),
    ]  # fmt: skip
    again = Run(Options(declared, "quick", small, "cpu", out, score=False), Silent()).go()
    assert [r.key for r in again] == [r.key for r in records], "nothing is measured twice"
    files = {file.name for file in show("scaling", out, quiet=True)}
    assert files == {"scaling.csv", "scaling.svg", "scaling.md"}
    rows = (out / "scaling.csv").read_text().splitlines()
    assert len(rows) == 1 + 5
    assert sum("triangles pixels lights" in row for row in rows) == 1, "the point where the sweeps cross"


# --- the drawing --------------------------------------------------------------------------------------------


def test_the_exponent_is_that_of_the_power_law():
    x = [1e3, 3e3, 1e4, 3e4, 1e5]

    def growth(x, ms):
        return scaling.growth(pd.DataFrame({"triangles": x, "total_ms": ms}), "triangles")

    assert growth(x, [2.0 * v**0.5 for v in x]) == pytest.approx((0.5, 0.0), abs=1e-9)
    exponent, half = growth(x, [2.0 * v**0.5 * f for v, f in zip(x, (1, 1, 1.1, 0.9, 1.1), strict=True)])
    assert half > 0.05
    assert abs(exponent - 0.5) < half
    assert np.isnan(growth(x[:1], [1.0])).all()
    assert np.isnan(growth(x[:2], [1.0, 3.0])).tolist() == [False, True]


def swept_lights(*settings):
    """Points of exact methods at 1, 2, 4 ... lights: in each setting times by label, of which a spread of 0.1 ms tells."""
    rows = [
        {"triangles": 10, "pixels": 4, "seen": -1, "moving": -1, "lights": 2**k, "label": label, "method": label,
         "exact": label != "loose", "status": "ok", "total_ms": ms, "spread": 0.1}
        for k, times in enumerate(settings) for label, ms in times.items()
    ]  # fmt: skip
    return pd.DataFrame(rows)


def test_a_tie_is_no_win():
    """A method stays the fastest until it is told from another, whichever of them is a hair ahead; its ties are counted."""
    a, b, tie = {"a": 1.0, "b": 2.0}, {"a": 2.0, "b": 1.0}, {"a": 1.01, "b": 1.0}
    for settings, words in (
        ((a, tie), "from 1 to 2 lights a stays the fastest exact method (in 1 of 2 a tie with b)"),
        ((tie, tie, a), "from 1 to 4 lights a stays the fastest exact method (in 2 of 3 a tie with b)"),
        ((tie, tie), "from 1 to 2 lights b stays the fastest exact method (in 2 of 2 a tie with a)"),
        ((a, tie, b), "from 1 to 4 lights the fastest exact method is first a (in 1 of 2 a tie with b), from 4 b"),
        ((a, b), "from 1 to 2 lights the fastest exact method is first a, from 2 b"),
        ((a,), ""),
    ):
        assert crossover.over(swept_lights(*settings), "lights", "lights") == words


def test_a_method_that_is_not_exact_is_not_faster_by_a_tie():
    loose = swept_lights({"a": 1.0, "loose": 0.95}, {"a": 1.0, "loose": 0.5, "c": 0.45}, {"a": 1.0, "loose": 0.5})
    loose["exact"] &= loose["label"] != "c"
    assert crossover.of_balls(loose).endswith(
        " c, which is not exact, is faster in 1; loose, which is not exact, is faster in 1."
    )
