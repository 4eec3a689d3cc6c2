"""The Embree reference: conventions, traps of its binding, provenance and the folder."""

import numpy as np
import pytest
from helpers import exact_answers as cases
from shadowbench.harness.judge import consistency, context
from shadowbench.harness.judge import reference as references
from shadowbench.harness.judge.context import Judge
from shadowbench.harness.judge.reference import embree_reference
from shadowbench.harness.judge.score import score_answers
from shadowbench.harness.runner.workers.grader import Grader, hand_over, handed_path
from shadowbench.harness.scene.effects import Effects
from shadowbench.harness.scene.overrides import Lighting
from shadowbench.harness.scene.prepared import Prepared, prepare
from shadowbench.harness.scene.scene import Camera, Light


@pytest.fixture(scope="module")
def ball() -> tuple[Prepared, object]:
    prepared = prepare(cases.ball_on_floor(lights=2))
    return prepared, prepared.moment(0, 72, 54)


def test_reference_equals_the_exact_answer_on_an_ordinary_scene(ball):
    prepared, moment = ball
    reference = embree_reference(prepared, moment)
    right = cases.exact_answers(prepared, moment)
    np.testing.assert_array_equal(reference.triangle, right["triangle"])
    np.testing.assert_array_equal(reference.shadowed, right["shadowed"])
    np.testing.assert_allclose(reference.t, right["t"], rtol=2e-6)
    np.testing.assert_allclose(reference.u, right["u"], atol=2e-5)
    np.testing.assert_allclose(reference.v, right["v"], atol=2e-5)
    # The picture holds what the test is about: sky, floor, ball, and shadows of both lights.
    assert (reference.triangle == -1).sum() > 100
    assert (reference.triangle > 1).sum() > 100
    assert (reference.shadowed.sum(axis=1) > 100).all()


def test_a_moving_light_over_a_mesh_at_rest_has_one_referee_and_one_scene_of_embree(monkeypatch, tmp_path):
    """Both were made for each of the light's places: half of the time of a check on a million triangles."""
    made = {"Referee": 0, "make_scene": 0}

    def counting(module, name):
        whole = getattr(module, name)

        def one(*given):
            made[name] += 1
            return whole(*given)

        monkeypatch.setattr(module, name, one)

    light = Lighting("moved", frames=3, turns=1.0)
    prepared = light.applied(prepare(light.longer(cases.ball_on_floor())))
    moments = {frame: prepared.moment(frame, 36, 27) for frame in range(3)}
    right = {frame: embree_reference(prepared, moment).answers() for frame, moment in moments.items()}
    assert not np.array_equal(right[0]["shadowed"], right[1]["shadowed"])
    counting(context, "Referee"), counting(references, "make_scene")
    for frame, answers in right.items():
        hand_over(handed_path(tmp_path, "key", frame), answers)
    grader = Grader(prepared, moments, "ball", tmp_path, "cpu", {})
    frames = grader.grade("key", False, True, str(tmp_path / "ball.png"), "ball")
    assert made == {"Referee": 1, "make_scene": 1}
    assert [frame["score"]["primary"]["disputed"] for frame in frames] == [0, 0, 0]
    assert [frame["score"]["shadow"][0]["disputed"] for frame in frames] == [0, 0, 0]


def test_a_light_without_shadows_gets_zeros(ball):
    prepared, moment = ball
    reference = embree_reference(prepared, moment, Effects((False, True)))
    assert reference.shadowed[0].sum() == 0
    assert reference.shadowed[1].sum() > 100
    assert reference.provenance["shadows"] == [False, True]


def test_invalid_triangles_keep_the_ids_of_the_others():
    """Zero-area, NaN and infinite triangles lie in front of a square, one of them in each of its places."""
    square = np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0.0)])
    odd = np.array([(np.nan, 0, 0.5), (np.inf, 0, 0.5), (-5, -5, 0.5), (0, 0, 0.5), (5, 5, 0.5)])
    faces = np.array([(4, 0, 1), (6, 7, 8), (0, 1, 2), (5, 0, 1), (0, 0, 1), (0, 2, 3), (6, 6, 6)])
    scene = cases.static_scene(
        np.concatenate([square, odd]), faces, Camera((0, 0, 3), (0, 0, 0)), Light((0.3, 0.2, 2.0))
    )
    prepared = prepare(scene)
    moment = prepared.moment(0, 32, 32)
    assert moment.valid.tolist() == [0, 0, 1, 0, 0, 1, 0]
    reference = embree_reference(prepared, moment)
    assert set(reference.triangle.tolist()) == {-1, 2, 5}
    assert reference.shadowed.sum() == 0


