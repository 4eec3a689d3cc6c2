"""Triangles with holes: the rule against rational brute force, the referee's classes, and every method that can."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from functools import cache

import numpy as np
import pytest
import warp as wp
from exact_cases import inside, rational, solve
from shadowbench.harness.alpha import checked, perforated
from shadowbench.harness.errors import UserError
from shadowbench.harness.exact import edge_bound
from shadowbench.harness.hardcases import holes
from shadowbench.harness.hardcases.case import ball, joined, quad, soup
from shadowbench.harness.hardcases.judge import Judged, judge_case
from shadowbench.harness.moment import Moment, Prepared
from shadowbench.harness.raw import save_raw, score_raw
from shadowbench.harness.referee import Referee, Verdict
from shadowbench.harness.registry import make_method
from shadowbench.harness.scene import AlphaMask, Camera, Effects, Geometry, Light, Scene
from shadowbench.harness.score import Judge
from shadowbench.harness.session import Session
from shadowbench.harness.share import Stored, store
from shadowbench.methods.perspective_spherical.culling import refusal

SIZE = (24, 18)
EXACT = [
    ("uniform_grid", {}),
    ("bvh", {"update": "bvh_rebuild"}),
    ("perspective_spherical", {}),
    ("ray_grids", {}),
    ("ray_grids", {"queue": "always", "inline_cells": "0"}),
    ("perspective_spherical", {"light_map": "cube", "clamp": "none", "triangle_chunk": "3"}),
]
NAMES = ["-".join([name, *(f"{k}={v}" for k, v in settings.items())]) for name, settings in EXACT]


def make(
    mesh, alpha, lights=((1.0, 2.5, 0.5), (0.1, 0.7, 0.05)), eye=(0.3, 1.7, 3.1), target=(0.2, 0.25, 0.1)
):
    points, faces = np.asarray(mesh[0], dtype=np.float64), np.asarray(mesh[1], dtype=np.int32)
    return Prepared(
        Scene(
            "holes", "Holes", lambda: Geometry.static(points, faces), Camera(eye, target),
            tuple(Light(tuple(light)) for light in lights), alpha=alpha,
        )
    )  # fmt: skip


def ball_on_floor():
    return joined(quad((-3, 0, -3), (3, 0, -3), (3, 0, 3), (-3, 0, 3)), ball(0.5, (0, 0.6, 0)))


@cache
def holed() -> tuple[Prepared, Moment, Judge]:
    """A chequered ball on a half chequered floor, one light outside, one inside the ball."""
    prepared = make(ball_on_floor(), lambda geometry: perforated(geometry, 2, 6))
    moment = prepared.moment(0, *SIZE)
    return prepared, moment, Judge(prepared, moment)


def answers_of(name: str, settings: dict, prepared: Prepared, size=SIZE, device="cpu"):
    moment = prepared.moment(0, *size)
    return Session(make_method(name, settings), prepared, *size, device).answers(moment)


def same(one, other) -> list[str]:
    return [name for name in one if one[name].tobytes() != other[name].tobytes()]


# --- the rule -------------------------------------------------------------------------------------------------


def opaque(mask: AlphaMask, k: int, u: Fraction, v: Fraction) -> bool:
    """The rule as it is written: any texel that holds the place, border included."""
    if not mask.triangles[k]:
        return True
    c = [rational(corner) for corner in mask.coordinates[k]]
    rows, columns = mask.opaque.shape
    place = [(1 - u - v) * c[0][i] + u * c[1][i] + v * c[2][i] for i in (0, 1)]
    x, y = place[0] * columns, place[1] * rows
    across = {int(x // 1) % columns, int(-(-x // 1) - 1) % columns}
    along = {int(y // 1) % rows, int(-(-y // 1) - 1) % rows}
    return any(mask.opaque[row, column] for row in along for column in across)


def brute_hit(prepared: Prepared, moment: Moment, o, d, limit=None) -> tuple[Fraction | None, int]:
    best, index = None, -1
    for k, face in enumerate(prepared.faces):
        found = solve(o, d, [rational(moment.points[v]) for v in face]) if moment.valid[k] else None
        if not inside(found) or found is None or found[0] <= 0 or (limit is not None and found[0] >= limit):
            continue
        if opaque(prepared.alpha, k, found[1], found[2]) and (best is None or found[0] < best):
            best, index = found[0], k
    return best, index


def random_mask(geometry: Geometry) -> AlphaMask:
    """Oblique coordinates that repeat and go below zero, a bitmap that is not square, two triangles of three masked."""
    random = np.random.default_rng(5)
    count = len(geometry.faces)
    flags = (np.arange(count) % 3 != 0).astype(np.uint8)
    coordinates = random.uniform(-2, 2, (count, 3, 2)).astype(np.float32)
    return AlphaMask(flags, coordinates, random.integers(0, 2, (5, 3)).astype(np.uint8))


@pytest.mark.parametrize("mask", [random_mask, lambda g: perforated(g, 1, 3)], ids=["random", "perforated"])
def test_the_referee_agrees_with_rational_brute_force(mask):
    prepared = make(
        soup(3, 14, 0.9), mask, lights=((0.3, 0.2, 0.1), (2, 3, 1)), eye=(0, 0, 2.5), target=(0, 0, 0)
    )
    moment = prepared.moment(0, 9, 7)
    referee = Referee(moment.points, prepared.faces, moment.valid, mask=prepared.alpha)
    hits = referee.closest(moment.eye, moment.directions(np.arange(63)))
    through = Referee(moment.points, prepared.faces, moment.valid).closest(hits.origins, hits.directions)
    assert np.count_nonzero(hits.triangle != through.triangle) > 5
    bits = [referee.occluded(hits, light) for light in moment.lights]
    for i in range(63):
        o, d = rational(moment.eye), rational(hits.directions[i])
        t, triangle = brute_hit(prepared, moment, o, d)
        assert hits.triangle[i] == triangle
        if t is None:
            continue
        p = [x + t * y for x, y in zip(o, d, strict=True)]
        for light, row in zip(moment.lights, bits, strict=True):
            way = [x - y for x, y in zip(rational(light), p, strict=True)]
            assert row[i] == (brute_hit(prepared, moment, p, way, 1)[1] >= 0)
    assert 0 < bits[1].sum() < 63


def wall(mask, lights=((0.0, 0.0, 3.0),)) -> Prepared:
    """A masked square before a plain one, seen head on: pixel centres at odd multiples of 1/16 at the first."""
    near = quad((-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0))
    far = quad((-8, -8, -4), (8, -8, -4), (8, 8, -4), (-8, 8, -4))
    points, faces = np.concatenate([near[0], far[0]]), np.concatenate([near[1], np.asarray(far[1]) + 4])
    return Prepared(
        Scene(
            "wall", "Wall", lambda: Geometry.static(points, faces.astype(np.int32)),
            Camera((0, 0, 1), (0, 0, 0), fov=90.0), tuple(Light(x) for x in lights), alpha=mask,
        )
    )  # fmt: skip


def squares(side: float):
    """A mask of the first square: chequered, texels ``side`` long, a corner of them in its middle."""

    def mask(geometry: Geometry) -> AlphaMask:
        flags = np.zeros(len(geometry.faces), dtype=np.uint8)
        flags[:2] = 1
        coordinates = np.zeros((len(flags), 3, 2), dtype=np.float32)
        corners = np.asarray(geometry.positions(0))[geometry.faces[:2]]
        coordinates[:2] = corners[..., :2] / (2 * side)
        return AlphaMask(flags, coordinates, np.eye(2, dtype=np.uint8))

    return mask


@pytest.mark.parametrize(("name", "settings"), EXACT, ids=NAMES)
@pytest.mark.parametrize("side", [1 / 16, 1 / 4], ids=["every ray on borders", "rays inside texels"])
def test_rays_on_borders_count_where_either_side_is_opaque(name, settings, side):
    prepared = wall(squares(side))
    answers = answers_of(name, settings, prepared, (16, 16))
    x, y = np.meshgrid(*2 * [np.arange(-15, 16, 2) / 16])
    if side == 1 / 16:
        seen = np.ones((16, 16), dtype=bool)  # each ray meets four texels, two of them opaque
    else:
        seen = (np.floor(x * 4) + np.floor(-y * 4)) % 2 == 0
    assert ((answers["triangle"].reshape(16, 16) < 2) == seen).all()
    moment = prepared.moment(0, 16, 16)
    assert Judge(prepared, moment).score(answers)["true_errors"] == 0


# --- methods --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("name", "settings"), EXACT, ids=NAMES)
def test_exact_methods_are_right_and_alike(name, settings):
    prepared, _, judge = holed()
    answers = answers_of(name, settings, prepared)
    score = judge.score(answers, extra_pixels=SIZE[0] * SIZE[1])
    assert score["true_errors"] == 0
    assert score["excused_share"] == 0
    assert not same(answers, answers_of(*EXACT[0], prepared))
    plain = answers_of(name, settings, make(ball_on_floor(), None))
    assert np.count_nonzero(plain["triangle"] != answers["triangle"]) > 20
    assert np.count_nonzero(plain["visibility"] != answers["visibility"]) > 20


@pytest.mark.parametrize(("name", "settings"), EXACT, ids=NAMES)
def test_an_opaque_mask_changes_no_bit(name, settings):
    def full(geometry):
        return replace(perforated(geometry, 1, 6), opaque=np.ones((2, 2), dtype=np.uint8))

    plain = answers_of(name, settings, make(ball_on_floor(), None))
    assert not same(answers_of(name, settings, make(ball_on_floor(), full)), plain)


@pytest.mark.parametrize(("name", "settings"), EXACT, ids=NAMES)
def test_transparent_triangles_are_as_if_they_were_gone(name, settings):
    def clear(geometry):
        return replace(perforated(geometry, 3, 6), opaque=np.zeros((1, 1), dtype=np.uint8))

    points, faces = ball_on_floor()
    gone = faces.copy()
    gone[::3] = gone[::3, :1]  # no area: never hit, and every other triangle keeps its index
    clear_answers = answers_of(name, settings, make((points, faces), clear))
    assert not same(clear_answers, answers_of(name, settings, make((points, gone), None)))


@pytest.mark.parametrize("chunk", ["0", "5"])
def test_triangles_staged_in_shared_memory_have_the_same_holes(chunk, monkeypatch):
    monkeypatch.setattr(wp.config, "enable_cpu_blocks", True)
    settings = {"tile": "4", "k": "2", "r": "40", "staging": "shared", "triangle_chunk": chunk}
    prepared, moment, _ = holed()
    session = Session(make_method("perspective_spherical", settings), prepared, *SIZE, "cpu")
    assert not same(session.answers(moment), answers_of(*EXACT[0], prepared))
    assert session.method.built()["staging"] == "shared"


def test_a_shadow_map_is_drawn_with_holes():
    """Its primary rays are exact; of its shadow bits few are wrong, and many would be without the holes."""
    prepared, _, judge = holed()
    exact = judge.reference.answers()
    answers = answers_of("shadow_map", {"size": "1024"}, prepared)
    hits = exact["triangle"] >= 0
    assert (answers["triangle"] == exact["triangle"]).all()
    wrong = np.count_nonzero((answers["visibility"] != exact["visibility"])[:, hits])
    solid = replace(Effects.of(prepared.scene), alpha=False)
    moment = prepared.moment(0, *SIZE)
    blind = Session(
        make_method("shadow_map", {"size": "1024"}), prepared, *SIZE, "cpu", effects=solid
    ).answers(moment)
    same_hits = hits & (blind["triangle"] == exact["triangle"])
    ignored = np.count_nonzero((blind["visibility"] != exact["visibility"])[:, same_hits])
    assert wrong < 0.05 * 2 * np.count_nonzero(hits)
    assert ignored > 4 * wrong


@cache
def judged(case) -> Judged:
    return Judged(case, case.make())


@pytest.mark.parametrize(("name", "settings"), EXACT, ids=NAMES)
def test_no_hard_case_of_holes_needs_an_excuse(name, settings):
    for case in holes.CASES:
        finding = judge_case(judged(case), make_method(name, settings), "cpu")
        assert (finding.status, finding.classes) == ("ok", {}), case.name


@pytest.mark.parametrize(("name", "settings"), EXACT, ids=NAMES)
def test_holes_move_with_their_triangles(name, settings):
    """Frame after frame as only what moved calls for, against frames made from nothing."""
    points, faces = ball_on_floor()

    def positions(frame: int):
        moved = points.copy()
        moved[4:] *= (1 + 0.2 * frame, 1 - 0.2 * frame, 1.0)
        return moved

    still = make((points, faces), lambda geometry: perforated(geometry, 2, 6)).scene
    prepared = Prepared(replace(still, geometry=lambda: Geometry(faces.astype(np.int32), positions, 3)))
    lights = tuple(light.moved((-0.5, 2.0, 0.7)) for light in still.lights)
    moments = [prepared.moment(k, *SIZE) for k in range(3)] + [prepared.moment(2, *SIZE, lights=lights)]
    session = Session(make_method(name, settings), prepared, *SIZE, "cpu")
    for moment in moments:
        changed = session.advance(moment)
        assert ("points" in changed) == (moment is not moments[-1])
        assert "surfaces" not in changed or moment is moments[0]
        fresh = Session(make_method(*EXACT[0]), prepared, *SIZE, "cpu").answers(moment)
        assert not same(session.frame.answers.to_host(), fresh)


def test_without_masks_nothing_is_kept_or_launched():
    plain, masked = (
        Session(make_method("uniform_grid", {}), prepared, *SIZE, "cpu")
        for prepared in (make(ball_on_floor(), None), holed()[0])
    )
    assert [work.name for work in plain.all_passes] == [work.name for work in masked.all_passes]
    assert not any("surfaces" in work.reads for work in plain.all_passes)
    arrays = (plain.frame.alpha.masked, plain.frame.alpha.coordinates, plain.frame.alpha.opaque)
    assert sum(array.capacity for array in arrays) == 0
    reading = [work.name for work in masked.all_passes if "surfaces" in work.reads]
    assert reading == ["primary rays", "light 0: shadow rays", "light 1: shadow rays"]


@pytest.mark.parametrize("name", ["embree", "bvh", "accuracy_ladder"])
def test_what_cannot_take_part_says_why(name):
    reason = make_method(name, {}).applies(holed()[0].scene, "cpu")
    assert reason is not None
    assert reason.startswith("alpha: ")
    assert "not supported" not in reason


def test_culling_is_refused_where_back_faces_are_seen_through_holes():
    solid = replace(make(ball(0.5, (0, 0, 0)), None).scene, closed=True)
    assert refusal(solid, lights_too=True) is None
    assert "holes" in (refusal(replace(solid, alpha=perforated), lights_too=True) or "")


# --- truth and classes ----------------------------------------------------------------------------------------


def test_truth_is_the_referee_and_says_why():
    _, _, judge = holed()
    assert judge.reference.provenance["reference"] == "exact referee"
    assert "filter functions" in judge.reference.provenance["why"]


def test_ignoring_holes_is_a_true_error():
    _, _, judge = holed()
    blind = answers_of("uniform_grid", {}, make(ball_on_floor(), None))
    score = judge.score(blind)
    wrong = np.count_nonzero(blind["triangle"] != judge.reference.triangle)
    assert wrong > 20
    assert score["primary"]["true"] == wrong
    assert score["primary"]["edge"] == score["primary"]["near_tie"] == 0
    right = {**judge.reference.answers()}
    right["visibility"] = 1 - right["visibility"]
    right["visibility"][:, right["triangle"] < 0] = 0
    bits = judge.score(right)["shadow"]
    assert sum(light["acne"] + light["leak"] for light in bits) == 2 * np.count_nonzero(
        right["triangle"] >= 0
    )


@pytest.mark.parametrize(("bounds", "verdict"), [(0.5, Verdict.EDGE), (3.0, Verdict.TRUE)])
def test_a_border_excuses_within_the_bound_only(bounds, verdict):
    """A ray straight down on a half opaque triangle, so many bounds inside the opaque half."""
    points = np.array(
        [(-1, 0, -1), (3, 0, -1), (-1, 0, 3), (-9, -1, -9), (9, -1, -9), (0, -1, 9)], np.float32
    )
    faces = np.array([(0, 1, 2), (3, 4, 5)], np.int32)
    coordinates = points[faces][..., [0, 2]] / 16 + 0.5
    mask = checked(AlphaMask([1, 0], coordinates, np.array([[1, 0]])), 2, "half")
    referee = Referee(points, faces, np.ones(2), mask=mask)
    bound = float(edge_bound(np.float32([[0, 2, 0]]), points[faces[:1]])[0])
    origins = np.float32([(-bounds * bound, 2, 0.25), (bounds * bound, 2, 0.25)])
    down = np.float32([(0, -1, 0), (0, -1, 0)])
    hits = referee.closest(origins, down)
    assert hits.triangle.tolist() == [0, 1]
    assert referee.classify_primary(hits, np.array([1, 0])).tolist() == [verdict, verdict]
    # From the plane below, a light above sees the same border.
    up = referee.closest(np.float32([(x, -2, 0.25) for x in origins[:, 0]]), np.float32([(0, 1, 0)] * 2))
    assert up.triangle.tolist() == [1, 1]
    light = np.float32([0, 2.0**20, 0.25])
    truth = referee.occluded(up, light)
    assert truth.tolist() == [1, 0]
    said = referee.classify_shadow(up, light, 1 - truth)
    wrong = [Verdict.LEAK, Verdict.ACNE]
    assert said.tolist() == ([Verdict.EDGE] * 2 if verdict == Verdict.EDGE else wrong)


def test_duplicates_with_different_holes_are_not_one():
    points, faces = ball_on_floor()
    prepared = make((points, np.concatenate([faces, faces])), lambda g: perforated(g, 2, 6))
    moment = prepared.moment(0, *SIZE)
    referee = Judge(prepared, moment).referee
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
    score = score_raw(path)
    assert score["true_errors"] == 0
    assert score["truth"]["surfaces"] == judge.reference.provenance["surfaces"]
    kept = next(tmp_path.glob("mesh-*.npz"))
    with np.load(kept) as stored:
        arrays = {name: stored[name] for name in stored.files}
    arrays["alpha_opaque"] = 1 - arrays["alpha_opaque"]
    np.savez(kept, **arrays)
    with pytest.raises(UserError, match="surfaces of nowhere differ"):
        score_raw(path)


def test_truth_and_scenes_with_masks_are_kept_and_read_back(tmp_path):
    prepared, moment, judge = holed()
    one = Judge(prepared, moment, folder=tmp_path).reference
    two = Judge(prepared, moment, folder=tmp_path).reference
    assert len(list(tmp_path.glob("truth-*.npz"))) == 1
    assert not same(one.answers(), two.answers())
    assert not same(one.answers(), judge.reference.answers())
    store(tmp_path / "scene.npz", prepared, [0])
    again = Stored(tmp_path / "scene.npz", prepared.scene).alpha
    assert again is not None
    assert all(
        (getattr(again, n) == getattr(prepared.alpha, n)).all()
        for n in ("triangles", "coordinates", "opaque")
    )


def test_effects_without_alpha_see_solid_triangles():
    prepared, moment, _ = holed()
    effects = replace(Effects.of(prepared.scene), alpha=False)
    answers = Session(make_method("uniform_grid", {}), prepared, *SIZE, "cpu", effects=effects).answers(
        moment
    )
    assert not same(answers, answers_of("uniform_grid", {}, make(ball_on_floor(), None)))
    assert Judge(prepared, moment, effects).score(answers)["true_errors"] == 0
