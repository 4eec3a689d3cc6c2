"""Cells of a cube (``cube/cells.py``): slots for cell and rank of a ray, whatever the numbers (``rays/sort.py``); farthest
receivers; and cells narrower where rays are dense (``cube/spacing.py``, ``cube/footprint.py``), with bounds that hold.
"""

import itertools
from typing import Any

import numpy as np
import pytest
import warp as wp
from helpers.launched import launched
from helpers.method_trials import assert_exact, lattice
from helpers.small_scenes import assert_same, make_scene, trace
from helpers.streams import lights_of_session, on_gpu_side, trial
from shadowbench.harness.frame.effects.specialise import with_type
from shadowbench.harness.frame.geometry import filled
from shadowbench.harness.frame.registry import make_method
from shadowbench.harness.frame.session import Session
from shadowbench.harness.hardcases.shapes import joined, plane, quad, triangles
from shadowbench.methods.streams.cube import spacing
from shadowbench.methods.streams.cube.cells import RayCells, SpacedCells, all_rays_end_before, raise_from, tile_index
from shadowbench.methods.streams.cube.footprint import first_cell, last_cell
from shadowbench.methods.streams.cube.rectangle import BINS, EMPTY, RANGE, RECTANGLE_WORDS, cells_in_use, face_rectangle
from shadowbench.methods.streams.cube.spacing import BIN_SLACK, INTERVALS, row_between, set_edges
from shadowbench.methods.streams.rays.sort import cell_of

CELLS = 32
SIZE = 40, 32


@pytest.mark.parametrize("region", ["triangles", "rays"])
def test_more_rays_in_a_cell_than_a_slot_has_room_for(region, device):
    """A square that nearly fills the view, in one cell of a light far away, however narrow cells are there; a surface far
    behind it, seen beside it, spans the other cells. The cell has more rays than the 8 bits of a rank beside 23 bits of a
    cell hold.
    """
    blocker = triangles((0.1, 0.1, 0.5), (0.2, 0.1, 0.5), (0.1, 0.2, 0.5))
    behind = triangles((0.0, 0.0, -2.5e5), (1.0e6, 0.0, -2.5e5), (1.0e6, 1.0e6, -2.5e5))
    mesh = joined(plane(2, 0, 1), blocker, behind)
    prepared = make_scene(*mesh, [(0.0, 0.0, 1.0e6)], (0.0, 0.0, 0.9), fov=90.0)
    session = Session(make_method("ray_grids", trial(region=region, cells=1024)), prepared, *SIZE, device)
    answers = session.answers(prepared.moment(0, *SIZE))
    (light,) = lights_of_session(session)
    bits = light.cells.bits
    most = (1 << (31 - bits)) - 1
    hit = answers["triangle"].ravel() >= 0
    ranks = (light.cells.slot.numpy()[hit] >> bits) & most
    assert (ranks == most).sum() > 100
    assert light.cells.rank.numpy()[hit].max() > most
    order = light.cells.rays.numpy()[:, 3].view(np.int32)[: hit.sum()]
    assert sorted(order) == np.flatnonzero(hit).tolist()
    assert_exact("ray_grids", trial(region=region, cells=1024), prepared, *SIZE, device)
    assert 0 < answers["shadowed"].sum() < hit.sum()


@wp.kernel(enable_backward=False)
def note_kernel(
    cells: wp.array(dtype=wp.vec3i), depths: wp.array(dtype=wp.float32), farthest: wp.array(dtype=wp.int32)
):
    i = wp.tid()
    tile = tile_index(cells[i][0], cells[i][1], cells[i][2], CELLS)
    raise_from(farthest[tile], farthest, tile, depths[i])


@wp.kernel(enable_backward=False)
def ask_kernel(
    boxes: wp.array(dtype=wp.vec4i), depths: wp.array(dtype=wp.float32), farthest: wp.array(dtype=wp.int32),
    answers: wp.array(dtype=wp.bool),
):  # fmt: skip
    i = wp.tid()
    answers[i] = all_rays_end_before(depths[i], farthest, 2, boxes[i], CELLS)


def test_a_box_is_left_out_only_where_every_tile_ends_before(device):
    random = np.random.default_rng(3)
    cells = np.stack([random.integers(1, 4, 60), *random.integers(0, CELLS, (2, 60))], axis=1)
    depths = random.uniform(1.0, 4.0, 60).astype(np.float32)
    depths[0] = np.inf
    low = random.integers(0, CELLS, (500, 2))
    boxes = np.concatenate([low, np.minimum(CELLS - 1, low + random.integers(0, 24, (500, 2)))], axis=1)
    asked = random.uniform(0.5, 4.0, 500).astype(np.float32)
    asked[:3] = (-1.0, 0.0, np.nan)
    (farthest,) = launched(note_kernel, 60, [cells, depths], [6 * (CELLS // 8) ** 2], device)
    (answers,) = launched(ask_kernel, 500, [boxes, asked, farthest], [500], device)
    tiles = np.zeros((CELLS // 8, CELLS // 8))
    on_face = cells[:, 0] == 2
    np.maximum.at(tiles, (cells[on_face, 2] // 8, cells[on_face, 1] // 8), depths[on_face])
    expected = [
        bool(depth > 0 and (tiles[b[1] // 8 : b[3] // 8 + 1, b[0] // 8 : b[2] // 8 + 1] < depth).all())
        for b, depth in zip(boxes, asked, strict=True)
    ]
    assert answers.tolist() == expected
    assert 50 < sum(expected) < 450


def floor(height: float, count: int) -> np.ndarray:
    """Triangles of a horizontal square, count x count cells of two."""
    quads = []
    for (x0, x1), (z0, z1) in itertools.product(itertools.pairwise(np.linspace(-1.0, 1.0, count + 1)), repeat=2):
        quads += [(x0, z0), (x1, z0), (x1, z1), (x0, z0), (x1, z1), (x0, z1)]
    return np.array([(x, height, z) for x, z in quads])


@on_gpu_side
def test_what_lies_below_a_floor_is_no_work():
    top = floor(0.0, 4)
    items, bits = [], []
    for more in (top[:0], floor(-0.5, 16), floor(0.5, 16) * (0.2, 1, 0.2)):
        vertices = np.concatenate([top, more])
        faces = np.arange(len(vertices)).reshape(-1, 3)
        prepared = make_scene(vertices, faces, [(0.1, 3.0, 0.2)], (0.0, 3.5, 0.3), (0.0, 0.0, 0.0), 40.0)
        session, _, answers = trace("ray_grids", trial(inline_rays=0, cells=64), prepared, 64, 64)
        items.append(session.method.counters()["light 0 items"])
        bits.append(answers["shadowed"])
    assert items[0] >= len(top) // 3
    assert items[1] < items[0] + 40 < items[2]
    assert [some.any() for some in bits] == [False, False, True]


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
