"""Back-face culling (``culling.py``): legal on closed surfaces seen from outside by the exact test, refused where it
would lose hits.
"""

import dataclasses

import numpy as np
import pytest
from helpers.closed_meshes import rays_along_an_edge, rays_through_vertices
from helpers.drawn_examples import CLOSED, exact_hits, some
from helpers.lattice_examples import CULLING, Example, answers_of, fresh_method, true_errors
from helpers.method_trials import box
from helpers.paper_knobs import answers_of as knob_answers
from helpers.small_scenes import assert_same, make_scene
from hypothesis import given
from shadowbench.harness.frame.registry import make_method
from shadowbench.harness.frame.session import Session
from shadowbench.harness.hardcases.judge import same_bits
from shadowbench.harness.hardcases.shapes import joined, moved
from shadowbench.harness.scene.light_paths import Orbit
from shadowbench.harness.scene.scene import Camera, Geometry, Light, Scene
from shadowbench.methods.perspective_spherical.parameters import PAPER, TRIANGLE_TESTS

NAME = "perspective_spherical"


def test_culling_changes_nothing_but_ties_on_a_closed_surface_seen_from_outside():
    points, faces = joined(box(5), moved(box(5), (1.9, 0.4, 0.2), 0.5))
    for wound in (faces, faces[:, ::-1]):  # inward or outward, as long as it is consistent
        prepared = make_scene(points, wound, [(4.0, 5.0, 6.0)], (2.0, 3.0, 7.0))
        scene = dataclasses.replace(prepared.scene, closed=True)
        _, _, off = knob_answers(prepared, 61, 47, {})
        pairs = []
        for cull in CULLING:
            method = make_method(NAME, {"cull": cull})
            assert method.applies(scene, "cpu") is None
            session, _, got = knob_answers(prepared, 61, 47, {"cull": cull})
            assert_same(got, off, cull)
            counts = session.method.counters()
            pairs.append((counts["camera pairs"], counts["light 0 pairs"]))
        assert pairs[1][0] < pairs[0][0]
        assert pairs[2][1] < pairs[1][1]


def traced(trial, **settings: str) -> dict[str, np.ndarray]:
    session = Session(make_method(NAME, settings), trial.prepared, trial.moment.width, trial.moment.height, "cpu")
    return session.answers(trial.moment)


def test_a_tie_goes_to_the_triangle_that_is_left():
    trial = rays_along_an_edge()
    kept, culled = traced(trial), traced(trial, cull="primary")
    changed = kept["triangle"] != culled["triangle"]
    assert 2 <= changed.sum() <= 8
    assert (kept["triangle"][changed] < 2).all(), "the wall is first in the list"
    assert (culled["triangle"][changed] >= 2).all()
    assert (kept["t"] == culled["t"]).all()


@some(60)
@given(CLOSED)
def test_culling_answers_up_to_ties_whatever_the_other_knobs(example: Example) -> None:
    """Bit for bit where one triangle is hit; where several are hit at one place, one of them is named."""
    trial = example.trial()
    given_ = answers_of(example, NAME, trial)
    hits = exact_hits(trial)[1]
    alone = np.array([len(tied) <= 1 for tied in hits.ties])
    for cull in CULLING[1 : 1 + sum(example.seen_from_outside())]:
        culled = example.with_settings(NAME, cull=cull)
        method = fresh_method(NAME, tuple(culled.settings[NAME].items()))
        assert method.applies(trial.prepared.scene, "cpu") is None
        assert true_errors(culled, (NAME,)) == {}
        got = answers_of(culled, NAME, trial)
        for key in ("triangle", "t", "u", "v", "shadowed"):
            assert same_bits(got[key][..., alone], given_[key][..., alone]), (cull, key)
        for pixel in np.nonzero(got["triangle"] != given_["triangle"])[0]:
            assert got["triangle"][pixel] in hits.ties[pixel], (cull, pixel)
        np.testing.assert_allclose(got["t"], given_["t"], rtol=2**-23, err_msg=cull)