def test_nothing_to_hit():
    scene = cases.static_scene(
        np.zeros((0, 3)), np.zeros((0, 3), dtype=int), Camera((0, 0, 3), (0, 0, 0)), Light((0, 5, 0))
    )
    prepared = prepare(scene)
    reference = embree_reference(prepared, prepared.moment(0, 5, 3))
    assert (reference.triangle == -1).all()
    assert reference.shadowed.shape == (1, 15)


def test_an_index_out_of_range_is_refused():
    with pytest.raises(ValueError, match="does not exist"):
        references.make_scene(np.zeros((3, 3), np.float32), np.int32([(0, 1, 3)]), np.ones(1))


def test_several_blocks_give_the_same_as_one(ball, monkeypatch):
    prepared, moment = ball
    whole, checked = embree_reference(prepared, moment), Judge.of(prepared, moment).checked_reference
    monkeypatch.setattr(consistency, "BLOCK", 100)
    cut = embree_reference(prepared, moment)
    for name, value in whole.answers().items():
        np.testing.assert_array_equal(value, cut.answers()[name])
    again = Judge.of(prepared, moment).checked_reference
    for name in ("t_wrong", "uv_wrong", "t_error", "uv_error"):
        np.testing.assert_array_equal(getattr(checked, name), getattr(again, name))


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_no_scale_loses_shadows_or_gains_acne(scale):
    base = cases.ball_on_floor()
    geometry = base.geometry()
    camera = Camera(tuple(scale * x for x in base.camera.eye), tuple(scale * x for x in base.camera.target))
    lights = [Light(tuple(scale * x for x in light.position)) for light in base.lights]
    prepared = prepare(cases.static_scene(geometry.positions(0) * scale, geometry.faces, camera, *lights))
    moment = prepared.moment(0, 64, 48)
    bits = cases.exact_answers(prepared, moment)["shadowed"]
    assert bits.sum() > 50
    np.testing.assert_array_equal(embree_reference(prepared, moment).shadowed, bits)


def test_the_folder_is_used_only_for_the_same_inputs(ball, tmp_path, monkeypatch):
    prepared, moment = ball
    first = embree_reference(prepared, moment, folder=tmp_path)
    (file,) = tmp_path.glob("truth-*.npz")
    before = file.read_bytes()
    with monkeypatch.context() as patch:
        patch.setattr(references, "_trace", lambda *_: pytest.fail("traced again"))
        again = embree_reference(prepared, moment, folder=tmp_path)
    for name, value in first.answers().items():
        np.testing.assert_array_equal(value, again.answers()[name])
    assert again.provenance == first.provenance
    assert file.read_bytes() == before
    file.write_bytes(before[:200])
    anew = embree_reference(prepared, moment, folder=tmp_path)
    np.testing.assert_array_equal(first.triangle, anew.triangle)
    assert len(file.read_bytes()) > 200, "a damaged file is made again"
    embree_reference(prepared, prepared.moment(0, 72, 53), folder=tmp_path)
    assert len(list(tmp_path.glob("truth-*.npz"))) == 2


def test_provenance_says_what_was_traced_and_by_what(ball):
    prepared, moment = ball
    facts = embree_reference(prepared, moment).provenance
    assert facts["robust"] is True
    assert facts["embreex"][0].isdigit()
    assert {"mesh", "rays", "lights", "key", "processor"} <= set(facts)
    other = embree_reference(prepared, prepared.moment(0, 72, 54, lights=(Light((0, 9, 0)), Light((1, 9, 0)))))
    assert other.provenance["mesh"] == facts["mesh"]
    assert other.provenance["lights"] != facts["lights"]


def test_without_embree_the_referee_is_the_reference(ball, monkeypatch):
    prepared, moment = ball
    embree = embree_reference(prepared, moment)
    monkeypatch.setattr(references, "embree_installed", lambda: False)
    monkeypatch.setattr(references, "embree_reference", lambda *_: pytest.fail("asked for Embree"))
    judge = Judge.of(prepared, moment)
    for name, value in embree.answers().items():
        np.testing.assert_allclose(value, judge.reference.answers()[name], rtol=2e-6, atol=2e-5)
    assert judge.reference.provenance["reference"] == "exact referee"
    assert score_answers(judge, embree.answers()).score.check == "ok"
