"""The streamed dual against float64 brute force and against the paper's method, under all settings."""

import numpy as np
import pytest
from helpers.brute_force import closest, make_scene, shadowed, soup
from helpers.streams import trial
from shadowbench.harness.frame.registry import make_method
from shadowbench.harness.frame.session import Session


def answers_of(prepared, width, height, settings, device="cpu", method="ray_grids"):
    session = Session(make_method(method, settings), prepared, width, height, device)
    moment = prepared.moment(0, width, height)
    return session, moment, session.answers(moment)


@pytest.mark.parametrize("seed", range(20))
def test_equals_brute_force_under_random_knobs(seed, device):
    random = np.random.default_rng(1000 + seed)
    width, height = int(random.integers(1, 40)), int(random.integers(1, 40))
    vertices, faces = soup(seed, int(random.integers(1, 50)), size=float(np.exp(random.uniform(-3, 1.5))))
    scale = 2.0 ** int(random.integers(-20, 21)) if seed % 3 == 0 else 1.0
    eye = random.normal(size=3) * (3 if seed % 2 else 0.3)
    lights = [tuple(random.normal(size=3) * 10.0 ** random.uniform(-4, 7) * scale) for _ in range(2)]
    lights += [tuple(vertices[0] * scale), tuple(vertices[:3].mean(axis=0) * scale)]
    prepared = make_scene(vertices * scale, faces, lights, tuple(eye * scale), (0.0, 0.0, 0.0), 90.0)
    settings = trial(
        cells=[8, 64, 200, 512][seed % 4],
        inline_pixels=random.integers(0, 60),
        chunk=random.integers(1, 100),
        inline_rays=random.integers(0, 60),
        inline_cells=random.integers(0, 100),
        lights_at_once=1 + seed % 4,
        shares=1 + seed // 4 % 3,
        region=["triangles", "rays"][seed // 3 % 2],
        overlaps=["true", "false"][seed // 2 % 2],
        groups=["stream", "split"][seed // 5 % 2],
        spacing=["rays", "even"][seed // 7 % 2],
    )
    session, moment, got = answers_of(prepared, width, height, settings, device)
    best, t = closest(prepared, moment)
    assert (got["triangle"] == best).all()
    hit = best >= 0
    np.testing.assert_allclose(got["t"][hit], t[hit], rtol=2**-23)
    assert np.isinf(got["t"][~hit]).all()
    for light in range(len(lights)):
        assert (got["shadowed"][light] == shadowed(prepared, moment, light, best, t)).all(), light
    session.frame.answers.poison()
    session.replay()  # on the GPU a graph, in which lights run beside each other
    for name, values in session.frame.answers.to_host().items():
        np.testing.assert_array_equal(values, got[name], err_msg=name)


def test_equals_the_papers_method_bit_for_bit(device):
    """Large and small triangles, light inside and outside; every knob of ours the same bits."""
    small, large = soup(7, 400, size=0.05), soup(8, 12, size=3.0)
    vertices = np.concatenate([small[0], large[0]])
    prepared = make_scene(vertices, np.arange(len(vertices)).reshape(-1, 3), [(0.1, 0.2, 0.3), (5.0, 4.0, 3.0)])
    _, _, reference = answers_of(prepared, 93, 71, {}, device, "perspective_spherical")
    for settings in (
        {},
        trial(inline_rays=1, inline_cells=0, cells=8, groups="split"),
        trial(inline_rays=0, inline_cells=0, cells=256, chunk=5),
        trial(inline_rays=0, inline_cells=0, cells=256, chunk=40),
        trial(region="rays"),
        trial(region="triangles", overlaps="true"),
        trial(region="triangles", overlaps="false"),
        trial(inline_rays=1000, inline_cells=1000, cells=256, groups="split"),
    ):
        _, _, got = answers_of(prepared, 93, 71, settings, device)
        for name, values in got.items():
            assert (values == reference[name]).all(), (settings, name)


@pytest.mark.parametrize(
    ("vertices", "faces"),
    [
        (np.zeros((0, 3)), np.zeros((0, 3))),
        (np.zeros((3, 3)), [[0, 1, 2]]),
        ([[np.nan, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]),
        ([[-1, -1, 5], [1, -1, 5], [0, 1, 5]], [[0, 1, 2]]),
    ],
    ids=["no triangles", "zero area", "NaN", "behind the eye"],
)
def test_nothing_to_see(vertices, faces):
    _, _, got = answers_of(make_scene(vertices, faces, [(0.0, 5.0, 0.0)]), 9, 7, {})
    assert (got["triangle"] == -1).all()
    assert np.isinf(got["t"]).all()
    assert (got["shadowed"] == 0).all()


def test_a_moved_frame_equals_a_fresh_one():
    vertices, faces = soup(5, 200)
    near, far = (make_scene(vertices, faces, [(1.0, 2.0, 3.0)]), make_scene(vertices * 0.5, faces, [(0.1, 0.2, 0.3)]))
    session, moment, first = answers_of(near, 32, 32, {})
    moved = far.moment(0, 32, 32)
    session.answers(moved)
    again = session.answers(moment)
    _, _, fresh = answers_of(far, 32, 32, {})
    after = session.answers(moved)
    for name in first:
        assert (first[name] == again[name]).all()
        assert (fresh[name] == after[name]).all()


def test_few_pairs_are_undecided_however_far_the_eye():
    """Bounds grow with the triangles' coordinates, not with the eye's: what float64 decides stays the exception."""
    vertices, faces = soup(7, 400, size=0.2)
    prepared = make_scene(vertices, faces, [(5.0, 4.0, 3.0)], (0.0, 0.0, 300.0), (0.0, 0.0, 0.0), 0.6)
    session, _, got = answers_of(prepared, 64, 64, {})
    rays = int((got["triangle"] >= 0).sum())
    assert rays > 1000
    assert session.method.counters()["light 0 undecided pairs"] < 0.02 * rays
