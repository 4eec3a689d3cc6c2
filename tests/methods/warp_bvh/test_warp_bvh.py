"""Warp's BVHs: the rebuilt Bvh (``box_tree.py``, ``common/bounds.py``, ``corner_records.py``) with the exact
answers, the Mesh (``mesh_kernels.py``, ``mesh_triangles.py``) within what is known of it; what was built.
"""

from __future__ import annotations

import numpy as np
import pytest
import warp as wp
from helpers.launched import launched
from helpers.method_trials import assert_exact, assert_nearly
from helpers.small_scenes import answers_in, assert_same, make_scene, soup, trace
from shadowbench.harness.frame.registry import make_method
from shadowbench.harness.frame.session import Session
from shadowbench.harness.scene.prepared import Prepared, prepare
from shadowbench.harness.scene.scene import Camera, Geometry, Light, Scene

NAME = "warp_bvh"
EXACT = {"update": "bvh_rebuild"}
PLAIN = [{"update": "rebuild", "origin": "plain"}, {"update": "refit", "origin": "plain_cut"}]


@pytest.mark.parametrize("settings", PLAIN, ids=str)
def test_plain_shadow_rays_are_nearly_right_on_a_scene_of_ordinary_size(settings, device):
    vertices, faces = soup(21, 150, size=0.2)
    lights = [(2.0, 3.0, 4.0), (0.1, 0.0, 0.2)]
    prepared = make_scene(vertices, faces, lights, (0.0, 0.5, 3.0))
    assert_nearly(NAME, settings, prepared, 41, 29, device)
    method = make_method(NAME, settings)
    assert "some shadow bits are wrong" in str(method.known_inexact)
    assert method.capturable == (settings["update"] == "refit")
    # Waechter and Binder's fixed step near zero is longer than a scene of this size; a share of the way is not.
    small = make_scene(vertices * 1e-6, faces, [(2e-6, 3e-6, 4e-6)], (0.0, 5e-7, 3e-6))
    got, right = (trace(NAME, x, small, 41, 29, device)[2]["shadowed"].sum() for x in (settings, EXACT))
    assert (got < 0.5 * right) == (settings["origin"] == "plain")


def test_built_says_what_was_really_built():
    prepared = make_scene(*soup(7, 10), [(5.0, 4.0, 3.0)])
    for asked, got in (("default", "sah"), ("lbvh", "sah"), ("median", "median"), ("cubql", "cubql")):
        session, _, _ = trace(NAME, {"constructor": asked}, prepared, 4, 4)
        assert session.method.built()["constructor"] == got
    assert make_method(NAME, {"update": "refit", "leaf_size": "2"}).built() == {"update": "refit", "leaf_size": 2}


def test_exact_variant_has_the_exact_answers_and_counts_fewer_tests():
    prepared = make_scene(*soup(7, 300), [(5.0, 4.0, 3.0)])
    exact = assert_exact(NAME, EXACT, prepared, 16, 16)
    session, _, _ = trace(NAME, EXACT, prepared, 16, 16)
    counters = session.method.counters()
    assert 256 < counters["primary tests"] < 256 * 300 / 4
    assert 0 < counters["shadow tests"] < 256 * 300 / 4
    assert_same(answers_in(session), exact)


SLIVERS = 10_000


def with_slivers(frames: int, count: int = SLIVERS) -> Prepared:
    """A soup that grows from frame to frame, and ``count`` triangles across it without area: corners on one line. In the
    third frame they get an area.
    """
    vertices, faces = soup(11, 400, size=0.2)
    random = np.random.default_rng(5)
    start, step = random.integers(-1, 1, (count, 3)), random.integers(1, 3, (count, 3))
    # Small integers over 8: each difference and product is exact, so that there is no area at all.
    lines = (start[:, None] + np.arange(3)[None, :, None] * step[:, None]).reshape(-1, 3) / 8.0
    bent = np.arange(3 * count)[:, None] % 2 * np.array([1.0, 0.0, 0.0])
    new = np.arange(3 * count).reshape(-1, 3) + len(vertices)
    geometry = Geometry(
        np.concatenate([faces, new]).astype(np.int32),
        lambda k: np.concatenate([vertices * (1 + k), lines + (k == 2) * bent]),
        frames,
    )
    camera, lights = Camera((0.0, 0.0, 3.0), (0.0, 0.0, 0.0)), (Light((2.0, 3.0, 4.0)),)
    return prepare(Scene("slivers", "slivers", lambda: geometry, camera, lights))


