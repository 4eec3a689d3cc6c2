"""Occluders kept from the last frame: they save work, and no answer depends on them."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.brute_force import make_scene, soup
from helpers.streams import trial
from numpy.typing import NDArray
from shadowbench.harness.errors import UserError
from shadowbench.harness.frame.registry import make_method
from shadowbench.harness.frame.session import Session
from shadowbench.harness.scene.moment import Moment
from shadowbench.harness.scene.prepared import Prepared, prepare
from shadowbench.harness.scene.scene import AlphaMask, Camera, Geometry, Light, Scene, Spot
from shadowbench.methods.streams.occlusion.last_occluder import LastOccluder

SIZE = 40, 32
LAST = {"occluders": "last", **trial(inline_rays=4, groups="split")}
LIGHTS = [(0.5, 4.0, 2.0), (0.1, 0.2, 0.3)]


def session_of(prepared: Prepared, settings: dict[str, str], device: str = "cpu") -> Session:
    return Session(make_method("ray_grids", settings), prepared, *SIZE, device)


def memory_of(session: Session) -> list[LastOccluder]:
    """What keeps the occluders of each light of a session."""
    found = [work.launch.__self__ for work in session.planned if work.name.endswith("last occluders")]
    assert len(found) == len(LIGHTS)
    return found


def settled(session: Session) -> int:
    return sum(light.settled() for light in memory_of(session))


def fresh(prepared: Prepared, moment: Moment, device: str = "cpu") -> dict[str, NDArray]:
    """The answers of a method that keeps nothing."""
    return session_of(prepared, {}, device).answers(moment)


def assert_same(got: dict[str, NDArray], expected: dict[str, NDArray], what: object) -> None:
    for name, values in expected.items():
        np.testing.assert_array_equal(got[name], values, err_msg=f"{name}, {what}")


def masked_soup() -> Prepared:
    """A spot, receivers that face the lights, and triangles with holes."""
    vertices, faces = soup(11, 120, size=0.8)
    random = np.random.default_rng(5)
    mask = AlphaMask(
        triangles=(np.arange(len(faces)) % 3 == 0).astype(np.uint8),
        coordinates=random.uniform(-2, 2, (len(faces), 3, 2)).astype(np.float32),
        opaque=random.integers(0, 2, (8, 8)).astype(np.uint8),
    )
    camera = Camera((0.3, 0.2, 3.0), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), 60.0)
    lights = Light(LIGHTS[0], spot=Spot((-0.5, -4.0, -2.0), 12.0)), Light(LIGHTS[1])
    scene = Scene(
        "masked", "masked", lambda: Geometry.static(vertices, faces), camera, lights, facing=True, alpha=lambda _: mask
    )
    return prepare(scene)


SCENES = {"plain": lambda: make_scene(*soup(11, 120, size=0.8), LIGHTS), "with holes and receivers": masked_soup}


def garbage(kind: str, session: Session, light: LastOccluder, random: np.random.Generator) -> NDArray:
    """Numbers that no frame needs to have left: of any triangle, of none, of each pixel's own."""
    pixels, count = session.frame.pixels, session.frame.triangle_count
    if kind == "any triangle":
        return random.integers(0, count + 1, pixels)
    if kind == "any number":
        return random.integers(-(2**31), 2**31, pixels)
    if kind == "around the last":
        return random.integers(count - 1, count + 4, pixels)
    if kind == "its own":
        return session.frame.answers.triangle.numpy() + 1
    return np.roll(light.last.numpy(), int(random.integers(1, pixels)))


@pytest.mark.parametrize("kind", ["any triangle", "any number", "around the last", "its own", "of other pixels"])
@pytest.mark.parametrize("scene", SCENES)
def test_no_answer_depends_on_what_is_remembered(scene, kind, device):
    prepared = SCENES[scene]()
    moment = prepared.moment(0, *SIZE)
    expected = fresh(prepared, moment, device)
    session = session_of(prepared, LAST, device)
    assert_same(session.answers(moment), expected, "first frame")
    random = np.random.default_rng(3)
    for k in range(6):
        for light in memory_of(session):
            light.last.assign(garbage(kind, session, light, random).astype(np.int32))
        session.poison()
        session.replay()
        assert_same(session.frame.answers.to_host(), expected, (kind, k))


