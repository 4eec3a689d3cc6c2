"""The exact test of a shadow segment: where float32 says YES or NO, float64 says the same, at every distance."""

import numpy as np
import pytest
import warp as wp
from helpers.launched import launched
from shadowbench.harness.frame.geometry import Corners
from shadowbench.methods.exact.segment import occludes
from shadowbench.methods.exact.triangle import largest, to_float32
from shadowbench.methods.perspective_spherical.light.segment_tests import (
    NO,
    UNDECIDED,
    YES,
    segment_bounded,
    segment_exact,
)


@wp.kernel(enable_backward=False)
def verdict_kernel(
    size: wp.float32,
    lights: wp.array(dtype=wp.vec3f),
    corners: wp.array2d(dtype=wp.vec3f),
    hits: wp.array2d(dtype=wp.vec3d),
    verdicts: wp.array2d(dtype=wp.int32),
    exact: wp.array2d(dtype=wp.bool),
):
    i, j = wp.tid()
    triangle = Corners(corners[i, 0], corners[i, 1], corners[i, 2])
    weld = wp.vec3i(0, 1, 2)
    record = segment_exact(lights[i], triangle, size)
    h = hits[i, j]
    verdicts[i, j] = segment_bounded(to_float32(h), lights[i], 0.0, record)
    exact[i, j] = occludes(h, lights[i], triangle, weld, wp.float64(largest(triangle.a)))


@pytest.mark.parametrize("middle", [0.0, 300.0])
@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize("distance", [0.01, 1.0, 1e3, 1e7])
def test_a_verdict_without_doubt_is_what_float64_says(distance, scale, middle):
    random = np.random.default_rng(3)
    count, rays = 600, 60
    arms = random.normal(size=(count, 3, 3)) * np.exp(random.uniform(-7, 0.5, (count, 1, 1)))
    arms[::3, 2] = arms[::3, 1] + arms[::3, 2] * 1e-3  # slivers
    corners = np.float32((middle + random.normal(size=(count, 1, 3)) + arms) * scale)
    lights = np.float32((middle + random.normal(size=(count, 3)) * distance) * scale)
    # Hit points on, beside and exactly behind the triangle's edges, before and behind its plane.
    weights = random.dirichlet([0.5, 0.5, 0.5], (count, rays))
    weights[:, ::4, 0] = 0.0
    weights[:, 1::4] += random.normal(size=weights[:, 1::4].shape) * 10.0 ** random.uniform(-9, 0, (count, 15, 1))
    on = np.einsum("nrk,nkj->nrj", weights, corners.astype(np.float64))
    reach = np.abs(middle * scale) + 4 * scale
    away = on - lights[:, None]
    step = random.uniform(-1, 1, (count, rays, 1)) * 10.0 ** random.uniform(-9, 0.3, (count, rays, 1)) * scale
    hits = on + away / np.linalg.norm(away, axis=2, keepdims=True) * step
    hits = np.clip(hits, -2 * reach, 2 * reach)
    inputs = [float(np.abs(hits).max() * 1.000001), lights, corners, hits]
    verdicts, exact = launched(verdict_kernel, (count, rays), inputs, [(count, rays)] * 2)
    assert exact[verdicts == int(YES)].all()
    assert not exact[verdicts == int(NO)].any()
    assert 0 < (verdicts == int(UNDECIDED)).mean() < 0.95
    assert (verdicts == int(YES)).any()
