"""The region of a light's rays that follows from the triangles in view: it holds every ray, and little else; rays
outside it are decided by ``occlusion/undecided.py``.
"""

from dataclasses import replace

import numpy as np
import pytest
import warp as wp
from helpers.launched import launched
from helpers.method_trials import box
from helpers.small_scenes import assert_same, make_scene, soup, trace
from helpers.streams import placings_of_session, trial
from numpy.typing import NDArray
from shadowbench.harness.scene.overrides import perforated
from shadowbench.harness.scene.prepared import Prepared, prepare
from shadowbench.harness.scene.scene import Light, Spot
from shadowbench.methods.streams.cube.rectangle import FACE, LARGEST
from shadowbench.methods.streams.light import Occlusion
from shadowbench.methods.streams.rays.placing import ByRays, ByTriangles
from shadowbench.methods.streams.rays.region import face_cosine

SIZE = 40, 32


class Region:
    """What the rays of a light cover of its cube: the least u and v, and least -u and -v, of face 0; the faces in use; and
    the largest coordinate of a hit point.
    """

    def __init__(self, placing: ByRays):
        words = placing.rays.cells.rectangle.numpy()
        self.sides = np.where(words[:4] < 0, words[:4] ^ 0x7FFFFFFF, words[:4]).astype(np.int32).view(np.float32)
        self.faces = words[FACE:LARGEST] == 0
        self.largest = float(words[LARGEST].view(np.float32))

    @property
    def extent(self) -> NDArray[np.float32]:
        return -self.sides[2:] - self.sides[:2]


def regions_of(prepared: Prepared, region: str) -> list[Region]:
    """Those of the lights of a frame that was traced."""
    session, _, _ = trace("ray_grids", trial(region=region), prepared, *SIZE)
    placings = placings_of_session(session)
    assert all(isinstance(placing, ByTriangles) == (region == "triangles") for placing in placings)
    return [Region(placing) for placing in placings]


def holds_every_ray(prepared: Prepared) -> None:
    for known, found in zip(regions_of(prepared, "triangles"), regions_of(prepared, "rays"), strict=True):
        assert (known.faces | ~found.faces).all()
        assert known.largest >= found.largest
        if found.faces[0]:
            assert (known.sides <= found.sides).all()


def only_facing(prepared: Prepared) -> Prepared:
    """The same scene, where only surfaces that face a light have rays to it."""
    return prepare(replace(prepared.scene, facing=True))


@pytest.mark.parametrize("seed", range(12))
def test_holds_every_ray(seed):
    random = np.random.default_rng(seed)
    vertices, faces = soup(seed, int(random.integers(1, 40)), size=float(np.exp(random.uniform(-3, 4))))
    shift = random.normal(size=3) * 10.0 ** random.uniform(-2, 4) * (seed % 2)
    eye = random.normal(size=3) * (3 if seed % 3 else 0.3) + shift
    lights = [tuple(random.normal(size=3) * 10.0 ** random.uniform(-3, 7) + shift) for _ in range(6)]
    prepared = make_scene(vertices + shift, faces, lights, tuple(eye), tuple(shift), 90.0)
    holds_every_ray(prepared)
    holds_every_ray(only_facing(prepared))


def spot_scene(seed: int, angle: float, rise: float | None = None) -> Prepared:
    """Triangles and six spots: near them and far away, towards them or anywhere."""
    random = np.random.default_rng(seed)
    vertices, faces = soup(seed, 40, size=float(np.exp(random.uniform(-2, 3))))
    lights = []
    for k in range(6):
        place = random.normal(size=3) * 10.0 ** random.uniform(-2, 4 if k % 2 else 1)
        way = random.normal(size=3) if k % 3 == 0 else random.normal(size=3) * 0.3 - place
        lights.append(Light(tuple(place), spot=Spot(tuple(way), angle, rise=rise, up=(0.1, 0.9, 0.3))))
    eye = random.normal(size=3) * (3 if seed % 3 else 0.3)
    return make_scene(vertices, faces, lights, tuple(eye), (0.0, 0.0, 0.0), 90.0)


