"""Scenes on which methods are tried, and what they are held to: exact ones bit for bit, others within their errors."""

import functools
from collections.abc import Iterator
from typing import Any

import numpy as np
from helpers.exact_answers import assert_right, exact_answers
from helpers.small_scenes import Answers, make_scene, soup, trace
from numpy.typing import NDArray
from shadowbench.harness.hardcases import shapes
from shadowbench.harness.scene.moment import Moment
from shadowbench.harness.scene.prepared import Prepared, prepare
from shadowbench.harness.scene.scene import Camera, Geometry, Light, Scene


@functools.lru_cache(maxsize=64)
def expected(prepared: Prepared, width: int, height: int) -> Answers:
    """The exact answers to the first frame."""
    return exact_answers(prepared, prepared.moment(0, width, height))


def assert_exact(
    name: str, settings: dict[str, str], prepared: Prepared, width: int, height: int, device: str = "cpu"
) -> Answers:
    """The answers to one frame, which are right."""
    got = trace(name, settings, prepared, width, height, device)[2]
    assert_right(got, expected(prepared, width, height))
    return got


def assert_nearly(
    name: str, settings: dict[str, str], prepared: Prepared, width: int, height: int, device: str = "cpu",
    share: float = 0.01, lights: int | None = None,
) -> Answers:  # fmt: skip
    """As many as ``share`` of the pixels may have another id or shadow bit than is exact; the rest must agree.

    Shadow bits are compared for the first ``lights`` lights only, or for all.
    """
    _, moment, got = trace(name, settings, prepared, width, height, device)
    exact = expected(prepared, width, height)
    assert_misses(got)
    same = got["triangle"] == exact["triangle"]
    assert (~same).sum() <= share * len(same)
    np.testing.assert_allclose(got["t"][same], exact["t"][same], rtol=1e-4)
    assert_weights(got, prepared, moment)
    for light in range(len(moment.lights) if lights is None else lights):
        assert (got["shadowed"][light] != exact["shadowed"][light])[same].sum() <= share * len(same), light
    return got


def assert_misses(got: Answers) -> None:
    """The conventions of a miss, and no answer left poisoned."""
    missed = got["triangle"] == -1
    assert (got["triangle"] >= -1).all()
    assert np.isinf(got["t"][missed]).all()
    assert np.isfinite(got["t"][~missed]).all()
    assert (got["u"][missed] == 0).all()
    assert (got["v"][missed] == 0).all()
    assert (got["shadowed"][:, missed] == 0).all()
    assert np.isin(got["shadowed"], (0, 1)).all()


def assert_weights(got: Answers, prepared: Prepared, moment: Moment) -> None:
    """(u, v) must be the weights of vertices 1 and 2: they rebuild the hit point."""
    pixels = np.nonzero(got["triangle"] >= 0)[0]
    corners = moment.points[prepared.faces[got["triangle"][pixels]]].astype(np.float64)
    u, v = got["u"][pixels, None].astype(np.float64), got["v"][pixels, None].astype(np.float64)
    rebuilt = corners[:, 0] * (1 - u - v) + corners[:, 1] * u + corners[:, 2] * v
    direct = moment.eye + moment.directions(pixels).astype(np.float64) * got["t"][pixels, None]
    size = np.maximum(np.abs(corners).max(axis=(1, 2)), np.abs(moment.eye).max())
    error = np.abs(rebuilt - direct).max(axis=1) / size
    assert (error > 1e-3).sum() <= 0.01 * len(error)
    assert (error <= 0.05).all()


def assert_lit(name: str, settings: dict[str, str], height: float, scale: float = 1.0, device: str = "cpu") -> None:
    """A lit plane has none, whatever its own coordinate is; one of its lights stands low."""
    vertices, faces = lattice(8, scale)
    lights = [(0.1 * scale, 0.2 * scale, (height + 1) * scale), (30.0 * scale, 0.0, (height + 1e-2) * scale)]
    eye, middle = (0.0, 0.0, (height + 1.5) * scale), (0.0, 0.0, height * scale)
    got = trace(name, settings, make_scene(vertices + middle, faces, lights, eye, middle), 32, 32, device)[2]
    assert (got["triangle"] >= 0).sum() > 500
    assert got["shadowed"].sum() == 0


def listed(pairs: Any, triangles: int) -> NDArray[np.int64]:
    """The (cell, triangle) pairs in a grid's lists, as cell * ``triangles`` + triangle."""
    begin, end = pairs.begin.numpy(), pairs.end.numpy()
    cells = np.repeat(np.arange(len(begin), dtype=np.int64), end - begin)
    places = np.concatenate([np.arange(b, e) for b, e in zip(begin, end, strict=True) if e > b])
    return cells * triangles + pairs.values.numpy()[places]


def random_trial(seed: int) -> tuple[Prepared, int, int]:
    """A soup with two lights anywhere, one on a vertex and one inside a triangle; image of any small size."""
    random = np.random.default_rng(seed)
    width, height = int(random.integers(1, 40)), int(random.integers(1, 40))
    vertices, faces = soup(seed, int(random.integers(1, 50)), size=float(np.exp(random.uniform(-3, 1.5))))
    scale = (1.0, 1e-6, 1e6, 2.0 ** int(random.integers(-20, 21)))[seed % 4]
    eye = random.normal(size=3) * (3 if seed % 2 else 0.3)
    lights = [tuple(random.normal(size=3) * 10.0 ** random.uniform(-4, 7) * scale) for _ in range(2)]
    lights += [tuple(vertices[0] * scale), tuple(vertices[:3].mean(axis=0) * scale)]
    return (make_scene(vertices * scale, faces, lights, tuple(eye * scale), (0.0, 0.0, 0.0), 90.0), width, height)


