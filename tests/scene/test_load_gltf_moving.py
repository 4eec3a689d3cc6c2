"""glTF files that move, against other evaluations of the same curves; their cameras and lights."""

import itertools
import math

import numpy as np
import pytest
from helpers.gltf_samples import CORNERS, SQUARE, Gltf, bounds, moved, skinned, square
from helpers.mesh_files import refused
from scipy.interpolate import CubicHermiteSpline
from scipy.spatial.transform import Rotation, Slerp
from shadowbench.harness.errors import UserError
from shadowbench.harness.scene.moment import ray_tables
from shadowbench.harness.scene.readers.checks import Wanted
from shadowbench.harness.scene.readers.gltf.animation import own_rate
from shadowbench.harness.scene.readers.load import load
from shadowbench.harness.scene.spotlight import spot_row

TIMES = np.float32([1, 1.5, 3])


def frame_times(loaded) -> np.ndarray:
    return TIMES[0] + np.arange(len(loaded.frames)) / loaded.rate


def test_steps_stay_until_the_next_key(tmp_path):
    values = [[0, 0, 0], [2, 0, 0], [7, 0, 0]]
    loaded = load(moved(translation=(TIMES, values, "STEP")).write(tmp_path))
    found = [frame[0, 0] for frame in loaded.frames]
    assert found == [0 if t < 1.5 else 2 if t < 3 else 7 for t in frame_times(loaded)]


def test_cubic_splines(tmp_path):
    values = np.random.default_rng(2).normal(size=(3, 3, 3)).astype("f4")
    loaded = load(moved(translation=(TIMES, values.reshape(-1, 3), "CUBICSPLINE")).write(tmp_path))
    times = frame_times(loaded)
    spline = np.empty((len(times), 3))
    for i, (start, end) in enumerate(itertools.pairwise(TIMES)):
        piece = CubicHermiteSpline([start, end], values[i : i + 2, 1], [values[i, 2], values[i + 1, 0]])
        inside = (times >= start) & (times <= end)
        spline[inside] = piece(times[inside])
    assert np.allclose([frame[0] for frame in loaded.frames], spline)
    assert np.allclose(loaded.frames[-1][0], values[2, 1])


def test_rotations_take_the_shorter_way_at_constant_speed(tmp_path):
    turns = Rotation.random(3, random_state=3)
    stored = turns.as_quat().astype("f4") * np.float32([[1], [-1], [1]])  # q and -q are the same rotation
    loaded = load(moved(rotation=(TIMES, stored)).write(tmp_path))
    expected = Slerp(TIMES, turns)(np.clip(frame_times(loaded), TIMES[0], TIMES[-1]))
    for frame, turn in zip(loaded.frames, expected, strict=True):
        assert np.allclose(frame, turn.apply(SQUARE), atol=1e-6)


def test_rotations_by_splines_and_integers_have_unit_length(tmp_path):
    made = moved(
        rotation=(TIMES, np.tile(np.float32([0, 0, 0, 1, 0, 0, 3, 0, 0, 0, 0, 1]), 3).reshape(-1, 4), "CUBICSPLINE")
    )
    loaded = load(made.write(tmp_path))
    for frame in loaded.frames:
        assert np.allclose(np.linalg.norm(frame[1] - frame[0]), 1)
    made = square()
    made.animate(rotation=(0, [0, 1], np.zeros((2, 4))))
    output = made.head["animations"][0]["samplers"][0]
    output["output"] = made.accessor([[0, 0, 0, 127], [0, 0, 90, 90]], "i1", normalized=True)
    last = load(made.write(tmp_path)).frames[-1]
    assert np.allclose(last[1], [0, 1, 0])
    assert np.allclose(np.linalg.norm(last[2]), 2**0.5)