@some(60)
@given(CLOSED)
def test_an_eye_or_a_light_in_any_body_is_refused(example: Example) -> None:
    """At the middle of each closed convex body that has a volume, which may lie in others."""
    moment, prepared = example.trial().moment, example.trial().prepared
    assert example.bodies is not None
    for body in range(example.bodies.max() + 1):
        corners = moment.points[prepared.faces[example.bodies == body]].astype(np.float64)
        a, b, c = corners[:, 0] - corners[0, 0], corners[:, 1] - corners[0, 0], corners[:, 2] - corners[0, 0]
        if np.einsum("ij,ij->i", a, np.cross(b, c)).sum() > 1e-4 * np.ptp(corners, axis=(0, 1)).max() ** 3:
            middle = tuple((corners.reshape(-1, 3).mean(axis=0) + prepared.centre).tolist())
            eye = dataclasses.replace(example.camera, eye=middle, target=tuple(x + 1.0 for x in middle))
            lit = dataclasses.replace(prepared.scene, lights=(*prepared.scene.lights, Light(middle)))
            seen = dataclasses.replace(prepared.scene, camera=eye)
            assert "light outside" in refused(lit, "primary+light")
            assert "eye outside" in refused(seen, "primary")


@pytest.mark.parametrize(("towards", "half", "deepest"), [((1, 0.4, -0.8), 0.7, 2), ((-0.3, 0.9, -0.5), 0.45, 3)])
def test_inexact_tests_would_lose_hits(towards, half, deepest):
    """A ray through a vertex of the front slips through and meets the back's inside; culled, it meets nothing."""
    hits = {}
    for test in TRIANGLE_TESTS:
        for cull in ("off", "primary"):
            trial = rays_through_vertices(towards, half, deepest, (0.0, 0.0, 0.0))
            hits[test, cull] = int((traced(trial, triangle_test=test, cull=cull)["triangle"] >= 0).sum())
        assert (refused(trial.prepared.scene, "primary", test) == "") == (test == "exact")
    assert hits["exact", "off"] == hits["exact", "primary"] == 256
    for test in TRIANGLE_TESTS[1:]:
        assert hits[test, "primary"] < hits[test, "off"], test


def refused(scene: Scene, cull: str, triangle_test: str = "exact") -> str:
    """The reason, or nothing."""
    settings = {"cull": cull, "triangle_test": triangle_test}
    reason = make_method(NAME, settings).applies(scene, "cpu") or ""
    assert "\n" not in reason
    return reason


@pytest.mark.parametrize("triangle_test", TRIANGLE_TESTS[1:])
@pytest.mark.parametrize("cull", CULLING[1:])
def test_culling_is_refused_with_a_test_that_is_not_exact(cull, triangle_test):
    scene = cube((0.0, 0.0, 7.0), (1.0, 2.0, 7.0))
    assert refused(scene, cull) == ""
    assert "needs triangle_test=exact" in refused(scene, cull, triangle_test)
    assert refused(scene, "off", triangle_test) == ""


def test_the_papers_configuration_applies_to_every_scene():
    assert make_method(NAME, PAPER).applies(cube((0.0, 0.0, 7.0), (0.1, 0.2, 0.3), closed=False), "cpu") is None
    assert make_method(NAME, PAPER).applies(cube((0.0, 0.0, 7.0), (1.0, 2.0, 7.0)), "cpu") is None


def cube(eye, light, closed=True, frames=1, at=lambda frame: 0.0, **fields) -> Scene:
    """A cube of side 2; ``at(frame)``: its middle."""
    vertices, faces = box(2)
    geometry = Geometry(faces, lambda frame: vertices + at(frame), frames)
    light = light if isinstance(light, Light) else Light(light)
    return Scene("cube", "Cube", lambda: geometry, Camera(eye, (0.1, 0.2, 0.4)), (light,), closed=closed, **fields)


OUTSIDE, WITHIN = (0.0, 0.0, 7.0), (0.1, 0.2, 0.3)


