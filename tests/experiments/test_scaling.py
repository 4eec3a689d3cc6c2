"""The scaling experiment: its scenes, its sweeps run one after another, exponents fitted, drawn from made-up records."""

import dataclasses
import itertools

import numpy as np
import pandas as pd
import pytest
from helpers.experiment_records import record_of, report_of
from shadowbench.experiments import scaling
from shadowbench.harness.commands.run import plan_run
from shadowbench.harness.commands.show import show
from shadowbench.harness.runner.planning.experiment import Entry, find_experiment
from shadowbench.harness.runner.progress import Silent
from shadowbench.harness.runner.run import Options, Run
from shadowbench.harness.scene.catalogue import resolve
from shadowbench.harness.scene.overrides import Lighting
from shadowbench.harness.scene.prepared import prepare
from shadowbench.harness.scene.standins import balls

# --- the scene ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "count"), [("balls-1k", 1000), ("balls-300", 300), ("balls-2m", 2_000_000), ("ball-1k", None),
                        ("balls-0", None), ("balls-1g", None), ("balls", None), ("balls-1k.ply", None)],
)  # fmt: skip
def test_names_ask_for_a_triangle_count(name, count):
    assert balls.count_of(name) == count


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
    assert len(set(edges)) == len(edges)
    assert {(b, a) for a, b in edges} == set(edges)


# --- the sweeps ---------------------------------------------------------------------------------------------


def test_named_scenes_or_a_size_leave_the_other_sweeps_out(tmp_path):
    everything = plan_run("scaling", device="cpu", out=tmp_path, methods=["ray_grids"], overrides={"rounds": 1})
    assert len(everything.preset.also) == 4
    assert {part.rounds for part in everything.preset.parts()} == {1}
    assert {len(part.methods) for part in everything.preset.parts()} == {1}
    for one in ({"scenes": ["balls-1k"]}, {"size": "32x32"}):
        assert plan_run("scaling", device="cpu", out=tmp_path, **one).preset.also == ()


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


def records():
    """Time proportional to pixels, to the root of triangles, and 2 + 0.5 a light."""
    entry, other = Entry("ray_grids", {}, scaling.OURS), Entry("warp_bvh")
    result = []
    for e, scale in ((entry, 1.0), (other, 3.0)):
        points = [(t, 64, 1) for t in (1000, 10_000, 100_000)] + [(10_000, s, 1) for s in (32, 128)]
        points += [(10_000, 64, n) for n in (2, 4)]
        for triangles, side, count in points:
            ms = scale * (triangles / 1e4) ** 0.5 * (side / 64) ** 2 * (2.0 + 0.5 * count)
            lighting = Lighting(f"{count} lights", count=count) if count > 1 else None
            r = record_of("scaling", e, f"balls-{triangles}", lighting, ms=ms / 1.01, size=side)
            r["scene"]["triangles"] = triangles
            result.append(r)
    return result


def test_text_and_picture(tmp_path):
    text = report_of("scaling", tmp_path, records())
    ours = "0.791 ms at 1k to 7.91 ms at 100k, exponent 0.50 ± 0.00"
    assert f"| ray grids | {ours} |" in text
    assert "exponent 1.00 ± 0.00 |" in text
    assert "A frame of ray grids takes 0.791 ms with 1k triangles and 7.91 ms with 100k; " in text
    drawn = (tmp_path / "scaling.svg").read_text()
    for word in ("triangles", "pixels", "lights", "100k"):
        assert f">{word}<" in drawn, word
    scenes = "Balls-1000 (stand-in), Balls-10000 (stand-in), Balls-100000 (stand-in)"
    assert scenes in drawn
    assert scenes in text
    assert "time in proportion, exponent 1" in drawn
    assert "not measured" not in drawn + text


def test_a_sweep_that_was_not_measured_is_told(tmp_path):
    text = report_of("scaling", tmp_path, [r for r in records() if len(r["scene"]["lights"]) == 1])
    assert "Not measured: time against lights." in text
    assert "Not measured: time against lights." in (tmp_path / "scaling.svg").read_text()


def test_nothing_measured_is_said(tmp_path):
    text = report_of("scaling", tmp_path, [record_of("scaling", Entry("warp_bvh"), status="rejected")])
    assert "Not measured" in text
    assert not list(tmp_path.glob("*.svg"))
