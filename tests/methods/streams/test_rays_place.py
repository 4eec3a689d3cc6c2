"""Receivers that ray_grids marks where it places the rays are those that the harness marks for other methods."""

import numpy as np
import pytest
import warp as wp
from helpers.effect_scenes import BEHIND, EYE, POINT, SPOT, scene
from helpers.small_scenes import assert_same, soup, trace
from helpers.streams import placings_of_session, trial
from shadowbench.harness.frame.effects.receivers import reached_by
from shadowbench.harness.frame.registry import make_method
from shadowbench.harness.frame.session import Session
from shadowbench.harness.judge.receivers import facing
from shadowbench.harness.scene.prepared import Prepared, prepare
from shadowbench.harness.scene.scene import Geometry, Light, Scene, Spot
from shadowbench.methods.streams.rays.placing import ByTriangles

SIZE = 80, 60
SPOTS = {
    "narrow": Light((1.5, 3.0, 1.0), spot=Spot((-1.5, -3.0, -1.0), 12.0)),
    "half": Light((0.3, 0.4, 0.2), spot=Spot((-0.2, -1.0, 0.1), 90.0)),
    "more than half": Light((0.1, 0.2, 0.9), spot=Spot((0.3, 1.0, 0.1), 130.0)),
    "far": Light((3.0e6, 9.0e6, 1.0e6), spot=Spot((-3.0, -9.0, -1.0), 5.0e-6)),
    "rectangle": Light((0.4, 2.5, 1.2), spot=Spot((-0.2, -1.0, -0.4), 25.0, rise=8.0, up=(0.0, 0.0, 1.0))),
    # The floor lies in the plane that bounds the cone: rounding decides each of its points.
    "edge on the floor": Light((1.5, -1.2, 1.0), spot=Spot((0.0, -1.0, 0.0), 90.0)),
}


@pytest.mark.parametrize("facing", [False, True])
@pytest.mark.parametrize("name", SPOTS)
def test_the_same_receivers_as_by_the_pass_of_the_harness(name, facing, device):
    prepared = scene((SPOTS[name], BEHIND), facing=facing)
    by_harness, _, answers = trace("uniform_grid", {}, prepared, *SIZE, device)
    wanted = by_harness.frame.receivers.numpy()
    for method in ("ray_grids", "visibility_buffer"):
        session, _, _ = trace(method, {}, prepared, *SIZE, device)
        np.testing.assert_array_equal(session.frame.receivers.numpy()[0], wanted[0])
        assert "light 0: receivers" not in [work.name for work in session.all_passes]
    assert "light 0: receivers" in [work.name for work in by_harness.all_passes]
    assert 0 < wanted[0].sum() < (answers["triangle"] >= 0).sum()


FLOOR = -1.25
"""Height of a floor: a number that float32 holds, so that lights lie exactly in its plane."""

CORNER = (-3.0, FLOOR, -3.0)

LIGHTS = {
    "outside and within": (POINT, BEHIND, Light((0.1, 0.05, 0.2))),
    "in the plane of the floor": (Light((2.0, FLOOR, 0.5)), Light((1.0e6, FLOOR, -3.0e5))),
    "at a corner, below the floor and at the eye": (Light(CORNER), Light((0.3, -7.0, 0.1)), Light(EYE.eye)),
    "directional and far": (Light((0.2, 1.0, 0.3), directional=True), Light((-4.0e6, -1.0e6, 2.0e6))),
    "some of them spots": (POINT, SPOT, BEHIND, Light((-0.6, -4.0, 0.2))),
}


def rough(lights: tuple[Light, ...]) -> Prepared:
    """A floor that does not move, and triangles that do: among them slivers, some without area, one that is not a number,
    each also turned over. Two frames, in which some turn from one side of a light to the other.
    """
    vertices, faces = soup(11, 80)
    corners = vertices.reshape(-1, 3, 3).copy()
    corners[:12, 2] = corners[:12, 1] + 1.0e-6 * (corners[:12, 0] - corners[:12, 1])
    corners[12:18, 2] = 0.5 * (corners[12:18, 0] + corners[12:18, 1])
    corners[18:21, 1] = corners[18:21, 0]
    corners[21, 0, 1] = np.nan
    floor = np.array([CORNER, (3, FLOOR, -3), (3, FLOOR, 3), (-3, FLOOR, 3)], dtype=np.float64)
    start = np.concatenate([corners.reshape(-1, 3), floor])
    end = np.concatenate([corners[:, :, [1, 2, 0]].reshape(-1, 3), floor])
    faces = np.concatenate([faces, faces[:, ::-1], np.array([[0, 2, 1], [0, 3, 2]]) + len(vertices)])
    made = Geometry(faces.astype(np.int32), lambda k: start + 0.5 * k * (end - start), 2)
    return prepare(Scene("rough", "rough", lambda: made, EYE, lights, facing=True))


def known_lights(session: Session) -> list[ByTriangles]:
    return [placing for placing in placings_of_session(session) if isinstance(placing, ByTriangles)]


@pytest.mark.parametrize("name", LIGHTS)
def test_the_triangles_decide_which_hits_face_a_light(name, device):
    prepared = rough(LIGHTS[name])
    by_triangles, by_rays, by_harness = (
        Session(make_method(*way), prepared, *SIZE, device)
        for way in (("ray_grids", trial(region="triangles")), ("ray_grids", trial(region="rays")), ("uniform_grid", {}))
    )
    assert len(known_lights(by_triangles)) == len(LIGHTS[name])
    known = [light for light in known_lights(by_triangles) if light.receivers() == "facing"]
    assert len(known) == sum(light.spot is None for light in LIGHTS[name])  # spots have a pass for that
    assert not known_lights(by_rays)
    seen: list[np.ndarray] = []
    for frame in (0, 1, 0):
        moment = prepared.moment(frame, *SIZE)
        wanted = by_harness.answers(moment)
        for session in (by_triangles, by_rays):
            assert_same(session.answers(moment), wanted)
            np.testing.assert_array_equal(session.frame.receivers.numpy(), by_harness.frame.receivers.numpy())
        hit = np.unique(wanted["triangle"][wanted["triangle"] >= 0])
        corners = moment.points[prepared.faces[hit]]
        # A frame of unlike sizes is planned anew.
        for light in (one for one in known_lights(by_triangles) if one.receivers() == "facing"):
            expected = facing(moment, corners, light.rays.index)
            np.testing.assert_array_equal(light.facing.numpy()[hit] != 0, expected)
            if not wp.get_device(device).is_cuda:
                reached = reached_by(by_triangles.frame, light.rays.index, 0).numpy()[0]
                assert reached == by_harness.frame.receivers.numpy()[light.rays.index].any()
        seen.append(by_harness.frame.receivers.numpy().copy())
    assert (seen[0] != seen[1]).any()
    np.testing.assert_array_equal(seen[0], seen[2])
    assert 0 < np.mean(seen) < 1
