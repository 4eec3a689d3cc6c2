"""Orthographic cameras in frames: which kernels run, what a frame refuses, colours, and answers of methods."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.judged_hard_cases import exact_methods, judged
from shadowbench.harness.frame.effects.shading import shaded
from shadowbench.harness.frame.registry import make_method, method_names
from shadowbench.harness.frame.session import Session
from shadowbench.harness.judge.context import Judge
from shadowbench.harness.judge.score import score_answers
from shadowbench.harness.scene.prepared import under

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
