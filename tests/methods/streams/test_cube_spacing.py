"""Cells that are narrower where rays are dense: a triangle's bounds hold every ray, and no answer depends on them."""

from typing import Any

import numpy as np
import pytest
import warp as wp
from helpers.brute_force import closest, make_scene, shadowed, soup
from helpers.lights_of_session import lights_of_session
from helpers.streams import trial
from shadowbench.harness.frame.effects.specialise import with_type
from shadowbench.harness.frame.geometry import filled
from shadowbench.harness.frame.registry import make_method
from shadowbench.harness.frame.session import Session
from shadowbench.methods.streams.cube.cells import RayCells, SpacedCells
from shadowbench.methods.streams.cube.density import INTERVALS, SPACING_THREADS, spacing_kernel
from shadowbench.methods.streams.cube.footprint import first_cell, last_cell
from shadowbench.methods.streams.cube.rectangle import EMPTY, RANGE, RECTANGLE_WORDS, cells_in_use, face_rectangle
from shadowbench.methods.streams.cube.spacing import BIN_SLACK, BINS, row_between, set_edges
from shadowbench.methods.streams.rays.sort import cell_of

LOW, HIGH = (-0.013, 0.002), (0.007, 0.0021)
"""What rays cover of face 0, of a range of 0.02."""

SLACK = float(BIN_SLACK)


@wp.kernel(enable_backward=False)
def edges_kernel(cells: SpacedCells):
    set_edges(wp.tid(), 7, cells, cells_in_use(cells.rectangle, cells.cells))


@wp.kernel(enable_backward=False)
def place_kernel(
    places: wp.array(dtype=wp.vec4f),
    t: wp.array(dtype=wp.vec2f),
    cells: RayCells,
    found: wp.array(dtype=wp.vec2i),
    first: wp.array(dtype=wp.vec2i),
    last: wp.array(dtype=wp.vec2i),
    row: wp.array(dtype=wp.vec2f),
):
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
    random = np.random.default_rng(5)
    shape = (2, 6, int(INTERVALS))
    if kind == "one interval":
        values = np.zeros(shape)
        values[:, :, 20] = 1.0e6
    elif kind == "none":
        values = np.zeros(shape)
    elif kind in ("1e36", "1e-39", "inf", "nan"):
        values = np.full(shape, float(kind))
    else:
        values = random.uniform(0.0, 1.0, shape) ** 40
    return values.astype(np.float32).ravel()


@pytest.mark.parametrize("along", [8, 64, 448, 1024, 8192])
@pytest.mark.parametrize("kind", ["uneven", "one interval", "none", "1e36", "1e-39", "inf", "nan", "even"])
def test_the_bounds_of_a_triangle_hold_every_ray(kind, along, device):
    """Places in bins are given in float64, rounded once: those of rays are rounded otherwise."""
    random = np.random.default_rng(along)
    rectangle = np.full(int(RECTANGLE_WORDS), int(EMPTY), dtype=np.int32)
    ordered = np.array([LOW[0], LOW[1], -HIGH[0], -HIGH[1]], dtype=np.float32).view(np.int32)
    rectangle[:4] = np.where(ordered < 0, ordered ^ 0x7FFFFFFF, ordered)
    rectangle[int(RANGE)] = np.float32(0.02).view(np.int32)
    of: dict[str, Any] = {"cells": wp.vec3i(along, along, 1)}
    with wp.ScopedDevice(device):
        of["rectangle"] = wp.array(rectangle, dtype=wp.int32)
        if kind != "even":
            of["density"] = wp.array(densities(kind), dtype=wp.float32)
            of["spacing"] = wp.zeros(SPACING_THREADS, dtype=wp.vec2f)
            of["edges"] = wp.zeros(6 * along, dtype=wp.vec2f)
        cells = filled(RayCells if kind == "even" else SpacedCells, **of)
        kernel = place_kernel
        if kind != "even":
            wp.launch(spacing_kernel, dim=SPACING_THREADS, inputs=[], outputs=[cells])
            wp.launch(edges_kernel, dim=7, inputs=[], outputs=[cells])
            kernel = with_type(place_kernel, "cells", SpacedCells)
            widths = cells.spacing.numpy()
            assert (widths[:, 1] > 0.0).all()
            begun = widths.reshape(12, int(BINS), 2)
            np.testing.assert_allclose(begun[:, :-1].sum(axis=2), begun[:, 1:, 0], atol=2e-3)
            assert (begun[:, 0, 0] == 0.0).all()
            np.testing.assert_allclose(begun[:, -1].sum(axis=1), along, rtol=1e-6)
        n = 20000
        face = random.integers(0, 6, n)
        low = np.where(face == 0, np.array(LOW)[:, None], -1.0).T.astype(np.float32).astype(np.float64)
        high = np.where(face == 0, np.array(HIGH)[:, None], 1.0).T.astype(np.float32).astype(np.float64)
        share = random.uniform(0.0, 1.0, (n, 2)) ** random.choice([1.0, 20.0], (n, 1))
        share[::7] = np.round(share[::7] * int(BINS)) / int(BINS)
        uv = (low + share * (high - low)).astype(np.float32)
        uv = np.clip(uv, low.astype(np.float32), high.astype(np.float32))
        margin = 1.0e-6 * np.abs([low, high]).max(axis=(0, 2))[:, None]
        exact = (uv.astype(np.float64) - low) * int(BINS) / (high - low + margin)
        places = np.column_stack([uv, face, np.ones(n)]).astype(np.float32)
        found, first, last = (wp.zeros(n, dtype=wp.vec2i) for _ in range(3))
        row = wp.zeros(n, dtype=wp.vec2f)
        given = [wp.array(places, dtype=wp.vec4f), wp.array(exact.astype(np.float32), dtype=wp.vec2f), cells]
        wp.launch(kernel, dim=n, inputs=given, outputs=[found, first, last, row])
    cell, row = found.numpy(), row.numpy().astype(np.float64)
    assert (cell >= 0).all()
    assert (cell < along).all()
    assert (first.numpy() <= cell).all()
    assert (cell <= last.numpy()).all()
    assert (last.numpy() - first.numpy()).max() <= 2 + int(2.5 * SLACK * along)
    assert (row[:, 0] - SLACK <= exact[:, 1]).all()
    assert (exact[:, 1] <= row[:, 1] + SLACK).all()
    assert (row[:, 1] - row[:, 0] > 0.0).all()


