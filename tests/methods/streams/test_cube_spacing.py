"""Cells that are narrower where rays are dense: a triangle's bounds hold every ray, and no answer depends on them."""

from typing import Any

import numpy as np
import pytest
import warp as wp
from helpers.answers import assert_same, trace
from helpers.launched import launched
from helpers.lights_of_session import lights_of_session
from helpers.method_trials import lattice
from helpers.small_scenes import make_scene
from helpers.streams import trial
from shadowbench.harness.frame.effects.specialise import with_type
from shadowbench.harness.frame.geometry import filled
from shadowbench.harness.hardcases.shapes import joined, quad
from shadowbench.methods.streams.cube import spacing
from shadowbench.methods.streams.cube.cells import RayCells, SpacedCells
from shadowbench.methods.streams.cube.footprint import first_cell, last_cell
from shadowbench.methods.streams.cube.rectangle import BINS, EMPTY, RANGE, RECTANGLE_WORDS, cells_in_use, face_rectangle
from shadowbench.methods.streams.cube.spacing import BIN_SLACK, INTERVALS, row_between, set_edges
from shadowbench.methods.streams.rays.sort import cell_of

LOW, HIGH = (-0.013, 0.002), (0.007, 0.0021)
"""What rays cover of face 0, of a range of 0.02."""

SLACK, COUNT = float(BIN_SLACK), 20000


@wp.kernel(enable_backward=False)
def edges_kernel(cells: SpacedCells):
    set_edges(wp.tid(), 7, cells, cells_in_use(cells.rectangle, cells.cells))


@wp.kernel(enable_backward=False)
def place_kernel(
    places: wp.array(dtype=wp.vec4f), t: wp.array(dtype=wp.vec2f), cells: RayCells,
    found: wp.array(dtype=wp.vec2i), first: wp.array(dtype=wp.vec2i), last: wp.array(dtype=wp.vec2i),
    row: wp.array(dtype=wp.vec2f),
):  # fmt: skip
    """The cell of each ray, the bounds of a triangle that ends there, and where the ray's row begins and ends."""
    i = wp.tid()
    along = cells_in_use(cells.rectangle, cells.cells)
    p = places[i]
    face = wp.int32(p[2])
    found[i] = cell_of(p, face, face_rectangle(face, cells.rectangle), along, cells)
    for axis in range(2):
        first[i][axis] = first_cell(cells, axis, face, t[i][axis] - BIN_SLACK, along)
        last[i][axis] = last_cell(cells, axis, face, t[i][axis] + BIN_SLACK, along)
    row[i] = row_between(cells, face, found[i][1], along)


def densities(kind: str) -> np.ndarray:
    shape = (2, 6, int(INTERVALS))
    if kind == "uneven":
        return np.random.default_rng(5).uniform(0.0, 1.0, shape) ** 40
    values = np.full(shape, 0.0 if kind == "one interval" else float(kind))
    values[:, :, 20] += 1.0e6 if kind == "one interval" else 0.0
    return values


def cells_with(density: np.ndarray | None, along: int) -> Any:
    """Cells of that many along a face, of one size without a density."""
    rectangle = np.full(int(RECTANGLE_WORDS), int(EMPTY), dtype=np.int32)
    ordered = np.array([LOW[0], LOW[1], -HIGH[0], -HIGH[1]], dtype=np.float32).view(np.int32)
    rectangle[:4] = np.where(ordered < 0, ordered ^ 0x7FFFFFFF, ordered)
    rectangle[int(RANGE)] = np.float32(0.02).view(np.int32)
    of: dict[str, Any] = {"cells": wp.vec3i(along, along, 1), "rectangle": wp.array(rectangle, dtype=wp.int32)}
    if density is None:
        return filled(RayCells, **of)
    of |= spacing.spacing_arrays(wp.get_device(), along)
    of["density"] = wp.array(density.astype(np.float32).ravel(), dtype=wp.float32)
    cells = filled(SpacedCells, **of)
    wp.launch(spacing.spacing_kernel, dim=spacing.SPACING_THREADS, inputs=[], outputs=[cells])
    wp.launch(edges_kernel, dim=7, inputs=[], outputs=[cells])
    begun = cells.spacing.numpy().reshape(12, int(BINS), 2)
    assert (begun[:, :, 1] > 0.0).all()
    assert (begun[:, 0, 0] == 0.0).all()
    np.testing.assert_allclose(begun[:, :-1].sum(axis=2), begun[:, 1:, 0], atol=2e-3)
    np.testing.assert_allclose(begun[:, -1].sum(axis=1), along, rtol=1e-6)
    return cells