def test_all_parents_move_what_is_below_them(tmp_path):
    made = Gltf()
    above = made.node(translation=[0, 0, 1], scale=[2, 2, 2])
    middle = made.node(above)
    made.node(middle, mesh=made.mesh(), translation=[1, 0, 0])
    made.node(mesh=0, translation=[100, 0, 0])
    made.animate(translation=(above, [0, 1], [[0, 0, 0], [0, 10, 0]]), scale=(middle, [0, 1], [[1, 1, 1], [3, 3, 3]]))
    loaded = load(made.write(tmp_path))
    assert np.array_equal(loaded.frames[0][:4], 2 * (SQUARE + [1, 0, 0]))
    assert np.array_equal(loaded.frames[-1][:4], 2 * 3 * (SQUARE + [1, 0, 0]) + [0, 10, 0])
    assert all(np.array_equal(frame[4:], SQUARE + [100, 0, 0]) for frame in loaded.frames)


def test_what_moves_with_a_node_is_a_body(tmp_path):
    made = Gltf()
    made.node(mesh=made.mesh(), translation=[100, 0, 0])
    above = made.node(mesh=0)
    made.node(above, mesh=0, translation=[2, 0, 0])
    made.node(mesh=0, translation=[0, 50, 0])
    made.animate(translation=(above, [0, 1], [[0, 0, 0], [0, 10, 0]]))
    loaded = load(made.write(tmp_path))
    rests, moves, below, rests_too = loaded.bodies.reshape(-1, 2)[:, 0].tolist()
    assert loaded.bodies.tolist() == [rests, rests, moves, moves, below, below, rests_too, rests_too]
    assert (rests, len({rests, moves, below}), loaded.geometry().motion.kind) == (rests_too, 3, "rigid")
    assert load(made.write(tmp_path), Wanted((0, 0, 1))).geometry().motion is None
    made.primitive()["targets"] = [{"POSITION": made.accessor(np.ones((4, 3)))}]
    made.animate(weights=(above, [0, 1], [0, 1]))
    made.head["animations"].reverse()
    assert load(made.write(tmp_path)).bodies is None, "what bends is no body"


def test_instances_move_with_their_node(tmp_path):
    made = moved(translation=([0, 1], [[0, 0, 0], [0, 0, 4]]))
    places = made.accessor([[0, 0, 0], [5, 0, 0]])
    made.extend(made.head["nodes"][0], "EXT_mesh_gpu_instancing", {"attributes": {"TRANSLATION": places}})
    assert bounds(load(made.write(tmp_path)), -1) == ([0, 0, 4], [6, 1, 4])


def test_morph_targets_that_move(tmp_path):
    made = square()
    up, aside = (made.accessor(np.ones((4, 1)) * axis) for axis in np.float32([[0, 0, 1], [2, 0, 0]]))
    made.primitive()["targets"] = [{"POSITION": up}, {"POSITION": aside}]
    made.animate(weights=(0, [0, 1], [0, 1, 2, 0]))
    loaded = load(made.write(tmp_path))
    for i, frame in enumerate(loaded.frames):
        share = i / 24
        assert np.allclose(frame, SQUARE + [2 * (1 - share), 0, 2 * share])
    made.head["animations"][0]["samplers"][0]["output"] = made.accessor([0, 1, 2])
    refused(made.write(tmp_path), "3 numbers for 2 keys of the weights, not 4")


def bent_by_hand(made, up, turn):
    """The square after its skin: the sum over joints of weight * world * inverse * position, in homogeneous coordinates."""

    def values(index):
        entry = made.head["accessors"][index]
        view = made.head["bufferViews"][entry["bufferView"]]
        blob = bytes(made.data[view["byteOffset"] : view["byteOffset"] + view["byteLength"]])
        return np.frombuffer(blob, {5121: "u1", 5126: "<f4"}[entry["componentType"]]).reshape(entry["count"], -1)

    skin, attributes = made.head["skins"][0], made.primitive()["attributes"]
    world = {0: up, 1: up @ turn}
    inverse = values(skin["inverseBindMatrices"]).reshape(2, 4, 4).transpose(0, 2, 1)
    moves = np.array([world[joint] for joint in skin["joints"]]) @ inverse
    total = np.zeros((4, 4))
    for i in range(sum(name.startswith("JOINTS") for name in attributes)):
        joints, weights = values(attributes[f"JOINTS_{i}"]), values(attributes[f"WEIGHTS_{i}"])
        total += np.einsum("vj,vjab,vb->va", weights, moves[joints], np.c_[SQUARE, np.ones(4)])
    return total[:, :3] / total[:, 3:]


