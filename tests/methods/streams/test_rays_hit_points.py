"""Hit points from the camera's words: as near to those of the answers as the bounds of a light's grid suppose."""

import numpy as np
import warp as wp
from helpers.launched import launched
from helpers.small_scenes import make_scene, soup, trace
from helpers.streams import lights_of_session
from numpy.typing import NDArray
from shadowbench.harness.scene.prepared import Prepared
from shadowbench.methods.common.pixels import thread_count, tile_pixel
from shadowbench.methods.streams.camera.pixels import distance_of, hit_word
from shadowbench.methods.streams.cube.lights import Light, aim_of
from shadowbench.methods.streams.rays.hit_points import PrimaryHits, exact_point, placed, point_of

SIZE = 48, 40


@wp.kernel(enable_backward=False)
def points_kernel(
    hits: PrimaryHits, light: Light,
    triangle: wp.array(dtype=wp.int32), rough: wp.array(dtype=wp.vec3d), exact: wp.array(dtype=wp.vec3d),
    way: wp.array(dtype=wp.float32), t: wp.array(dtype=wp.float32), placed_as: wp.array(dtype=wp.vec4f),
):  # fmt: skip
    at = tile_pixel(wp.tid(), hits.camera.width, hits.camera.height)
    if at[0] < 0:
        return
    pixel = at[1] * hits.camera.width + at[0]
    point = point_of(hits, pixel, at)
    triangle[pixel] = point.triangle
    if point.triangle >= 0:
        exact[pixel] = exact_point(hits, pixel, at)
        rough[pixel] = point.hit
        t[pixel] = point.t
        way[pixel] = wp.where(point.exact_path, wp.float32(-1.0), point.way)
        placed_as[pixel] = placed(point, True, aim_of(light)).place


def points_of(prepared: Prepared) -> dict[str, NDArray[np.generic]]:
    """What :func:`points_kernel` finds for every pixel that hits, and the t of the answers."""
    session, _, answers = trace("ray_grids", {}, prepared, *SIZE)
    (light,) = lights_of_session(session)
    names = "triangle rough exact way t placed_as".split()
    found = launched(points_kernel, thread_count(*SIZE), [light.hits, light.light], [SIZE[0] * SIZE[1]] * len(names))
    result = dict(zip(names, found, strict=True))
    assert (result["triangle"] == answers["triangle"].ravel()).all()
    result["answer_t"] = answers["t"].ravel()
    return {name: values[result["triangle"] >= 0] for name, values in result.items()}


def scene_of(seed: int) -> Prepared:
    """Triangles of many sizes, eyes near and far, a light anywhere. In every second scene triangles and eye lie almost in
    one plane.
    """
    random = np.random.default_rng(seed)
    vertices, faces = soup(seed, 60, size=float(np.exp(random.uniform(-2, 3))))
    middle = random.normal(size=3) * 10.0 ** random.uniform(-2, 2)
    eye = random.normal(size=3) * 10.0 ** random.uniform(-1, 3)
    if seed % 2:
        vertices[:, 1] *= 10.0 ** -random.uniform(3, 7)
        eye[1] *= 10.0 ** -random.uniform(3, 5)
    light = random.normal(size=3) * 10.0 ** random.uniform(-2, 4)
    target = vertices[faces[0]].mean(0)
    shifted = [tuple(float(x) for x in point + middle) for point in (light, eye, target)]
    return make_scene((vertices + middle).astype(np.float32), faces, shifted[:1], shifted[1], shifted[2], 50.0)


@wp.kernel(enable_backward=False)
def word_kernel(inverse: wp.array(dtype=wp.float64), i: wp.array(dtype=wp.int32), t: wp.array2d(dtype=wp.float64)):
    k, spare = wp.tid()
    t[k, spare] = distance_of(hit_word(inverse[k], i[k] >> spare, spare), spare)


def test_a_word_gives_the_distance_to_half_of_what_it_cuts():
    random = np.random.default_rng(1)
    inverse = np.exp(random.uniform(-80, 80, 5000))
    index = random.integers(0, 2**24, inverse.size).astype(np.int32)
    shape = inverse.size, 9
    (t,) = launched(word_kernel, shape, [inverse, index], [shape])
    off = np.abs(t * inverse[:, None] - 1.0)
    bound = 2.0 ** -(30.0 + np.arange(9))
    assert (off <= bound * 1.000001).all()
    assert (off > 0.5 * bound).mean() > 0.2


def test_points_of_words_are_as_near_as_the_bounds_suppose():
    """With so few triangles the words cut 1 / t at 2^-37; what else points are off is at most 2^-31 of the way. Those of
    some triangles would be farther off.
    """
    found = [points_of(scene_of(seed)) for seed in range(40)]
    many = {name: np.concatenate([one[name] for one in found]) for name in found[0]}
    rough = many["way"] >= 0
    off = np.abs(many["rough"] - many["exact"]).max(axis=1)[rough]
    assert rough.sum() > 5000
    assert (off <= (2.0**-31 + 2.0**-38) * 1.0001 * many["way"][rough]).all()
    t, answer = many["t"][rough].astype(float), many["answer_t"][rough].astype(float)
    assert (np.abs(t - answer) <= 2.0**-22 * answer).all()
    assert 50 < (~rough).sum() < 0.5 * rough.size
    assert (many["placed_as"][~rough][:, 2] == -1.0).all()


def test_points_beside_the_light_are_not_placed_by_the_words():
    """A floor a thousandth of its distance from the eye below the light."""
    vertices = np.array([(-9, 0, -9), (9, 0, -9), (0, 0, 9)], dtype=np.float32)
    prepared = make_scene(vertices, np.array([[0, 1, 2]]), [(0.0, 1e-3, 0.0)], (0.0, 4.0, 0.01), (0.0, 0.0, 0.0), 0.2)
    found = points_of(prepared)
    near = found["placed_as"][:, 2] == -1.0
    assert 0 < near.sum() < near.size
    distance = np.abs(found["exact"] - np.array([0.0, 1e-3, 0.0])).max(axis=1)
    assert (distance[near] < 2.0**-10 * 4.0).all()
    assert (found["placed_as"][~near][:, 3] >= 2.0**-11 * found["way"][~near]).all()