def test_culling_is_refused_where_it_would_lose_hits():
    assert refused(cube(OUTSIDE, OUTSIDE), "primary") == ""
    assert refused(cube(OUTSIDE, WITHIN), "primary") == ""
    assert "declared closed" in refused(cube(OUTSIDE, OUTSIDE, closed=False), "primary")
    assert "eye outside" in refused(cube(WITHIN, OUTSIDE), "primary")
    assert "light outside" in refused(cube(OUTSIDE, WITHIN), "primary+light")
    assert refused(cube(WITHIN, WITHIN, closed=False), "off") == ""
    for anywhere in (Light(WITHIN, shadows=False), Light(WITHIN, directional=True)):
        assert refused(cube(OUTSIDE, anywhere), "primary+light") == ""


@pytest.mark.parametrize("place", [(0.3, 0.2, 1.0), (0.0, 0.3, 1.0), (1.0, 0.3, 1.0), (1.0, 1.0, 1.0)])
def test_a_place_on_the_surface_is_not_outside(place):
    """On a face, an edge of two squares of one, an edge, a corner."""
    at = np.array(place)
    assert "eye outside" in refused(cube(tuple(at.tolist()), OUTSIDE), "primary")
    for share in (1.0, 1.0 - 2.0**-26):  # float32 rounds it back
        assert "light outside" in refused(cube(OUTSIDE, tuple((at * share).tolist())), "primary+light")
    assert refused(cube(OUTSIDE, tuple((at * 1.01).tolist())), "primary+light") == ""


@pytest.mark.parametrize("frame", [0, 1, 7, 23, 40])
def test_every_frame_is_tried(frame):
    """The cube visits the eye, or a light, in one frame of 41."""

    def at(to):
        return lambda k: np.array(to if k == frame else (0.0, 0.0, 0.0))

    far, away = (0.0, 0.0, 20.0), (0.0, 9.0, 0.0)
    assert "eye outside" in refused(cube(far, away, frames=41, at=at(far)), "primary")
    assert "light outside" in refused(cube(far, away, frames=41, at=at(away)), "primary+light")
    assert refused(cube(far, away, frames=41, at=at((0.0, -9.0, 0.0))), "primary+light") == ""


@dataclasses.dataclass(frozen=True)
class Straight:
    """Every light goes straight from ``start`` by ``step``."""

    start: tuple[float, float, float]
    step: tuple[float, float, float]

    def at(self, lights, share):
        return tuple(light.moved(tuple(np.add(self.start, np.multiply(self.step, share)))) for light in lights)


def test_a_light_that_passes_through_is_refused_between_its_first_and_last_frame():
    """An orbit, and a way outwards, each with one frame of 33 inside the cube, of which no frame is a multiple of 8."""
    orbit = Orbit(centre=(12.0, 0.0, 0.0))  # at (12, 0, 0) +- 12: the cube's middle at one share, the rest far away
    start = (12.0 - 12.0 * np.cos(2 * np.pi * 5 / 32), 0.0, 12.0 * np.sin(2 * np.pi * 5 / 32))
    for turn in (1.0, -1.0):
        path = dataclasses.replace(orbit, turns=turn)
        scene = cube(OUTSIDE, start, frames=33, light_path=path)
        inside = [k for k in range(33) if np.abs(path.at(scene.lights, k / 32)[0].position).max() < 1.0]
        assert len(inside) == 1
        assert inside[0] % 8
        assert "light outside" in refused(scene, "primary+light")
        assert refused(dataclasses.replace(scene, light_path=None), "primary+light") == ""
    away = Straight(start=(0.0, 0.0, 6.0), step=(0.0, 0.0, 8.0))
    assert refused(cube(OUTSIDE, WITHIN, frames=33, light_path=away), "primary+light") == ""
    through = Straight(start=(0.0, 0.0, 4.0), step=(0.0, 0.0, -8.0))
    assert "light outside" in refused(cube(OUTSIDE, OUTSIDE, frames=33, light_path=through), "primary+light")


def test_a_triangle_that_is_left_out_is_a_hole():
    scene = cube(OUTSIDE, OUTSIDE)
    geometry = scene.geometry()
    broken = geometry.positions(0).copy()
    broken[0, 0] = np.nan
    holed = dataclasses.replace(scene, geometry=lambda: Geometry.static(broken, geometry.faces))
    assert "finite vertices" in refused(holed, "primary")