@pytest.mark.parametrize("influences", [1, 2])
def test_skins(tmp_path, influences):
    made = skinned(influences=influences)
    turn, up = np.eye(4), np.eye(4)
    turn[:3, :3] = Rotation.from_quat([0, 0, 0.6, 0.8]).as_matrix()
    up[1, 3] = 1
    loaded = load(made.write(tmp_path))
    assert np.allclose(loaded.frames[0], bent_by_hand(made, up, turn), atol=1e-6)
    assert loaded.faces.tolist() == [[0, 1, 2], [0, 2, 3]]
    made.animate(translation=(0, [0, 1], [[0, 1, 0], [7, 1, 0]]))
    loaded = load(made.write(tmp_path))
    up[0, 3] = 7
    assert np.allclose(loaded.frames[-1], bent_by_hand(made, up, turn), atol=1e-6)
    assert loaded.geometry().motion is None


def test_a_skin_bends_what_morph_targets_have_moved(tmp_path):
    made = skinned()
    made.primitive()["targets"] = [{"POSITION": made.accessor(np.ones((4, 3)))}]
    made.head["nodes"][2]["weights"] = [0.5]
    plain = skinned(SQUARE + np.float32(0.5))
    assert np.allclose(load(made.write(tmp_path)).frames[0], load(plain.write(tmp_path, "b.glb")).frames[0], atol=1e-6)


def test_vertices_without_weights_follow_their_first_joint(tmp_path):
    made, expected = skinned(), skinned()
    for one, values in ((made, np.zeros((4, 4))), (expected, [[0.5, 0, 0, 0]] * 4)):
        weights = one.head["accessors"][one.primitive()["attributes"]["WEIGHTS_0"]]
        weights["bufferView"] = one.view(np.asarray(values, "f4").tobytes())
    found, other = load(made.write(tmp_path)), load(expected.write(tmp_path, "b.glb"))
    assert found.notes == ("4 vertices without joint weights follow their first joint",)
    assert np.array_equal(found.frames[0], other.frames[0])


def test_joints_of_a_static_mesh_mean_nothing(tmp_path):
    made = square()
    made.primitive()["attributes"].update(JOINTS_0=77, WEIGHTS_0=88)
    assert np.array_equal(load(made.write(tmp_path)).frames[0], SQUARE)


# --- frames ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("keys", "rate"), [
    ([0, 1], 24), (np.arange(50) / 24, 24), (np.arange(50) / 25, 25), (np.float32(np.arange(5000) / 30), 30),
    (np.arange(50) / 60, 60), (np.arange(50) / 15, 30), (np.arange(50) / 20, 40), (np.array([0, 2, 3, 11]) / 24, 24),
    (np.array([0, 2, 3, 11]) / 30, 30), (np.arange(240) * 1001 / 24000, 24000 / 1001), ([0.5, 0.5 + 1 / 24], 24),
    ([0, 0.3333, 1], 24), ([0, 1 / np.pi, 1], 30), ([0, 1 / np.pi, 1.01], 31 / 1.01), ([5], 30),
])  # fmt: skip
def test_the_rate_of_keys(keys, rate):
    assert own_rate(np.asarray(keys, dtype=np.float64)) == pytest.approx(rate, rel=1e-4)


