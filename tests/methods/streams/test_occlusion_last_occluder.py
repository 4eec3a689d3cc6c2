"""Occluders kept from the last frame: they save work, and no answer depends on them. Stories of frames that follow one
another (``tests/properties/test_time.py``) are played with them, too.
"""

from dataclasses import replace

import numpy as np
import pytest
from helpers.answers import answers_in, assert_same
from helpers.small_scenes import make_scene, soup
from helpers.streams import trial
from numpy.typing import NDArray
from shadowbench.harness.frame.registry import make_method
from shadowbench.harness.frame.session import Session
from shadowbench.harness.scene.overrides import perforated
from shadowbench.harness.scene.prepared import Prepared, prepare
from shadowbench.harness.scene.scene import Light, Spot
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


def plain() -> Prepared:
    return make_scene(*soup(11, 120, size=0.8), LIGHTS)


def masked() -> Prepared:
    """A spot, receivers that face the lights, and triangles with holes."""
    lights = Light(LIGHTS[0], spot=Spot((-0.5, -4.0, -2.0), 12.0)), Light(LIGHTS[1])
    scene = replace(plain().scene, lights=lights, facing=True, alpha=lambda geometry: perforated(geometry, 3, 3))
    return prepare(scene)


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


@pytest.mark.parametrize("scene", [plain, masked])
def test_no_answer_depends_on_what_is_remembered(scene, device):
    prepared = scene()
    moment = prepared.moment(0, *SIZE)
    expected = session_of(prepared, {}, device).answers(moment)
    session = session_of(prepared, LAST, device)
    assert_same(session.answers(moment), expected, "first frame")
    random = np.random.default_rng(3)
    for kind in ["any triangle", "any number", "around the last", "its own", "of other pixels"] * 2:
        for light in memory_of(session):
            light.last.assign(garbage(kind, session, light, random).astype(np.int32))
        session.poison()
        session.replay()
        assert_same(answers_in(session), expected, kind)


def test_a_repeated_frame_places_fewer_rays(device):
    prepared = plain()
    moment = prepared.moment(0, *SIZE)
    session = session_of(prepared, LAST, device)
    first = session.answers(moment)
    shadowed = int(first["shadowed"].sum())
    assert shadowed > 300
    names = [f"light {i} rays settled by the last occluder" for i in range(len(LIGHTS))]
    assert [session.method.counters()[name] for name in names] == [0, 0]
    assert_same(session.answers(moment), first, "again")
    assert sum(session.method.counters()[name] for name in names) > 0.8 * shadowed


def test_passes_say_that_they_keep_occluders():
    session = session_of(plain(), LAST)
    for i in range(len(LIGHTS)):
        name = f"occluders/{i}"
        readers = [work.name for work in session.planned if name in work.reads]
        assert readers == [f"light {i}: last occluders"]
        writers = {work.name for work in session.planned if name in work.writes}
        setting = [work for work in session.planned if f"shadowed/{i}" in work.writes]
        assert writers == {work.name for work in setting} - {f"light {i}: map rays"}
    assert not any("occluders/0" in work.writes for work in session_of(plain(), {}).planned)
