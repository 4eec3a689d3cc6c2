"""Orthographic cameras in frames, and lights that move over geometry that does not: only their part is made anew."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.effect_scenes import POINT
from helpers.effect_scenes import scene as lit
from helpers.judged_hard_cases import exact_methods, judged
from helpers.small_scenes import answers_in, assert_same
from shadowbench.harness.commands.plan import declared, frame_plan
from shadowbench.harness.errors import UserError
from shadowbench.harness.frame.effects.shading import shaded
from shadowbench.harness.frame.registry import make_method, method_names
from shadowbench.harness.frame.schedule.needed import stale
from shadowbench.harness.frame.session import Session
from shadowbench.harness.hardcases.shapes import plane
from shadowbench.harness.judge.context import Judge
from shadowbench.harness.judge.score import score_answers
from shadowbench.harness.scene.light_paths import Orbit
from shadowbench.harness.scene.prepared import Prepared, prepare, under
from shadowbench.harness.scene.scene import Geometry

TRACING = [(name, given) for name, given in exact_methods() if "orthographic" in make_method(name, given).simulates]


def test_which_methods_trace_parallel_rays() -> None:
    names = {"bvh2", "coherent_grid", "kdtree", "two_level_bvh", "two_level_grid", "uniform_grid", "warp_bvh"}
    assert {name for name, _ in TRACING} == names
    scene = judged("O03 x").trial.prepared.scene
    for name in set(method_names()) - names - {"embree", "driver"}:
        assert "orthographic: its primary rays start in one point" in str(make_method(name).applies(scene, "cpu"))


def test_embree_is_the_reference_of_parallel_rays_too() -> None:
    """Its answers and those of a method agree, and a shifted table of rays does not."""
    trial = judged("O05 x1").trial
    judge = Judge.of(trial.prepared, trial.moment)

    def true_errors(given) -> int:
        return score_answers(judge, given).score.true_errors

    assert judge.reference.provenance["reference"] == "Embree"
    session = Session(make_method("uniform_grid"), trial.prepared, 24, 17, "cpu")
    answers = session.answers(trial.moment)
    assert true_errors(answers) == 0
    moved = replace(trial.moment, column=trial.moment.column + np.float32(0.05))
    assert true_errors(session.answers(moved)) > 20


def test_a_frame_is_of_one_kind_of_camera() -> None:
    trial = judged("O05 x1").trial
    camera = replace(trial.prepared.scene.camera, height=None)
    pinhole = trial.prepared.moment(0, 24, 17, camera=camera)
    session = Session(make_method("uniform_grid"), trial.prepared, 24, 17, "cpu")
    with pytest.raises(ValueError, match="one of them is orthographic"):
        session.answers(pinhole)


def coloured(trial, camera) -> tuple[np.ndarray, np.ndarray]:
    """The colours of a frame, by the pass of the frame and by the host's picture of its answers."""
    scene = replace(trial.prepared.scene, outputs=("ids", "shadows", "color"), camera=camera)
    prepared = under(trial.prepared, scene)
    moment = prepared.moment(0, 24, 17)
    session = Session(make_method("uniform_grid"), prepared, 24, 17, "cpu")
    answers = session.answers(moment)
    host = shaded(prepared, moment, answers, scene.lights)(0, 24 * 17)
    return session.frame.color.numpy(), host


def test_colours_are_those_of_a_pinhole_camera_far_away() -> None:
    trial = judged("O05 x1").trial
    camera = trial.prepared.scene.camera
    frame, host = coloured(trial, camera)
    np.testing.assert_array_equal(frame, host)
    eye, target = np.array(camera.eye), np.array(camera.target)
    way = (target - eye) / np.linalg.norm(target - eye)
    fov = float(np.degrees(2 * np.arctan(camera.height / 2 / 1e4)))
    far = replace(camera, eye=tuple((eye - (1e4 - 3) * way).tolist()), height=None, fov=fov)
    close = np.abs(coloured(trial, far)[0] - frame).max(axis=1) < 1e-3
    assert close.mean() > 0.95


FRAMES = 3
METHODS = ("bvh2", "hybrid", "warp_bvh", "embree")


def turning(moving: bool = False) -> Prepared:
    """A scene whose light turns; with ``moving``, its mesh moves as well."""
    scene = lit((POINT,)).scene
    base = scene.geometry()

    def geometry() -> Geometry:
        if not moving:
            return Geometry.static(base.positions(0), base.faces).lasting(FRAMES)
        return Geometry(base.faces, lambda frame: base.positions(0) + 0.01 * frame, FRAMES)

    return prepare(replace(scene, geometry=geometry, light_path=Orbit((0.0, 0.0, 0.0), (0.0, 1.0, 0.0), 0.5)))


def session_of(method: str, prepared: Prepared) -> Session:
    if method == "embree":
        pytest.importorskip("embreex", reason="Embree is not installed")
    return Session(make_method(method, {"update": "static"}), prepared, 24, 24, "cpu")


@pytest.mark.parametrize("method", METHODS)
def test_only_the_lights_part_is_made_anew(method: str) -> None:
    prepared = turning()
    moments = [prepared.moment(frame, 24, 24) for frame in range(FRAMES)]
    session = session_of(method, prepared)
    session.answers(moments[0])
    for moment in moments[1:]:
        assert session.advance(moment) == {"light/0"}
        run = stale(session.all_passes, {"light/0"})
        assert run
        assert {one.part for one in run} <= {"light build", "shadow"}
        assert_same(answers_in(session), session_of(method, prepared).answers(moment))


@pytest.mark.parametrize("method", [method for method in METHODS if method != "hybrid"])  # it may take no tree
def test_a_mesh_that_moves_is_refused(method: str) -> None:
    with pytest.raises(UserError, match=r"update=static: .* moves over 3 frames; choose rebuild or refit"):
        session_of(method, turning(moving=True))


def test_plan_says_so(tmp_path) -> None:
    path = tmp_path / "turning.toml"
    orbit = "frames = 3\nturns = 0.5\naxis = [0.0, 1.0, 0.0]\ncentre = [0.0, 0.0, 0.0]\n"
    path.write_text(f'mesh = "balls-1k"\n[orbit]\n{orbit}')
    (row,) = (found := frame_plan(str(path), ["bvh2"], "8x8", "cpu", settings=["bvh2.update=static"]))["methods"]
    assert found["declared"]["geometry"].endswith("triangles, static over 3 frames")
    assert ", moving" in found["declared"]["lights"][0]
    assert row["cannot"] is None
    for one in row["passes"]:
        assert one["after"]["light 0"]["runs"] == (one["part"] in ("light build", "shadow")), one["name"]
    moving = turning(moving=True)
    assert declared(moving.scene, moving)["geometry"].endswith("deforming over 3 frames, all of it")
    still = prepare(replace(moving.scene, geometry=lambda: Geometry.static(*plane(2, 0, 1))))
    assert declared(still.scene, still)["geometry"] == "2 triangles, static"