def moving(broken: bool) -> Prepared:
    """Four frames of a soup; with ``broken``, triangles are NaN in the first two frames and sound again after."""
    vertices, faces = soup(11, 200, size=0.2)
    moved = [vertices.copy(), vertices * 1.5, np.roll(vertices, 1, axis=1), vertices * 0.1]
    if broken:
        moved[0][30:60] = np.nan
        moved[1][:3] = np.nan
    geometry = Geometry(faces.astype(np.int32), lambda k: moved[k], len(moved))
    camera, lights = Camera((0.0, 0.0, 3.0), (0.0, 0.0, 0.0)), (Light((2.0, 3.0, 4.0)),)
    return prepare(Scene("moving", "moving", lambda: geometry, camera, lights))


def lattice(count: int, half: float = 1.0) -> tuple[NDArray, NDArray]:
    """A flat square of 2 count^2 triangles in the plane z = 0, wound towards +z."""
    return shapes.lattice(np.linspace(-half, half, count + 1), 0.0)


def box(count: int, half: float = 1.0) -> tuple[NDArray, NDArray]:
    """A closed box of six lattices that face outwards, split at its edges."""
    flat, faces = lattice(count, half)
    walls = [np.roll(flat + [0.0, 0.0, at], axis + 1, axis=1) for axis in range(3) for at in (-half, half)]
    return shapes.joined(*zip(walls, [faces[:, ::-1], faces] * 3, strict=True))


TRIANGLE = [[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 1.0, 0.0]]


def hard_trials() -> Iterator[tuple[str, Prepared, int, int]]:
    """Named cases: (name, scene, width, height)."""
    above = [(0.0, 0.0, 2.0), (0.3, 0.25, -1.0)]
    # Eye at distance 1 and 90 degrees: n pixels across meet the plane at odd multiples of 1 / n.
    flat, faces = lattice(8)
    yield "rays at diagonals", make_scene(flat, faces, above, (0.0, 0.0, 1.0), fov=90.0), 16, 16
    shifted = flat + [1 / 8, 1 / 8, 0.0]
    yield "rays at vertices", make_scene(shifted, faces, above, (0.0, 0.0, 1.0), fov=90.0), 8, 8
    yield "axis-parallel rays", make_scene(flat, faces, above, (0.0, 0.0, 1.0), fov=90.0), 17, 5
    yield "eye in the plane", make_scene(flat, faces, above, (3.0, 0.0, 0.0), fov=40.0), 9, 9
    walls, sides = box(4)
    yield (
        "eye in a box",
        make_scene(walls, sides, [(0.5, 0.5, 0.5), (4.0, 0.0, 0.0)], (0.0, 0.0, 0.0), (0.0, 0.0, -1.0), 90.0),
        17,
        17,
    )
    yield ("eye on a wall", make_scene(walls, sides, [(0.0, 0.0, 0.0)], (0.0, 0.0, 1.0), (0.0, 0.0, -1.0), 90.0), 9, 9)
    yield "eye far away", make_scene(walls, sides, [(2.0, 3.0, 4.0)], (1e5, 1e5, 1e5), fov=1e-3), 16, 16
    yield "one triangle", make_scene(TRIANGLE, [[0, 1, 2]], above), 17, 5
    yield "one pixel", make_scene(TRIANGLE, [[0, 1, 2]], above), 1, 1
    yield "duplicates", make_scene(TRIANGLE, [[0, 1, 2]] * 5, above), 8, 8
    yield "no triangle", make_scene(TRIANGLE, np.zeros((0, 3)), above), 5, 4
    yield "nothing", make_scene(np.zeros((0, 3)), np.zeros((0, 3)), above), 5, 4
    odd = [*TRIANGLE, [np.nan] * 3, [np.nan, 0, 1], [np.inf, 0, 0], [0, 0, 2], [0, 0.5, 2], [0, 1, 2]]
    broken = [[3, 3, 3], [3, 4, 5], [6, 7, 8], [0, 1, 3], [5, 7, 0], [1, 1, 2], [0, 1, 2], [8, 5, 4]]
    yield "broken triangles", make_scene(odd, broken, above), 12, 12
    yield "only broken triangles", make_scene(odd, broken[:4], above), 3, 3
    ground = shapes.quad((-1e3, -1e3, -2e-3), (1e3, -1e3, -2e-3), (1e3, 1e3, -2e-3), (-1e3, 1e3, -2.5e-3))
    stadium = shapes.joined(ground, soup(3, 300, size=2e-4, spread=1e-3))
    lights = [(3.0, 2.0, 5.0), (1e-3, 0.0, 4e-3)]
    yield "teapot in a stadium", make_scene(*stadium, lights, (0.0, -4e-3, 3e-3), up=(0.0, 0.0, 1.0)), 24, 24
    slanted = np.array([[-5.0, -4.0, -3.0], [5.0, 4.1, 2.9], [-4.5, 5.0, 3.5], [4.0, -5.0, 4.0]])
    across = slanted, np.array([[0, 1, 2], [1, 2, 3], [0, 1, 3]])
    crossing = shapes.joined(across, soup(5, 400, size=0.05, spread=3.0))
    yield "triangles through every cell", make_scene(*crossing, [(0.1, 0.2, 6.0)], (0.5, 0.4, 9.0)), 24, 24


TRIALS = {name: (prepared, width, height) for name, prepared, width, height in hard_trials()}
"""The hard trials by name."""
