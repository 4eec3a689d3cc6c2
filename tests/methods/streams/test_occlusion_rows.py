"""Groups of rows of larger triangles (``occlusion/rows.py``, ``occlusion/stream.py``); a light in the plane of one
(``occlusion/planes.py``); occluders kept from the last frame (``occlusion/last_occluder.py``): answers stay.
"""

from dataclasses import replace

import numpy as np
import pytest
from helpers.exact_answers import assert_right, exact_answers
from helpers.method_trials import box
from helpers.small_scenes import answers_in, assert_same, make_scene, soup, trace
from helpers.streams import on_gpu_side, trial
from numpy.typing import NDArray
from shadowbench.harness.frame.registry import make_method
from shadowbench.harness.frame.session import Session
from shadowbench.harness.hardcases.shapes import joined, quad
from shadowbench.harness.scene.overrides import perforated
from shadowbench.harness.scene.prepared import Prepared, prepare
from shadowbench.harness.scene.scene import Light, Spot
from shadowbench.methods.gpu.prefetch import FEW_ROWS
from shadowbench.methods.gpu.warps import LANES
from shadowbench.methods.streams.occlusion.last_occluder import LastOccluder
from shadowbench.methods.streams.queues import COUNTERS, ITEMS, LARGE, SMALL, more_room


def queued(cells, capacity="0", groups="split", light=(5.0, 4.0, 3.0)):
    """A light's counters; triangle, face, first row and rows of each large and of each small group; and its triangles."""
    small, large = soup(7, 200, size=0.2), soup(8, 12, size=3.0)
    vertices = np.concatenate([small[0], large[0]])
    prepared = make_scene(vertices, np.arange(len(vertices)).reshape(-1, 3), [light])
    given = trial(inline_cells=0, shares=1, cells=cells, groups=groups, items=capacity)
    method = trace("ray_grids", given, prepared, 64, 64)[0].method
    counts = method._queues.counts.numpy()[1].copy()
    (queue,) = method._queues.of_stream(1)
    words = queue.groups.numpy().view(np.int32).reshape(-1, 8, 4)[:, 0]
    which = words[:, 0]
    groups = np.stack([words[:, 2], which & 15, which >> 16, (which >> 4) & 63], axis=1)
    end = len(groups) - counts[SMALL]
    return counts, groups[: counts[ITEMS]], groups[end:], queue.large.numpy()[: counts[LARGE]].copy()


@on_gpu_side
@pytest.mark.parametrize("cells", ["8", "64", "512"])
def test_the_groups_of_a_triangle_are_all_its_rows(cells):
    counts, large, small, triangles = queued(cells)
    rows = {}
    for i, face, first, number in np.concatenate([large, small]):
        for row in range(first, first + number):
            rows.setdefault((i, face), []).append(row)
    expected = {(i, face): list(range(row & 65535, (row >> 16) + 1)) for i, face, _, row in triangles.tolist()}
    assert {key: sorted(found) for key, found in rows.items()} == expected
    assert counts[SMALL] == sum(len(found) <= FEW_ROWS for found in expected.values())
    assert (small[:, 3] <= FEW_ROWS).all()
    assert (large[:, 3] <= LANES).all()
    assert counts[SMALL] > 0
    assert (counts[ITEMS] > 0) == (int(cells) > FEW_ROWS)


@on_gpu_side
@pytest.mark.parametrize("cells", ["8", "64", "512"])
@pytest.mark.parametrize("light", [(5.0, 4.0, 3.0), (0.1, 0.2, 0.3)], ids=["one face", "all faces"])
def test_the_stream_stores_the_same_groups_as_the_pass(cells, light):
    split, stream = (queued(cells, groups=groups, light=light) for groups in ("split", "stream"))
    assert stream[0][LARGE] == 0 < split[0][LARGE]
    for expected, found in zip(split[1:3], stream[1:3], strict=True):
        assert sorted(map(tuple, found)) == sorted(map(tuple, expected))


@on_gpu_side
def test_small_and_large_groups_need_room_together():
    counts, *_ = queued("64")
    needed = np.zeros((1, COUNTERS), dtype=np.int64)
    needed[0, [ITEMS, SMALL, LARGE]] = 30, 40, 50
    assert more_room(needed, (69, 1, 1), 2**40)[0] >= 70
    assert more_room(needed, (70, 1, 1), 2**40)[0] == 70
    tight, *_ = queued("64", capacity=str(max(counts[ITEMS], counts[SMALL])))
    assert (tight[[ITEMS, SMALL, LARGE]] == counts[[ITEMS, SMALL, LARGE]]).all()


PLANE_SIZE = 64


def room(light):
    """A cube from -2 to 2, and a square in the plane x = 0 within it."""
    square = quad(*((0, y, z) for y, z in ((-1.5, -1.5), (1.5, -1.5), (1.5, 1.25), (-1.5, 1.25))))
    return make_scene(*joined(box(1, 2.0), square), [light], eye=(1.7, 0.9, 1.8), fov=95.0)


@pytest.mark.parametrize("groups", ["stream", "split"])
@pytest.mark.parametrize(
    "light",
    [(0.0, 0.2, -0.3), (0.0, 1.75, 0.1), (2.0**-30, 0.2, -0.3), (-(2.0**-30), 1.75, 0.1)],
    ids=["in the square", "beside it", "nearly in it", "nearly beside it"],
)
def test_few_pairs_are_left_to_float64(light, groups, device):
    prepared = room(light)
    session, moment, answers = trace("ray_grids", trial(groups=groups), prepared, PLANE_SIZE, PLANE_SIZE, device)
    assert_right(answers, exact_answers(prepared, moment))
    assert (answers["triangle"] >= 0).all()
    # A light nearly in the square sees both of its triangles through each of its points.
    on_square = int((answers["triangle"] >= 12).sum()) if light[0] else 0
    assert session.method.counters()["light 0 undecided pairs"] < 1.1 * on_square + 0.05 * PLANE_SIZE * PLANE_SIZE


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