def test_chosen_frames_and_rates(tmp_path):
    path = moved(translation=([2, 3], [[0, 0, 0], [24, 0, 0]])).write(tmp_path)
    every = load(path)
    assert (len(every.frames), every.rate, every.notes) == (25, 24, ("animation 0 at 24 frames a second",))
    assert every.faces.tolist() == [[0, 1, 2], [0, 2, 3]]
    some = load(path, Wanted(frames=(3, 11, 4)))
    assert ([frame[0, 0] for frame in some.frames], some.rate) == (pytest.approx([3, 7, 11]), 6)
    assert some.notes == ("animation 0 at 24 frames a second, 3 of its 25 frames",)
    one = load(path, Wanted(frames=(12, 12, 1)))
    assert [frame[0, 0] for frame in one.frames] == pytest.approx([12])
    assert one.rate is None
    slow = load(path, Wanted(rate=2.5))
    assert [frame[0, 0] for frame in slow.frames] == pytest.approx([0, 9.6, 19.2])
    with pytest.raises(UserError, match="has frames 0 to 24"):
        load(path, Wanted(frames=(0, 25, 1)))
    key = load(moved(translation=([3], [[4, 0, 0]])).write(tmp_path))
    assert (bounds(key), key.rate, key.notes) == (([4, 0, 0], [5, 1, 0]), None, ("animation 0 has one key",))


def test_the_first_animation_is_read_and_the_others_are_named(tmp_path):
    made = moved(translation=([0, 1], [[0, 0, 0], [5, 0, 0]]))
    made.animate(translation=(0, [0, 9], [[0, 0, 0], [0, 5, 0]]))
    made.head["animations"][0]["name"], made.head["animations"][1]["name"] = "walk", "run\nfast"
    loaded = load(made.write(tmp_path))
    assert bounds(loaded, -1) == ([5, 0, 0], [6, 1, 0])
    assert loaded.notes == ("animation 'walk' at 24 frames a second", "animation 'run fast' left out")


def test_an_animation_of_what_is_not_drawn_moves_nothing(tmp_path):
    made = square()
    made.node(camera=0)
    made.add("cameras", {"type": "perspective", "perspective": {"yfov": 1.0, "znear": 0.1}})
    made.animate(translation=(1, [0, 1], [[0, 0, 0], [5, 0, 0]]), weights=(0, [0, 1], [0, 1]))
    loaded = load(made.write(tmp_path))
    assert len(loaded.frames) == 1
    moving = "moving cameras and lights read at the first frame: 1"
    assert loaded.notes == ("animation 0 left out", moving)


@pytest.mark.parametrize(("pointer", "frames"), [
    ("/nodes/0/translation", 25), ("/materials/0/emissiveFactor", 1),
    ("/nodes/0/extensions/KHR_node_visibility/visible", 0), (["x"], 0),
])  # fmt: skip
def test_pointers_to_what_animations_move(tmp_path, pointer, frames):
    made = moved(translation=([0, 1], [[0, 0, 0], [5, 0, 0]]))
    target = made.head["animations"][0]["channels"][0]["target"] = {"path": "pointer"}
    made.extend(target, "KHR_animation_pointer", {"pointer": pointer})
    path = made.write(tmp_path)
    if not frames:
        refused(path, f"animates {pointer!r}")
        return
    loaded = load(path)
    assert len(loaded.frames) == frames
    assert loaded.notes == (("animation 0 left out",) if frames == 1 else ("animation 0 at 24 frames a second",))


def test_more_frames_than_memory_holds_are_refused(tmp_path):
    made = Gltf()
    made.node(mesh=made.mesh(np.zeros((100_000, 3)), CORNERS))
    made.animate(translation=(0, [0, 60], [[0, 0, 0], [5, 0, 0]]))
    path = made.write(tmp_path)
    refused(path, "1441 frames of 100000 vertices", "--frames A:B:STEP")
    refused(moved(translation=([0, 1e5], [[0, 0, 0]] * 2)).write(tmp_path, "long.glb"), "2400001 frames of 4 vertices")
    assert len(load(path, Wanted(frames=(0, None, 240))).frames) == 7


PERSPECTIVE = {"type": "perspective", "perspective": {"yfov": math.radians(50), "znear": 0.1}}
QUARTER = [0, math.sqrt(0.5), 0, math.sqrt(0.5)]
"""A quarter turn about y: -z becomes -x."""


def with_camera(camera: dict, **node: object) -> Gltf:
    made = square()
    made.add("cameras", camera)
    made.node(camera=0, **node)
    return made