@pytest.mark.parametrize("along", [8, 448, 8192])
@pytest.mark.parametrize("kind", ["uneven", "one interval", "0", "1e36", "1e-39", "inf", "nan", "even"])
def test_the_bounds_of_a_triangle_hold_every_ray(kind, along, device):
    """Places in bins are given in float64, rounded once: those of rays are rounded otherwise."""
    random = np.random.default_rng(along)
    face = random.integers(0, 6, COUNT)
    low, high = (
        np.where(face == 0, np.array(side)[:, None], whole).T.astype(np.float32).astype(np.float64)
        for side, whole in ((LOW, -1.0), (HIGH, 1.0))
    )
    share = random.uniform(0.0, 1.0, (COUNT, 2)) ** random.choice([1.0, 20.0], (COUNT, 1))
    share[::7] = np.round(share[::7] * int(BINS)) / int(BINS)
    uv = np.clip((low + share * (high - low)).astype(np.float32), low.astype(np.float32), high.astype(np.float32))
    margin = 1.0e-6 * np.abs([low, high]).max(axis=(0, 2))[:, None]
    exact = (uv.astype(np.float64) - low) * int(BINS) / (high - low + margin)
    places = np.column_stack([uv, face, np.ones(COUNT)]).astype(np.float32)
    with wp.ScopedDevice(device):
        cells = cells_with(None if kind == "even" else densities(kind), along)
        kernel = place_kernel if kind == "even" else with_type(place_kernel, "cells", SpacedCells)
        cell, first, last, rows = launched(
            kernel, COUNT, [places, exact.astype(np.float32), cells], [COUNT] * 4, device
        )
    rows = rows.astype(np.float64)
    assert ((cell >= 0) & (cell < along)).all()
    assert ((first <= cell) & (cell <= last)).all()
    assert (last - first).max() <= 2 + int(2.5 * SLACK * along)
    assert ((rows[:, 0] - SLACK <= exact[:, 1]) & (exact[:, 1] <= rows[:, 1] + SLACK)).all()
    assert (rows[:, 1] - rows[:, 0] > 0.0).all()


def test_cells_are_narrow_where_the_camera_sees_closely(device):
    """A small bumpy object before the eye, in a hall a hundred times as large: its rays lie in a small part of the cube."""
    points, faces = lattice(12, 0.5)
    points[:, 2] = np.random.default_rng(11).uniform(-0.05, 0.05, len(points))
    hall = quad((-60, -60, -9), (60, -60, -9), (60, 60, -9), (-60, 60, -9))
    prepared = make_scene(
        *joined((points, faces), hall), [(3.0, 2.0, 80.0), (-20.0, 5.0, 60.0)], (0.1, 0.1, 0.9), fov=70.0
    )
    crowd, answers = {}, {}
    for kind in ("even", "rays"):
        given = trial(spacing=kind, cells=128, lights_at_once=2)
        session, _, answers[kind] = trace("ray_grids", given, prepared, 128, 128, device)
        slots = [(light.cells.slot.numpy(), (1 << light.cells.bits) - 1) for light in lights_of_session(session)]
        counts = [np.unique(slot[slot != -1] & cell, return_counts=True)[1].astype(float) for slot, cell in slots]
        crowd[kind] = max((c**2).sum() / c.sum() for c in counts)  # rays in the cell of a ray, on average
    assert_same(answers["rays"], answers["even"])
    assert crowd["rays"] < 0.5 * crowd["even"], crowd
