"""Pixels of the camera against triangles, as ``reads.py`` reads them: what float32 calls certain is so, and words
order hits.
"""

import numpy as np
import pytest
import warp as wp
from helpers.launched import launched
from helpers.small_scenes import make_scene, soup
from shadowbench.harness.frame.frame import Frame
from shadowbench.harness.frame.geometry import Camera, Mesh
from shadowbench.methods.common.reads import corners_at, direction_at
from shadowbench.methods.exact.triangle import spare_bits
from shadowbench.methods.streams.camera.pixels import edge_planes, hit_word, index_of, least_edge, sign_bound

WIDTH, HEIGHT = 32, 24


@wp.kernel(enable_backward=False)
def edges_kernel(camera: Camera, mesh: Mesh, least: wp.array3d(dtype=wp.float32), bound: wp.array(dtype=wp.float32)):
    i, y, x = wp.tid()
    planes = edge_planes(camera.eye[0], corners_at(mesh, i))
    least[i, y, x] = least_edge(planes, direction_at(camera, x, y))
    bound[0] = sign_bound(camera.tangents)


@wp.kernel(enable_backward=False)
def words_kernel(
    triangles: wp.int32, inverse: wp.array(dtype=wp.float64), index: wp.array(dtype=wp.int32),
    words: wp.array(dtype=wp.uint64), back: wp.array(dtype=wp.int32),
):  # fmt: skip
    k = wp.tid()
    spare = spare_bits(triangles)
    words[k] = hit_word(inverse[k], index[k], spare)
    back[k] = index_of(words[k], spare)


@pytest.mark.parametrize("size", [0.2, 1.0, 30.0])
def test_certain_signs_are_those_of_float64(size):
    vertices, faces = soup(3, 60, size=size)
    prepared = make_scene(vertices, faces, [], eye=(0.3, -0.2, 4.0))
    moment = prepared.moment(0, WIDTH, HEIGHT)
    frame = Frame(prepared, WIDTH, HEIGHT, 0, "cpu")
    frame.load(moment)
    shape = len(faces), HEIGHT, WIDTH
    found, (margin,) = launched(edges_kernel, shape, [frame.camera, frame.mesh], [shape, 1])
    directions = (moment.column[None] + moment.row[:, None]).astype(np.float64)
    a, b, c = (moment.points[prepared.faces[:, k]].astype(np.float64) - moment.eye for k in range(3))
    side = np.sign(np.einsum("ij,ij->i", np.cross(b - a, c - a), a))
    edges = np.stack([np.cross(p, q) * side[:, None] for p, q in ((a, b), (b, c), (c, a))])
    inside = np.einsum("kij,yxj->iyxk", edges, directions).min(axis=-1)
    assert (inside[found > margin] > 0).all()
    assert (inside[found < -margin] < 0).all()
    sure = np.abs(found) > margin
    assert sure.mean() > 0.9
    assert (found[sure] > 0).any()
    assert (found[sure] < 0).any()


@pytest.mark.parametrize("triangles", [3, 70_000, 2**24 - 1])
def test_a_nearer_hit_and_of_ties_the_lower_index_has_the_larger_word(triangles):
    rng = np.random.default_rng(triangles)
    inverse = np.repeat(np.sort(np.exp2(rng.uniform(-60, 60, 200))), 2)
    index = np.stack([rng.integers(1, triangles, 200), np.zeros(200)], axis=1).astype(np.int32).ravel()
    words, back = launched(words_kernel, 400, [triangles, inverse, index], [400, 400])
    assert (back == index).all()
    assert (np.diff(words.astype(object)) > 0).all()