def test_a_repeated_frame_places_fewer_rays(device):
    prepared = SCENES["plain"]()
    moment = prepared.moment(0, *SIZE)
    session = session_of(prepared, LAST, device)
    first = session.answers(moment)
    shadowed = int(first["shadowed"].sum())
    assert shadowed > 300
    assert settled(session) == 0
    assert_same(session.answers(moment), first, "again")
    assert settled(session) > 0.8 * shadowed
    counters = session.method.counters()
    names = [f"light {i} rays settled by the last occluder" for i in range(len(LIGHTS))]
    assert sum(counters[name] for name in names) == settled(session)


def test_frames_of_a_moving_scene_equal_fresh_ones(device):
    """Mesh, light and camera move; a frame is of NaN; queues overflow, so that a frame is planned and run again."""
    prepared = SCENES["plain"]()
    random = np.random.default_rng(8)
    still = prepared.moment(0, *SIZE)
    session = session_of(
        prepared, {"occluders": "last", **trial(inline_rays=4, groups="split", items=1, chunks=1, undecided=1)}, device
    )
    saved = 0
    for k in range(8):
        camera = replace(prepared.scene.camera, eye=(0.3 + 0.05 * k, 0.2, 3.0))
        lights = tuple(Light((x + 0.05 * k, y, z)) for x, y, z in LIGHTS)
        moment = prepared.moment(0, *SIZE, camera=camera, lights=lights)
        points = (still.points * (1.0 + 0.01 * k) + random.normal(size=3) * 0.01).astype(np.float32)
        valid = still.valid
        if k == 4:
            points, valid = np.full_like(points, np.nan), np.zeros_like(valid)
        if k == 6:  # an occluder of the last frame is one no more
            points = points.copy()
            points[::9] = np.nan
            valid = np.isfinite(points[prepared.faces]).all(axis=(1, 2)).astype(np.uint8)
        moment = replace(moment, points=points, valid=valid)
        assert_same(session.answers(moment), fresh(prepared, moment, device), k)
        saved += settled(session)
    assert session.regrown >= 1
    assert saved > 500


def test_frames_in_part_equal_fresh_ones(device):
    """Where one light alone moves, the passes of the other do not run, and its occluders stay."""
    prepared = SCENES["plain"]()
    session = session_of(prepared, LAST, device)
    for k in range(5):
        at = [LIGHTS[0], (0.1 + 0.1 * (k // 2), 0.2, 0.3)]
        camera = replace(prepared.scene.camera, eye=(0.3, 0.2, 3.0 + 0.1 * (k // 4)))
        moment = prepared.moment(0, *SIZE, camera=camera, lights=tuple(Light(place) for place in at))
        session.advance(moment)
        assert_same(session.frame.answers.to_host(), fresh(prepared, moment, device), k)


def test_passes_say_that_they_keep_occluders():
    session = session_of(SCENES["plain"](), LAST)
    for i in range(len(LIGHTS)):
        name = f"occluders/{i}"
        readers = [work.name for work in session.planned if name in work.reads]
        assert readers == [f"light {i}: last occluders"]
        writers = {work.name for work in session.planned if name in work.writes}
        setting = [work for work in session.planned if f"shadowed/{i}" in work.writes]
        assert writers == {work.name for work in setting} - {f"light {i}: map rays"}
    assert not any("occluders/0" in work.writes for work in session_of(SCENES["plain"](), {}).planned)


def test_another_value_is_refused():
    with pytest.raises(UserError, match="none, last"):
        make_method("ray_grids", {"occluders": "first"})
