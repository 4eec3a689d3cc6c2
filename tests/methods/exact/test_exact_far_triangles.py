"""Rays exactly through vertices of triangles seen from very far, and shadows there (``exact/segment.py``): what
float64 is proven to do, and what it does beyond.

A ray o + t d with o = -D d meets the origin exactly, with every bit of d in use; the fan about the origin has corners
with bits of their own. Its closed triangles hold the ray, so that missing all of them is a hole.
"""

import numpy as np
import pytest
import warp as wp
from helpers.launched import launched
from shadowbench.harness.frame.geometry import Corners, Ray
from shadowbench.methods.exact.segment import may_occlude, occludes
from shadowbench.methods.exact.triangle import hit_distance, may_hit

FAN = 6
COUNT = 20_000
DISTANCE = 2.0**20


@wp.kernel
def fan_kernel(
    origins: wp.array(dtype=wp.vec3f), directions: wp.array(dtype=wp.vec3f), beyond: wp.array(dtype=wp.vec3d),
    rings: wp.array2d(dtype=wp.vec3f), weld: wp.array2d(dtype=wp.int32), hits: wp.array(dtype=wp.int32),
    shadows: wp.array(dtype=wp.int32),
):  # fmt: skip
    """Triangles of each fan that the ray hits, and that cut the segment from ``beyond`` to the ray's origin."""
    i = wp.tid()
    a = wp.vec3f(0.0, 0.0, 0.0)
    o = origins[i]
    h = beyond[i]
    h32 = wp.vec3f(wp.float32(h[0]), wp.float32(h[1]), wp.float32(h[2]))
    for j in range(FAN):
        b = rings[i, j]
        c = rings[i, (j + 1) % FAN]
        w = wp.vec3i(weld[i, FAN], weld[i, j], weld[i, (j + 1) % FAN])
        ray = Ray(o, directions[i])
        fan = Corners(a, b, c)
        if may_hit(ray, fan) and hit_distance(ray, fan, w) > wp.float64(0.0):
            hits[i] = hits[i] + 1
        if may_occlude(h32, o, fan, wp.float32(1.0)) and occludes(h, o, fan, w, wp.float64(0.0)):
            shadows[i] = shadows[i] + 1


def fans(edges_away: float, light_edges_away: float) -> tuple[np.ndarray, np.ndarray]:
    """Hits and shadows of many fans whose edges are so many times shorter than the distance of eye and receiver.

    The segment's far end, the light, stands at the ray's origin; ``light_edges_away`` is its distance in edges.
    """
    random = np.random.default_rng(7)
    d = (np.round(random.uniform(-1, 1, (COUNT, 3)) * 2**24) / 2**24).astype(np.float32)
    length = np.linalg.norm(d.astype(np.float64), axis=1)
    edge = DISTANCE * length / light_edges_away
    forward = d / length[:, None]
    right = np.cross(forward, random.normal(size=(COUNT, 3)))
    right /= np.linalg.norm(right, axis=1, keepdims=True)
    up = np.cross(forward, right)
    angle = np.arange(FAN) * 2 * np.pi / FAN + random.uniform(-0.3, 0.3, (COUNT, FAN))
    depth = random.uniform(-0.4, 0.4, (COUNT, FAN, 1))
    ring = np.cos(angle)[..., None] * right[:, None] + np.sin(angle)[..., None] * up[:, None]
    ring = edge[:, None, None] * (ring + depth * forward[:, None])
    share = 2.0 ** np.floor(np.log2(edges_away / light_edges_away))
    weld = random.random((COUNT, FAN + 1)).argsort(axis=1)
    inputs = [-DISTANCE * d, d, DISTANCE * share * d.astype(np.float64), ring.astype(np.float32), weld]
    hits, shadows = launched(fan_kernel, COUNT, inputs, [COUNT, COUNT])
    return hits, shadows


@pytest.mark.parametrize("edges_away", [1e2, 1e4, 1e5, 4e5])
def test_every_triangle_at_a_vertex_holds_the_ray_through_it(edges_away):
    hits, shadows = fans(edges_away, edges_away)
    assert (hits == FAN).all(), np.bincount(hits)
    assert (shadows == FAN).all(), np.bincount(shadows)


@pytest.mark.parametrize("light", [1e7, 1e10])
def test_shadows_ask_for_the_receivers_distance_and_not_for_the_lights(light):
    shadows = fans(1e5, light)[1]
    assert (shadows == FAN).all(), np.bincount(shadows)


def test_beyond_the_proof_some_triangle_still_holds_it():
    """From 1e7 edges rounding shows, but not as a hole; a direction's own last bit moves the ray by half an edge there."""
    hits, shadows = fans(1e7, 1e7)
    assert hits.min() >= 1
    assert shadows.min() >= 1
    assert hits.min() < FAN, "rounding shows nowhere: the limit that is told is too careful"