@pytest.mark.parametrize("angle", [0.001, 4.0, 30.0, 44.0, 60.0, 89.0, 90.0, 91.0, 125.0, 179.0, 180.0])
def test_holds_every_ray_of_a_spot_whose_answers_do_not_depend_on_it(angle, device):
    for seed in range(2):
        prepared = spot_scene(seed, angle)
        holds_every_ray(prepared)
        if angle <= 90.0:
            holds_every_ray(spot_scene(seed, angle, rise=angle / 2))
        (by_rays, _, wanted), (by_triangles, _, found) = (
            trace("ray_grids", trial(region=region), prepared, *SIZE, device) for region in ("rays", "triangles")
        )
        assert_same(found, wanted)
        np.testing.assert_array_equal(by_triangles.frame.receivers.numpy(), by_rays.frame.receivers.numpy())


def test_what_lies_outside_a_cone_does_not_count():
    """A room around a light: of six faces a narrow cone along one of them keeps that one, and of it a small part."""
    found = []
    for spot in (None, Spot((1.0, 0.0, 0.0), 20.0), Spot((1.0, 0.0, 0.0), 60.0)):
        lights = [Light((-2.5, 0.1, 0.2), spot=spot)]
        prepared = make_scene(*box(1, 3.0), lights, (2.0, 0.5, 2.0), (-1.0, 0.0, -1.0), 120.0)
        found += regions_of(prepared, "triangles")
    every, narrow, wide = found
    assert narrow.faces.sum() == 1 < wide.faces.sum() < every.faces.sum()
    assert narrow.extent.prod() < 0.3 * every.extent.prod()


@wp.kernel(enable_backward=False)
def face_cosine_kernel(axes: wp.array(dtype=wp.vec3d), cosines: wp.array(dtype=wp.float64)):
    cosines[wp.tid()] = face_cosine(axes[wp.tid()])


def test_the_direction_of_a_face_that_is_nearest_to_an_axis():
    random = np.random.default_rng(1)
    axes = random.normal(size=(400, 3))
    axes /= np.linalg.norm(axes, axis=1)[:, None]
    (found,) = launched(face_cosine_kernel, len(axes), [axes], [len(axes)])
    u, v = np.meshgrid(np.linspace(-1, 1, 401), np.linspace(-1, 1, 401))
    ways = np.stack([np.ones_like(u), u, v], axis=-1).reshape(-1, 3)
    sampled = (axes @ (ways / np.linalg.norm(ways, axis=1)[:, None]).T).max(axis=1)
    # What is found is never less than a sample, and exceeds the best one by what lies between two samples.
    assert (found >= sampled - 1e-12).all()
    np.testing.assert_allclose(found, sampled, atol=1e-4)


@pytest.mark.parametrize("seed", range(4))
def test_holds_every_ray_of_pixels_closer_than_their_directions_are_rounded(seed):
    """Part of a floor, seen from 5,000 of its lengths away through a very long lens."""
    random = np.random.default_rng(seed)
    vertices = np.array([(-90, 0, -90), (90, 0, 90), (-90, 0, 90), (90, 0, -90)], dtype=np.float32)
    turn = random.uniform(0, 2 * np.pi)
    lights = [(random.normal(), 6.0, random.normal()) for _ in range(3)]
    eye = (1e6 * np.cos(turn), 1e6, 1e6 * np.sin(turn))
    view = eye, (0.0, 0.0, 0.0), float(np.degrees(SIZE[1] * 2.0 ** -(25 + seed % 3))), tuple(random.normal(size=3))
    prepared = make_scene(vertices, np.array([[0, 1, 2], [1, 0, 3]]), lights, *view)
    holds_every_ray(prepared)
    holds_every_ray(only_facing(prepared))


def test_of_a_large_triangle_only_the_part_in_view_counts():
    """A floor that reaches far behind the eye and on both sides, seen from above; the light is far above it."""
    vertices = np.array([(-500, 0, -500), (500, 0, -500), (0, 0, 900)], dtype=np.float32)
    prepared = make_scene(vertices, np.array([[0, 1, 2]]), [(0.0, 2000.0, 1.0)], (0.3, 2.0, 0.2), (0.5, 0.0, 0.4), 60.0)
    (known,), (found,) = (regions_of(prepared, region) for region in ("triangles", "rays"))
    assert (found.extent > 0).all()
    assert (known.extent < 1.5 * found.extent).all()
    assert known.faces.tolist() == found.faces.tolist()
    assert found.largest <= known.largest < 4.0 * found.largest < 100.0


