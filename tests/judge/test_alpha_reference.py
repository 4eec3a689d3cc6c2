"""References, classes, declarations and files of triangles with holes."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.holed_scenes import SIZE, answers_of, holed, make, same
from shadowbench.harness.errors import UserError
from shadowbench.harness.frame.registry import make_method
from shadowbench.harness.frame.session import Session
from shadowbench.harness.hardcases.shapes import ball_on_floor
from shadowbench.harness.judge.answer_files import save_raw, score_raw
from shadowbench.harness.judge.arithmetic import edge_bound
from shadowbench.harness.judge.context import Judge
from shadowbench.harness.judge.referee import Referee
from shadowbench.harness.judge.score import score_answers
from shadowbench.harness.judge.verdict import Verdict
from shadowbench.harness.scene.alpha import checked
from shadowbench.harness.scene.effects import Effects
from shadowbench.harness.scene.overrides import perforated
from shadowbench.harness.scene.scene import AlphaMask, Geometry
from shadowbench.harness.scene.shared import read_stored, store


def test_ignoring_holes_is_a_true_error():
    _, _, judge = holed()
    blind = answers_of("uniform_grid", {}, make(ball_on_floor(), None))
    score = score_answers(judge, blind).score
    wrong = np.count_nonzero(blind["triangle"] != judge.reference.triangle)
    assert wrong > 20
    assert score.primary.true == wrong
    assert score.primary.edge == score.primary.near_tie == 0
    right = {**judge.reference.answers()}
    right["shadowed"] = 1 - right["shadowed"]
    right["shadowed"][:, right["triangle"] < 0] = 0
    bits = score_answers(judge, right).score.shadow
    assert sum(light.acne + light.leak for light in bits) == 2 * np.count_nonzero(right["triangle"] >= 0)


@pytest.mark.parametrize(("bounds", "verdict"), [(0.5, Verdict.EDGE), (3.0, Verdict.TRUE)])
def test_a_border_excuses_within_the_bound_only(bounds, verdict):
    """A ray straight down on a half opaque triangle, so many bounds inside the opaque half."""
    points = np.array([(-1, 0, -1), (3, 0, -1), (-1, 0, 3), (-9, -1, -9), (9, -1, -9), (0, -1, 9)], np.float32)
    faces = np.array([(0, 1, 2), (3, 4, 5)], np.int32)
    coordinates = points[faces][..., [0, 2]] / 16 + 0.5
    mask = checked(AlphaMask([1, 0], coordinates, np.array([[1, 0]])), 2, "half")
    referee = Referee(points, faces, np.ones(2), mask=mask)
    bound = float(edge_bound(np.float32([[0, 1, 0]]))[0])
    origins = np.float32([(-bounds * bound, 2, 0.25), (bounds * bound, 2, 0.25)])
    down = np.float32([(0, -1, 0), (0, -1, 0)])
    hits = referee.closest(origins, down)
    assert hits.triangle.tolist() == [0, 1]
    assert referee.classify_primary(hits, np.array([1, 0])).tolist() == [verdict, verdict]
    # From the plane below, a light above sees the same border.
    up = referee.closest(np.float32([(x, -2, 0.25) for x in origins[:, 0]]), np.float32([(0, 1, 0)] * 2))
    assert up.triangle.tolist() == [1, 1]
    light = np.float32([0, 2.0**20, 0.25])
    exact = referee.occluded(up, light)
    assert exact.tolist() == [1, 0]
    said = referee.classify_shadow(up, light, 1 - exact)
    wrong = [Verdict.LEAK, Verdict.ACNE]
    assert said.tolist() == ([Verdict.EDGE] * 2 if verdict == Verdict.EDGE else wrong)


def test_duplicates_with_different_holes_are_not_one():
    points, faces = ball_on_floor()
    prepared = make((points, np.concatenate([faces, faces])), lambda g: perforated(g, 2, 6))
    moment = prepared.moment(0, *SIZE)
    referee = Judge.of(prepared, moment).referee
    masked = prepared.alpha.triangles != 0
    assert (referee.duplicate_of[masked] == np.nonzero(masked)[0]).all()
    assert (referee.duplicate_of[~masked] < len(faces)).all()


# --- declaration and files ------------------------------------------------------------------------------------


def broken(**changes):
    def mask(geometry):
        return replace(perforated(geometry, 2, 2), **changes)

    return mask


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"triangles": np.zeros(3, np.uint8)}, "one flag a triangle"),
        ({"coordinates": np.zeros((3, 3, 2), np.float32)}, "texture coordinates have shape"),
        ({"coordinates": np.full((1, 3, 2), np.nan, np.float32)}, "not finite"),
        ({"coordinates": np.full((1, 3, 2), 1e10, np.float32)}, "too often"),
        ({"opaque": np.zeros((0, 4), np.uint8)}, "at least one texel"),
        ({"opaque": np.zeros(4, np.uint8)}, "rows first"),
    ],
)
def test_a_mask_that_does_not_fit_is_refused(changes, says):
    with pytest.raises(UserError, match=says):
        make(([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)]), broken(**changes))


def test_perforated_masks_every_nth_triangle():
    geometry = Geometry.static(*ball_on_floor())
    assert np.nonzero(perforated(geometry, 5).triangles)[0].tolist() == list(range(0, len(geometry.faces), 5))
    with pytest.raises(ValueError, match="at least 1"):
        perforated(geometry, 0)


def test_raw_answers_keep_the_mask(tmp_path):
    prepared, moment, judge = holed()
    answers = answers_of("uniform_grid", {}, prepared)
    path = tmp_path / "a.npz"
    save_raw(path, prepared, moment, answers, "nowhere")
    score = score_raw(path).score
    assert score.true_errors == 0
    assert score.truth["surfaces"] == judge.reference.provenance["surfaces"]
    kept = next(tmp_path.glob("mesh-*.npz"))
    with np.load(kept) as stored:
        arrays = {name: stored[name] for name in stored.files}
    arrays["alpha_opaque"] = 1 - arrays["alpha_opaque"]
    np.savez(kept, **arrays)
    with pytest.raises(UserError, match="surfaces of nowhere differ"):
        score_raw(path)


def test_references_and_scenes_with_masks_are_stored_and_read_back(tmp_path):
    prepared, moment, judge = holed()
    assert judge.reference.provenance["reference"] == "exact referee"
    assert "filter functions" in judge.reference.provenance["why"]
    one = Judge.of(prepared, moment, folder=tmp_path).reference
    two = Judge.of(prepared, moment, folder=tmp_path).reference
    assert len(list(tmp_path.glob("truth-*.npz"))) == 1
    assert not same(one.answers(), two.answers())
    assert not same(one.answers(), judge.reference.answers())
    store(tmp_path / "scene.npz", prepared, [0])
    again = read_stored(tmp_path / "scene.npz", prepared.scene).alpha
    assert again is not None
    assert all((getattr(again, n) == getattr(prepared.alpha, n)).all() for n in ("triangles", "coordinates", "opaque"))


def test_effects_without_alpha_see_solid_triangles():
    prepared, moment, _ = holed()
    effects = replace(Effects.of(prepared.scene), alpha=False)
    answers = Session(make_method("uniform_grid", {}), prepared, *SIZE, "cpu", effects=effects).answers(moment)
    assert not same(answers, answers_of("uniform_grid", {}, make(ball_on_floor(), None)))
    assert score_answers(Judge.of(prepared, moment, effects), answers).score.true_errors == 0