@pytest.mark.parametrize("region", ["triangles", "rays"])
def test_cells_are_narrow_where_the_camera_sees_closely(region, device):
    """A small bumpy object before the eye, in a hall a hundred times as large: its rays lie in a small part of the cube."""
    random = np.random.default_rng(11)
    x, y = np.meshgrid(np.linspace(-0.5, 0.5, 13), np.linspace(-0.5, 0.5, 13))
    points = np.stack([x, y, random.uniform(-0.05, 0.05, x.shape)], axis=2).reshape(-1, 3)
    corner = np.arange(12 * 13).reshape(12, 13)[:, :-1].reshape(-1)
    faces = np.concatenate([corner[:, None] + (0, 1, 13), corner[:, None] + (1, 14, 13)])
    hall = np.array([(-60.0, -60.0, -9.0), (60.0, -60.0, -9.0), (60.0, 60.0, -9.0), (-60.0, 60.0, -9.0)])
    vertices = np.concatenate([points, hall])
    faces = np.concatenate([faces, 169 + np.array([(0, 1, 2), (0, 2, 3)])])
    prepared = make_scene(vertices, faces, [(3.0, 2.0, 80.0), (-20.0, 5.0, 60.0)], (0.1, 0.1, 0.9), fov=70.0)
    moment = prepared.moment(0, 128, 128)
    crowd, answers = {}, {}
    for spacing in ("even", "rays"):
        given = trial(region=region, spacing=spacing, cells=128, lights_at_once=2)
        session = Session(make_method("ray_grids", given), prepared, 128, 128, device)
        answers[spacing] = session.answers(moment)
        rays = [light.cells for light in lights_of_session(session)]
        slots = [(of.slot.numpy(), (1 << of.bits) - 1) for of in rays]
        inside = [slot[slot != -1] & cell for slot, cell in slots]
        counts = [np.unique(cell, return_counts=True)[1].astype(float) for cell in inside]
        crowd[spacing] = max((c**2).sum() / c.sum() for c in counts)  # rays in the cell of a ray, on average
    for name in answers["even"]:
        np.testing.assert_array_equal(answers["even"][name], answers["rays"][name])
    assert crowd["rays"] < 0.5 * crowd["even"], crowd


@pytest.mark.parametrize("region", ["triangles", "rays"])
@pytest.mark.parametrize("groups", ["stream", "split"])
def test_answers_do_not_depend_on_the_spacing(region, groups, device):
    """Lights in the middle of a soup, at its sides, far outside, and next to a triangle."""
    vertices, faces = soup(8, 180, size=0.4)
    lights = [(0.05, 0.1, 0.0), (0.9, 0.1, 0.2), (1.5, 1.5, 1.5), (8.0, 5.0, 3.0), (3.0e6, -2.0e6, 1.0e6)]
    prepared = make_scene(vertices, faces, lights)
    given = trial(region=region, groups=groups, spacing="rays", lights_at_once=2)
    session = Session(make_method("ray_grids", given), prepared, 67, 45, device)
    moment = prepared.moment(0, 67, 45)
    got = session.answers(moment)
    assert all(light.spaced for light in lights_of_session(session))
    best, t = closest(prepared, moment)
    assert (got["triangle"] == best).all()
    for light in range(len(lights)):
        assert (got["shadowed"][light] == shadowed(prepared, moment, light, best, t)).all(), light