def test_triangles_that_face_away_do_not_count():
    """A table lit from above, in a corner of a room whose ceiling is lit only on the side that is not seen."""
    table = np.array([(-1, 0, -1), (1, 0, -1), (0, 0, 1)], dtype=np.float32)
    ceiling = np.array([(-40, 3, -40), (40, 3, -40), (0, 3, 40)], dtype=np.float32)
    faces, view = np.array([[0, 1, 2], [3, 4, 5]]), ([(0.0, 20.0, 0.1)], (0.3, 1.5, 6.0), (0.0, 1.0, 0.0), 80.0)
    room = make_scene(np.concatenate([table, ceiling]), faces, *view)
    alone = make_scene(table, faces[:1], *view)
    (every,), (found,), (known,) = (
        regions_of(one, "triangles") for one in (room, only_facing(room), only_facing(alone))
    )
    (by_rays,) = regions_of(only_facing(room), "rays")
    assert by_rays.largest <= found.largest == known.largest < 0.2 * every.largest
    assert found.faces.tolist() == by_rays.faces.tolist()
    assert found.faces.any()


def test_rays_outside_the_region_of_a_spot_are_tested_against_every_triangle(device):
    """The eye far away for its fine lens, lights where hit points are rounded to, thin cones towards where plain float64,
    which decides whether a hit lies in them, finds these: the exact point of such a ray lies elsewhere.
    """
    outside_rays = 0
    for seed in range(12):
        random = np.random.default_rng(seed)
        vertices, faces = soup(seed, 40)
        eye = random.normal(size=3)
        eye *= 10.0 ** random.uniform(6, 7) / np.linalg.norm(eye)
        view = (tuple(eye), (0.0, 0.0, 0.0), float(np.degrees(3.0 / np.linalg.norm(eye))))
        plain = make_scene(vertices, faces, [(0.0, 9.0, 0.0)], *view)
        _, moment, answers = trace("uniform_grid", {}, plain, *SIZE, device)
        hit = answers["triangle"].ravel()
        lights = []
        for pixel in random.choice(np.flatnonzero(hit >= 0), 8):
            a, b, c = moment.points[plain.faces[hit[pixel]]].astype(np.float64)
            way = moment.directions(np.array([pixel]))[0].astype(np.float64)
            start, normal = moment.eye.astype(np.float64), np.cross(b - a, c - a)
            found = start + way * (normal @ (a - start) / (normal @ way))
            toward = found - found.astype(np.float32)
            if np.abs(toward).max() > 0:
                lights.append(Light(tuple(found.astype(np.float32)), spot=Spot(tuple(toward), 0.01)))
        prepared = make_scene(vertices, faces, lights, *view)
        known, moment, answers = trace("ray_grids", trial(region="triangles"), prepared, *SIZE, device)
        wanted = trace("uniform_grid", {}, prepared, *SIZE, device)[2]
        assert_same(answers, wanted)
        assert_same(known.answers(moment), wanted, "again")
        outside_rays += sum(int(light.outside.numpy()[0]) for light in placings_of_session(known))
    if device == "cpu":  # a GPU fuses products with sums, and finds none of these hits in a cone
        assert outside_rays > 10


@pytest.mark.parametrize("holes", [False, True])
def test_outside_rays_get_the_bits_of_other_rays(holes, device):
    """Every ray of a spot is declared an outside ray, and its bits are found again."""
    spot = Light((0.3, 4.0, 0.5), spot=Spot((0.0, -1.0, 0.0), 40.0))
    prepared = make_scene(*soup(5, 120), [spot])
    if holes:
        prepared = prepare(replace(prepared.scene, alpha=lambda geometry: perforated(geometry, 2, 2)))
    session, _, answers = trace("ray_grids", trial(region="triangles"), prepared, *SIZE, device)
    wanted = answers["shadowed"].ravel().copy()
    (light,) = placings_of_session(session)
    assert isinstance(light, ByTriangles)
    pixels = np.flatnonzero(session.frame.receivers.numpy()[0])
    session.frame.answers.shadowed.zero_()
    listed = np.zeros(light.outside.size, dtype=np.int32)
    listed[0] = len(pixels)
    listed[1 : 1 + len(pixels)] = pixels
    light.outside.assign(listed)
    light.rays.counts.zero_()  # no other undecided pairs
    Occlusion(light.rays).launch_undecided(light.outside, 0)
    np.testing.assert_array_equal(session.frame.answers.shadowed.numpy()[0], wanted)
    assert 0 < wanted.sum() < len(pixels)