def with_light(light: dict, **node: object) -> Gltf:
    made = square()
    made.extend(made.head, "KHR_lights_punctual", {"lights": [light]})
    made.node(extensions={"KHR_lights_punctual": {"light": 0}}, **node)
    return made


def test_a_camera_looks_along_the_negative_z_of_its_node(tmp_path):
    made = with_camera(PERSPECTIVE, name="front", translation=[1, 2, 3], rotation=QUARTER, scale=[2, 2, 2])
    made.node(camera=0, name="front")
    made.node(camera=0)
    found = load(made.write(tmp_path)).cameras
    assert list(found) == ["front", "front 2", "camera"]
    camera = found["front"]
    assert camera.eye == (1, 2, 3)
    assert np.allclose(np.subtract(camera.target, camera.eye), [-3, 0, 0])
    assert np.allclose(camera.up, [0, 1, 0])
    assert camera.fov == pytest.approx(50)
    ray_tables(camera, 4, 4, np.zeros(3))


def test_an_orthographic_camera(tmp_path):
    camera = {"type": "orthographic", "orthographic": {"xmag": 3, "ymag": 2, "znear": 0, "zfar": 9}, "name": "plan"}
    found = load(with_camera(camera).write(tmp_path)).cameras["plan"]
    assert (found.height, found.eye, found.target) == (4, (0, 0, 0), (0, 0, -1))


def test_the_camera_of_an_animation_is_that_of_its_first_frame(tmp_path):
    made = with_camera(PERSPECTIVE)
    made.head["nodes"][0]["camera"] = 0
    del made.head["nodes"][1]["camera"]
    made.animate(translation=(0, [2, 3], [[7, 0, 0], [8, 0, 0]]))
    assert load(made.write(tmp_path)).cameras["camera"].eye == (7, 0, 0)


@pytest.mark.parametrize(("camera", "scale"), [
    ({"type": "perspective", "perspective": {"yfov": 4}}, 1),
    ({"type": "perspective", "perspective": {"yfov": "x"}}, 1), ({"type": "perspective"}, 1),
    ({"type": "orthographic", "orthographic": {"ymag": 0}}, 1), ({}, 1), (PERSPECTIVE, 0),
])  # fmt: skip
def test_cameras_that_see_nothing_are_left_out(tmp_path, camera, scale):
    assert load(with_camera(camera, scale=[scale] * 3).write(tmp_path)).cameras == {}


def test_point_lights(tmp_path):
    light = {"type": "point", "color": [1, 0.5, 0], "intensity": 100, "name": "lamp"}
    found = load(with_light(light, translation=[1, 2, 3]).write(tmp_path)).lights["lamp"]
    assert (found.position, found.color, found.intensity) == ((1, 2, 3), (1, 0.5, 0), 100)
    assert found.spot is None
    assert not found.directional


def test_directional_lights_shine_along_the_negative_z_of_their_node(tmp_path):
    found = load(with_light({"type": "directional"}, rotation=QUARTER).write(tmp_path)).lights["light"]
    assert found.directional
    assert np.allclose(found.position, [1, 0, 0]), "the direction to the light"


def test_spots(tmp_path):
    cone = {"type": "spot", "spot": {"outerConeAngle": math.pi / 6}}
    found = load(with_light(cone, rotation=QUARTER, translation=[4, 0, 0]).write(tmp_path)).lights["light"]
    assert (found.position, found.spot.angle) == ((4, 0, 0), pytest.approx(30))
    assert np.allclose(found.spot.direction, [-1, 0, 0])
    spot_row(found.spot)
    assert load(with_light({"type": "spot"}).write(tmp_path)).lights["light"].spot.angle == pytest.approx(45)


@pytest.mark.parametrize(
    ("light", "shown"),
    [({"type": "point"}, 0), ({}, 1), ({"type": "area"}, 1), ({"type": "spot", "spot": {"outerConeAngle": 0}}, 1)],
)
def test_hidden_and_useless_lights_are_left_out(tmp_path, light, shown):
    made = with_light(light)
    made.extend(made.head["nodes"][1], "KHR_node_visibility", {"visible": bool(shown)})
    assert load(made.write(tmp_path)).lights == {}
