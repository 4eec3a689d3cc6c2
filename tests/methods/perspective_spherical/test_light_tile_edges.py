"""The exact test of a shadow segment (``light/segment_tests.py``), at every distance; the tiles of a rectangle
(``light/tile_edges.py``): what is left out holds no direction that could be hit.
"""

import numpy as np
import pytest
import warp as wp
from helpers.launched import launched
from shadowbench.harness.frame.geometry import Corners
from shadowbench.methods.common.pairs import zeroed
from shadowbench.methods.exact.segment import occludes
from shadowbench.methods.exact.triangle import largest, to_float32
from shadowbench.methods.perspective_spherical.light.segment_tests import (
    NO,
    UNDECIDED,
    YES,
    segment_bounded,
    segment_exact,
)
from shadowbench.methods.perspective_spherical.light.tile_edges import LightTiles, edges_kernel, missed, slope_bounds
from shadowbench.methods.perspective_spherical.lists.sorting import TileLists
from shadowbench.methods.perspective_spherical.parameters import LIGHT_MAPS

RECTANGLES = {
    "azimuth-elevation": (
        (-np.pi, np.pi, -np.pi / 2, np.pi / 2), (-1.2, 1.4, -0.9, 1.1), (0.3, 0.31, 1.4, 1.57), (2.0, 3.1, -1.5, 0.2),
    ),
    "two-angle": ((-np.pi, np.pi, -np.pi, np.pi), (-1.2, 1.4, -0.9, 1.1), (1.7, 3.1, 1.8, 3.0), (1.8, 2.0, -3.0, -2.0)),
    "cube": ((-1.0, 1.0, -1.0, 1.0), (0.2, 0.3, -0.7, 0.9)),
}  # fmt: skip


@wp.kernel(enable_backward=False)
def tile_kernel(
    grid: LightTiles, planes: wp.array2d(dtype=wp.vec3d), out: wp.array2d(dtype=wp.bool),
    slopes: wp.array2d(dtype=wp.vec3d),
):  # fmt: skip
    i, tile = wp.tid()
    column = grid.columns[tile % grid.tiles]
    row = grid.rows[tile // grid.tiles]
    out[i, tile] = missed(column, row, grid.stretch[0], planes[i, 0], planes[i, 1], planes[i, 2], wp.float64(1.0e-12))
    slopes[i, tile] = slope_bounds(column, row, planes[i, 0], grid.stretch[0])


def directions(name, u, v):
    """Unit directions of places in a rectangle."""
    if name == "azimuth-elevation":
        return np.stack([np.cos(v) * np.cos(u), np.cos(v) * np.sin(u), np.sin(v)], axis=-1)
    sign = 1.0
    if name == "two-angle":
        sign = np.where(np.abs(u) > np.pi / 2, -1.0, 1.0)
        u, v = np.tan(u), np.tan(v)
    d = np.stack([np.ones_like(u), u, v], axis=-1) * np.asarray(sign)[..., None]
    return d / np.linalg.norm(d, axis=-1, keepdims=True)


@pytest.mark.parametrize("name", LIGHT_MAPS)
@pytest.mark.parametrize("tiles", [1, 2, 3, 5, 16])
def test_a_tile_left_out_holds_no_direction_of_the_triangle(name, tiles):
    random = np.random.default_rng(tiles)
    left_out = 0
    for rectangle in RECTANGLES[name]:
        low_u, high_u, low_v, high_v = rectangle
        extent = np.array([low_u, low_v, 1.0, high_u, high_v, 2.0, 0.0, 0.0])
        with wp.ScopedDevice("cpu"):
            grid = zeroed(LightTiles, tiles, tiles=tiles, stretch=1, extent=wp.array(extent), lists=TileLists())
        wp.launch(edges_kernel, tiles, [LIGHT_MAPS.index(name), grid], device="cpu")
        # Triangles about a direction in or near the rectangle, of all sizes; inward planes of their edges.
        count = 300
        u, v = random.uniform(low_u, high_u, count), random.uniform(low_v, high_v, count)
        arms = random.normal(size=(count, 3, 3)) * np.exp(random.uniform(-5, 0.5, (count, 1, 1)))
        a, b, c = np.moveaxis(directions(name, u, v)[:, None] + arms, 1, 0)
        planes = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=1)
        planes *= np.sign(np.einsum("ij,ij->i", a, np.cross(b, c)))[:, None, None]
        out, slopes = launched(tile_kernel, (count, tiles * tiles), [grid, planes], [(count, tiles * tiles)] * 2)
        left_out += out.sum()
        for tile in random.choice(tiles * tiles, min(25, tiles * tiles), replace=False):
            s, w = np.meshgrid(np.linspace(0, 1, 15), np.linspace(0, 1, 15))
            u = low_u + (high_u - low_u) * (tile % tiles + s.ravel()) / tiles
            v = low_v + (high_v - low_v) * (tile // tiles + w.ravel()) / tiles
            if name == "two-angle":  # only where both angles are in front, or both behind, is there a direction
                u, v = (x[(np.abs(u) > np.pi / 2) == (np.abs(v) > np.pi / 2)] for x in (u, v))
                u, v = (x[(np.abs(np.abs(u) - np.pi / 2) > 1e-6)] for x in (u, v))
            d = directions(name, u, v)
            values = np.einsum("npk,dk->npd", planes, d)
            inside = (values > 1e-9).all(axis=1)
            assert not inside[out[:, tile]].any(), (name, rectangle, tile)
            low, high, longest = slopes[:, tile].T
            known = longest > 0
            # n . d of the unscaled direction lies between the bounds; d is between 1 and ``longest`` long.
            size = np.linalg.norm(planes[:, 0], axis=1) * 1e-9
            top, bottom = values[:, 0].max(axis=1, initial=-9e9), values[:, 0].min(axis=1, initial=9e9)
            assert (top[known & (high > 0)] <= high[known & (high > 0)] + size[known & (high > 0)]).all()
            sure = known & (low > 0)
            assert (bottom[sure] * longest[sure] >= low[sure] - size[sure]).all()
    assert left_out > 100 * (tiles > 3)


@wp.kernel(enable_backward=False)
def verdict_kernel(
    size: wp.float32, lights: wp.array(dtype=wp.vec3f), corners: wp.array2d(dtype=wp.vec3f),
    hits: wp.array2d(dtype=wp.vec3d), verdicts: wp.array2d(dtype=wp.int32), exact: wp.array2d(dtype=wp.bool),
):  # fmt: skip
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
