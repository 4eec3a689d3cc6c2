"""Two levels: the exact answers, and those of other methods, however bodies lie and move (``poses.py``); and
what does not move as bodies do.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest
from helpers.effect_scenes import BEHIND, SPOT, all_mirrors
from helpers.exact_answers import assert_right, exact_answers
from helpers.judged_hard_cases import judged
from helpers.method_trials import lattice
from helpers.small_scenes import assert_same, soup
from numpy.typing import NDArray
from shadowbench.harness import api
from shadowbench.harness.errors import CapacityRejected, UserError
from shadowbench.harness.frame.registry import make_method
from shadowbench.harness.frame.schedule.needed import stale
from shadowbench.harness.frame.session import Session
from shadowbench.harness.hardcases.judge import Judged, judge_case
from shadowbench.harness.hardcases.shapes import Mesh, ball, box, joined, triangles
from shadowbench.harness.scene.overrides import perforated
from shadowbench.harness.scene.prepared import Prepared, prepare
from shadowbench.harness.scene.scene import Camera, Geometry, Light, Moves, Scene
from shadowbench.methods.two_level_bvh import TwoLevelTree
from shadowbench.methods.two_level_bvh.forest import Forest

NAME = "two_level_bvh"
Pose = tuple[NDArray, NDArray]
"""A rotation [3, 3], and then a translation [3]."""

CAMERA = Camera((0.4, 1.5, 4.5), (0.0, 0.3, 0.0))
LIGHTS = (Light((2.0, 3.5, 1.0)), Light((-1.5, 0.4, 2.5)))


def turn(axis: Sequence[float], angle: float) -> NDArray:
    """The rotation about an axis by so many radians (Rodrigues' formula)."""
    x, y, z = np.asarray(axis, dtype=np.float64) / np.linalg.norm(axis)
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def moving(
    meshes: Sequence[Mesh], pose: Callable[[int, int], Pose], frames: int = 3, scale: float = 1.0,
    camera: Camera = CAMERA, lights: tuple[Light, ...] = LIGHTS,
) -> Prepared:  # fmt: skip
    """Bodies, each in its ``pose(body, frame)``. ``scale``: of all, also of the way to camera and lights."""
    points, faces = joined(*meshes)
    of = np.repeat(np.arange(len(meshes)), [len(mesh[0]) for mesh in meshes])

    def positions(frame: int) -> NDArray[np.float64]:
        poses = [pose(body, frame) for body in range(len(meshes))]
        return scale * np.concatenate(
            [points[of == body] @ rotation.T + place for body, (rotation, place) in enumerate(poses)]
        )

    eye, target = (tuple(scale * np.array(point)) for point in (camera.eye, camera.target))
    lights = tuple(light.moved(tuple(scale * np.array(light.position))) for light in lights)
    motion = Moves("rigid", bodies=of[faces[:, 0]])
    geometry = Geometry(faces.astype(np.int32), positions, frames, motion)
    return prepare(Scene("rigid", "Rigid", lambda: geometry, replace(camera, eye=eye, target=target), lights))


def tumbling(body: int, frame: int, way: Sequence[float] = (0.1, 0.05, -0.1)) -> Pose:
    """Body 0 rests; the others turn about axes of their own, and go their way."""
    if body == 0 or frame == 0:
        return np.eye(3), np.zeros(3)
    return turn((1.0, body, 2.0 - body), 0.7 * frame + 0.3 * body), frame * np.array(way) * (-1.0) ** body


GROUND = box((-3.0, -0.6, -3.0), (3.0, -0.5, 3.0))
SCENES: dict[str, Callable[[], Prepared]] = {
    "apart": lambda: moving([GROUND, ball(0.5, (-0.8, 0.4, 0.0)), ball(0.4, (0.9, 0.6, 0.3))], tumbling),
    "one body": lambda: moving([ball(0.9, (0.0, 0.4, 0.0))], lambda body, frame: tumbling(1, frame)),
    "touching": lambda: moving(
        [GROUND, box((-0.5, -0.5, -0.5), (0.5, 0.5, 0.5)), box((0.5, -0.5, -0.5), (1.5, 0.5, 0.5))],
        lambda body, frame: (turn((0.0, 1.0, 0.0), 0.4 * frame * (body > 0)), np.zeros(3)),
    ),
    "nested": lambda: moving(
        [box((-1.0, -0.4, -1.0), (1.0, 1.4, 1.0)), ball(0.8, (0.0, 0.5, 0.0)), ball(0.4, (0.0, 0.5, 0.0))],
        lambda body, frame: tumbling(body, frame, (0.0, 0.0, 0.0)),
        camera=Camera((0.3, 0.8, 0.95), (0.0, 0.5, 0.0), fov=80.0),
    ),
    "single triangles": lambda: moving(
        [GROUND, *((triangle, np.array([[0, 1, 2]])) for triangle in soup(5, 12)[0].reshape(-1, 3, 3))], tumbling
    ),
    "through one another": lambda: moving([GROUND, *(ball(0.6, (0.2 * k, 0.4, 0.1 * k)) for k in range(4))], tumbling),
}
"""By name, each of three frames."""


def dealt(prepared: Prepared, bodies: NDArray[np.integer]) -> Prepared:
    """The same mesh with these bodies."""
    return replace(prepared, geometry=replace(prepared.geometry, motion=Moves("rigid", bodies=bodies)))


def assert_exact_in_frames(
    prepared: Prepared, frames: Sequence[int], size: int = 24, device: str = "cpu", **settings: str
) -> Session:
    """The answers of one session in these frames are exact; the session."""
    session = Session(make_method(NAME, settings), prepared, size, size, device)
    for frame in frames:
        moment = prepared.moment(frame, size, size)
        assert_right(session.answers(moment), exact_answers(prepared, moment), f"in frame {frame}")
    return session


TWO_BALLS = [GROUND, ball(0.5, (-0.8, 0.4, 0.0)), ball(0.4, (0.9, 0.6, 0.3))]


def bodies_of(session: Session) -> int:
    """How many bodies there are trees of; 0: all triangles are in a single tree."""
    found: int = session.method.built().get("bodies", 0)
    return found


@pytest.mark.parametrize("name", SCENES)
def test_answers_are_exact_as_bodies_move(name, device):
    session = assert_exact_in_frames(SCENES[name](), [0, 1, 2, 1], device=device)
    assert (bodies_of(session), session.regrown) == (session.frame.prepared.bodies.max() + 1, 0)


@pytest.mark.parametrize("scale", [1e-36, 1e-30, 1e-6, 1e6, 1e30, 3e37])
def test_answers_are_exact_at_any_size(scale, device):
    """A scene too large to be turned in float32 has one tree."""
    session = assert_exact_in_frames(moving(TWO_BALLS, tumbling, scale=scale), [0, 2], device=device)
    assert bodies_of(session) == (3 if scale < 1e37 else 0)


@pytest.mark.parametrize("way", [(1e3, 0.0, 0.0), (1e6, 2e5, 0.0)], ids=str)
def test_boxes_grow_with_the_scene(way, device):
    """Bodies that have gone far, and come back: of the frame's coordinates float32 loses more than of the first one's."""
    prepared = moving(TWO_BALLS, lambda body, frame: tumbling(body, frame, way))
    session = assert_exact_in_frames(prepared, [0, 1, 2, 0], device=device)
    assert bodies_of(session) == 3
    assert session.regrown > 0


def test_an_offset_of_the_whole_scene_is_none():
    prepared = moving(TWO_BALLS, lambda body, frame: (tumbling(body, frame)[0], np.array([1e6, 1e6, 0.0])),
                      camera=Camera((1e6 + 0.4, 1e6 + 1.5, 4.5), (1e6, 1e6 + 0.3, 0.0)),
                      lights=(Light((1e6 + 2.0, 1e6 + 3.5, 1.0)),))  # fmt: skip
    assert assert_exact_in_frames(prepared, [0, 1, 2]).regrown == 0


def test_a_thousand_bodies(device):
    """The bits of another exact method, with bodies small and large."""
    vertices, _ = soup(11, 2000, size=0.15, spread=1.5)
    meshes = [(part, np.array([[0, 1, 2], [3, 4, 5]])) for part in vertices.reshape(-1, 6, 3)]
    assert_same_as_bvh2(moving(meshes, tumbling), (0, 1), device, size=48)


def assert_same_as_bvh2(prepared: Prepared, frames: tuple[int, ...], device: str = "cpu", size: int = 32) -> Session:
    own, other = (Session(make_method(name), prepared, size, size, device) for name in (NAME, "bvh2"))
    for frame in frames:
        moment = prepared.moment(frame, size, size)
        assert_same(own.answers(moment), other.answers(moment), f"frame {frame}")
    assert bodies_of(own) == prepared.bodies.max() + 1
    return own


def test_balls_of_the_catalogue_have_the_bits_of_bvh2(device):
    assert_same_as_bvh2(prepare(api.resolve("balls-2k-moving60")), (0, 7, 20), device, size=64)


EFFECTS = {
    "holes": {"alpha": lambda geometry: perforated(geometry, 2, 6)},
    "mirrors": {"mirror": all_mirrors, "bounces": 2},
    "receivers": {"lights": (SPOT, BEHIND), "facing": True},
    "directional": {"lights": (Light((1.0, 2.0, 0.5), directional=True), *LIGHTS)},
    "orthographic": {"camera": Camera((0.4, 1.5, 4.5), (0.0, 0.3, 0.0), height=3.0)},
    "targets": {"lights": (Light((2.0, 3.5, 1.0), shape="disc", size=0.5, samples=3),)},
    "far light": {"lights": (Light((2e7, 3e7, 1e7)), Light((1e38, 3e38, 1e38)))},
}


@pytest.mark.parametrize("effect", EFFECTS)
def test_effects_have_the_bits_of_bvh2(effect, device):
    scene = replace(SCENES["apart"]().scene, **EFFECTS[effect])
    assert_same_as_bvh2(prepare(scene), (0, 1, 2), device)


SAMPLE = ["P01y", "P06 holes 208", "S09", "S21", "A03", "M02b", "H03", "V ball x1e+03", "V subnormal x", "V sun 1e+20"]


@pytest.mark.parametrize("name", SAMPLE)
def test_hard_cases_dealt_out_to_bodies(name, device):
    """Which triangles a tree holds, and how many trees there are, changes no answer."""
    case, trial = judged(name).case, judged(name).trial
    prepared = dealt(trial.prepared, np.arange(trial.prepared.triangle_count) * 7 % 5)
    finding = judge_case(Judged(case, replace(trial, prepared=prepared)), make_method(NAME), device)
    assert finding.status == "ok", finding


def test_bodies_at_rest_are_known_by_their_own_numbers():
    prepared = dealt(SCENES["one body"](), np.repeat([40, -3], 45))
    assert prepared.bodies.tolist() == [1] * 45 + [0] * 45
    assert bodies_of(assert_exact_in_frames(prepared, [0, 1])) == 2


def plates(off: float = 0.0) -> Prepared:
    """Flat lattices, seen from so far away that a box without padding is missed. ``off``: :func:`loosened`."""
    flat, faces = lattice(6)
    meshes = [(flat @ turn(axis, np.pi / 2).T, faces) for axis in ((0, 0, 1), (1, 0, 0), (0, 1, 0))]
    pose = lambda body, frame: (turn((1, body, 2 - body), 0.8 * frame), frame * np.array([0.3, -0.2, 0.1]))  # noqa: E731
    return loosened(moving(meshes, pose, camera=Camera((0.4e5, 1.0e5, 2.5e5), (0.3, 0.0, 0.0), fov=6e-4)), off)


def unlike_bvh2(prepared: Prepared) -> int:
    own, other = (Session(make_method(name), prepared, 64, 64, "cpu") for name in (NAME, "bvh2"))
    moments = [prepared.moment(frame, 64, 64) for frame in range(3)]
    return sum(int((own.answers(m)["triangle"] != other.answers(m)["triangle"]).sum()) for m in moments)


def test_boxes_that_are_padded_too_little_are_found(monkeypatch):
    packed = Forest.packed
    assert unlike_bvh2(plates()) == 0
    monkeypatch.setattr(Forest, "packed", lambda self, pad: packed(self, 0.01 * pad))
    assert unlike_bvh2(plates()) > 20


def loosened(prepared: Prepared, off: float) -> Prepared:
    """The scene with each vertex moved by as much as ``off`` after the first frame."""
    geometry = prepared.geometry
    noise = np.random.default_rng(3).uniform(-off, off, geometry.positions(0).shape)
    loose = replace(geometry, positions=lambda frame: geometry.positions(frame) + noise * (frame > 0))
    return prepare(replace(prepared.scene, geometry=lambda: loose))


def wobbling(off: float) -> Prepared:
    return loosened(moving(TWO_BALLS, tumbling), off)


def test_vertices_that_are_a_little_off_widen_the_boxes(device):
    session = assert_exact_in_frames(wobbling(1e-4), [0, 1, 2], device=device)
    assert (bodies_of(session), session.regrown) == (3, 1)


def test_boxes_that_are_not_widened_for_it_are_found(monkeypatch):
    assert unlike_bvh2(plates(0.7)) == 0
    monkeypatch.setattr(TwoLevelTree, "grow", lambda self, needed: False)
    assert unlike_bvh2(plates(0.7)) > 20


def test_a_mesh_that_deforms_is_traced_with_one_tree(device):
    for prepared in (wobbling(0.05), plain(wobbling(0.05))):
        session = assert_exact_in_frames(prepared, [0, 1, 2], device=device)
        assert bodies_of(session) == 0
        assert "together" in session.method.built()["because"] or "themselves" in session.method.built()["because"]


def plain(prepared: Prepared) -> Prepared:
    """The same mesh without a word on bodies."""
    return replace(prepared, geometry=replace(prepared.geometry, motion=None))


def test_or_rejected_where_that_is_asked_for():
    for prepared, why in (
        (wobbling(0.05), "vertices move by 0.00\\d of the scene or more among themselves"),
        (plain(wobbling(0.05)), "nothing says which triangles of rigid move together"),
    ):
        with pytest.raises(CapacityRejected, match=f"{why}, and of a mesh that deforms no tree"):
            assert_exact_in_frames(prepared, [0, 1], deforming="refuse")


def test_triangles_that_lose_their_area_and_gain_one(device):
    """Collinear corners are rounded off their line as they turn; a triangle may be a point."""
    thin = np.array([(-1.0, 0.25, 0.5), (0.0, 0.5, 0.75), (1.0, 0.75, 1.0)])
    prepared = moving([GROUND, ball(0.5, (0.0, 0.4, 0.0)), triangles(*thin), triangles(*[thin[0]] * 3)], tumbling)
    assert len({int(prepared.points(k)[1].sum()) for k in range(3)}) > 1
    assert_exact_in_frames(prepared, [0, 1, 2, 0], device=device)


def test_vertices_that_are_no_numbers(device):
    """A body that vanishes is not hit, and comes back; what appears where nothing was known has no kept tree."""
    prepared = moving(TWO_BALLS, tumbling)
    geometry = prepared.geometry
    count = len(geometry.positions(0))

    def gone(when: int):
        def positions(frame: int) -> np.ndarray:
            made = geometry.positions(frame)
            made[count - 47 :] = np.where(frame == when, np.nan, made[count - 47 :])
            return made

        return prepare(replace(prepared.scene, geometry=lambda: replace(geometry, positions=positions)))

    assert bodies_of(assert_exact_in_frames(gone(1), [0, 1, 2], device=device)) == 3
    assert bodies_of(assert_exact_in_frames(gone(0), [0, 1], device=device)) == 0


def test_where_only_lights_or_the_camera_move_both_levels_stay():
    session = Session(make_method(NAME), SCENES["apart"](), 16, 16, "cpu")
    builds = [work.name for work in session.all_passes if work.part == "build"]
    assert builds == ["bodies: poses", "bodies: boxes", "bodies: tree", "box"]
    for changed in ({"light/0"}, {"camera"}):
        assert not [work.name for work in stale(session.all_passes, changed) if work.part == "build"]
    assert {work.name for work in stale(session.all_passes, {"points"})} >= set(builds)


def test_the_wrong_number_of_bodies_is_said():
    prepared = dealt(SCENES["one body"](), np.zeros(7, dtype=int))
    with pytest.raises(UserError, match="bodies of shape \\(7,\\), but there are 90 triangles"):
        Session(make_method(NAME), prepared, 8, 8, "cpu")
    with pytest.raises(ValueError, match="only a rigid one has bodies"):
        Moves("deforming", bodies=np.zeros(1, dtype=int))
    with pytest.raises(UserError, match="deforming must be one of rebuild, refuse"):
        make_method(NAME, {"deforming": "refit"})


def test_geometry_without_triangles():
    empty = replace(SCENES["one body"]().scene, geometry=lambda: Geometry.static(np.zeros((0, 3)), np.zeros((0, 3))))
    assert_exact_in_frames(prepare(empty), [0])


def test_tests_of_both_levels_are_counted():
    """Trees of the same triangles are tested against about as many, whether they stand in one tree or in many."""
    prepared, found = SCENES["through one another"](), []
    for bodies in (prepared.bodies, np.zeros_like(prepared.bodies)):
        session = Session(make_method(NAME), dealt(prepared, bodies), 32, 32, "cpu")
        session.answers(prepared.moment(0, 32, 32))
        counts = session.method.counters()
        tests = [one.sum() for one in session.method.tests_per_pixel()]
        found.append([*tests, counts["expected tests a hundred rays"]])
    assert np.allclose(*found, rtol=0.5)
    assert all(found[0])