def visits(prepared: Prepared, indices: np.ndarray, frame: int) -> int:
    """Boxes of ``indices`` that the primary rays of 16x16 pixels meet in a tree over the first frame, refitted."""

    def boxes(points: np.ndarray) -> list[np.ndarray]:
        corners = points[indices.reshape(-1, 3)]
        return [corners.min(axis=1), corners.max(axis=1)]

    lowers, uppers = (wp.array(side, dtype=wp.vec3f, device="cpu") for side in boxes(prepared.points(0)[0]))
    tree = wp.Bvh(lowers, uppers, constructor="median", leaf_size=4)
    for array, side in zip((lowers, uppers), boxes(prepared.points(frame)[0]), strict=True):
        array.assign(side)
    tree.refit()
    moment = prepared.moment(frame, 16, 16)
    pixels = np.arange(256)
    inputs = [tree.id, moment.origins(pixels), moment.directions(pixels)]
    ((count,),) = launched(visits_kernel, 256, inputs, [1])
    return int(count)


@wp.kernel(enable_backward=False)
def visits_kernel(
    tree: wp.uint64, origins: wp.array(dtype=wp.vec3f), directions: wp.array(dtype=wp.vec3f),
    count: wp.array(dtype=wp.int32),
):  # fmt: skip
    i = wp.tid()
    boxes = wp.bvh_query_ray(tree, origins[i], directions[i])
    box = wp.int32(0)
    while wp.bvh_query_next(boxes, box):
        wp.atomic_add(count, 0, 1)


@pytest.mark.parametrize(("update", "frames"), [("rebuild", 1), ("refit", 1), ("static", 1), ("refit", 2)])
def test_triangles_that_never_have_an_area_are_left_out_of_the_tree(update, frames, device):
    one, other = (
        trace(NAME, {"update": update}, with_slivers(frames, count), 16, 16, device) for count in (0, SLIVERS)
    )
    assert other[0].method._triangles.count == 400
    np.testing.assert_array_equal(*(x[0].method._triangles.indices.numpy() for x in (one, other)))
    assert_same(other[2], one[2])


def test_a_refitted_tree_has_the_boxes_that_it_was_built_with(device):
    """What is invalid stays one point: with other indices in the refit a ray would visit boxes that span the scene."""
    prepared, bare = with_slivers(3), with_slivers(3, 0)
    session = Session(make_method(NAME, {"update": "refit"}), prepared, 16, 16, device)
    triangles = session.method._triangles
    built = triangles.indices.numpy().copy()
    assert triangles.count == 400 + SLIVERS, "they get an area in the third frame"
    assert (built.reshape(-1, 3)[400:].min(axis=1) == built.reshape(-1, 3)[400:].max(axis=1)).all()
    for frame in (0, 1):
        session.answers(prepared.moment(frame, 16, 16))
        np.testing.assert_array_equal(triangles.indices.numpy(), built)
        least = visits(bare, bare.faces.ravel(), frame)
        assert least > 1000
        assert visits(prepared, built, frame) <= 1.1 * least
    whole = prepared.faces.ravel()
    session.answers(prepared.moment(2, 16, 16))
    np.testing.assert_array_equal(triangles.indices.numpy(), whole)
    assert visits(prepared, whole, 1) > 1.1 * visits(bare, bare.faces.ravel(), 1), "the limit tells them apart"


def test_boxes_of_triangles_without_area_are_spread_over_an_edge_of_the_scene(device):
    """Warp rebuilds a tree of boxes that share a Morton code slowly: of 10,000 at most 10 may."""
    prepared, bare = with_slivers(1), with_slivers(1, 0)
    session, moment, got = trace(NAME, EXACT, prepared, 16, 16, device)
    tree = session.method._tree
    lowers, uppers = tree._lowers.numpy()[400:], tree._uppers.numpy()[400:]
    np.testing.assert_array_equal(lowers, uppers)
    places, counts = np.unique(lowers, axis=0, return_counts=True)
    corners = moment.points[prepared.faces[:400]].reshape(-1, 3)
    assert (len(places), counts.max()) == (1024, 10)
    assert (places >= corners.min(axis=0)).all()
    assert (places <= corners.max(axis=0)).all()
    assert (np.ptp(places, axis=0) > 0).sum() == 1
    assert_same(got, trace(NAME, EXACT, bare, 16, 16, device)[2])


def test_only_the_mesh_made_anew_cannot_be_captured_and_only_the_bvh_is_exact():
    for update in ("rebuild", "refit", "static", "bvh_rebuild"):
        method = make_method(NAME, {"update": update})
        assert method.capturable == (update != "rebuild")
        assert (method.known_inexact is None) == (update == "bvh_rebuild")
