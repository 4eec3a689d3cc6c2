"""What the rays cover of a cube aimed at the scene (``cube/lights.py``): which faces are in use, and how many cells
these have; no answer depends on it.
"""

import itertools

import numpy as np
import pytest
import warp as wp
from helpers.exact_answers import assert_right, exact_answers
from helpers.launched import launched
from helpers.small_scenes import make_scene, soup
from helpers.streams import lights_of_session, trial
from shadowbench.harness.frame.registry import make_method
from shadowbench.harness.frame.session import Session
from shadowbench.methods.streams import settings
from shadowbench.methods.streams.cube.cells import FACES
from shadowbench.methods.streams.cube.rectangle import EMPTY, FACE, RECTANGLE_WORDS, cells_in_use, face_in_use

FACES, FACE = int(FACES), int(FACE)
MANY, FEW = 64, 128


@wp.kernel(enable_backward=False)
def faces_kernel(
    rectangles: wp.array2d(dtype=wp.int32), cells: wp.vec3i, found: wp.array2d(dtype=wp.int32),
    along: wp.array(dtype=wp.int32),
):  # fmt: skip
    i, number = wp.tid()
    found[i, number] = face_in_use(rectangles[i], number)
    along[i] = cells_in_use(rectangles[i], cells)


@pytest.mark.parametrize("most", range(1, FACES + 1))
def test_faces_with_rays_are_numbered_and_few_of_them_have_more_cells(most, device):
    used = np.array(list(itertools.product((False, True), repeat=FACES)))
    rectangles = np.zeros((len(used), int(RECTANGLE_WORDS)), dtype=np.int32)
    rectangles[:, FACE : FACE + FACES] = np.where(used, 0, int(EMPTY))
    shape = len(used), FACES + 1
    inputs = [rectangles, wp.vec3i(MANY, FEW, most)]
    found, along = launched(faces_kernel, shape, inputs, [shape, len(used)], device)
    for row, numbered, cells in zip(used, found, along, strict=True):
        faces = np.flatnonzero(row).tolist()
        assert numbered.tolist() == faces + [-1] * (FACES + 1 - len(faces))
        # The first face counts whether it holds rays or not: where only it may hold them, no other has a place.
        assert cells == (FEW if len(faces) - row[0] < most else MANY)


@pytest.mark.parametrize("most", range(1, FACES + 1))
def test_answers_do_not_depend_on_how_many_faces_are_few(most, device, monkeypatch):
    """A light in the middle of a soup, at its sides, and outside: rays lie on one to six faces."""
    monkeypatch.setattr(settings, "_cells", lambda *_: (MANY, FEW, most))
    vertices, faces = soup(5, 150, size=0.4)
    lights = [(0.05, 0.1, 0.0), (0.9, 0.1, 0.2), (1.3, 1.1, 0.4), (1.5, 1.5, 1.5), (8.0, 5.0, 3.0)]
    prepared = make_scene(vertices, faces, lights)
    session = Session(make_method("ray_grids", trial(lights_at_once=2)), prepared, 61, 47, device)
    moment = prepared.moment(0, 61, 47)
    assert_right(session.answers(moment), exact_answers(prepared, moment))
    lights_of_frame = lights_of_session(session)[0].lights
    used = (lights_of_frame.rectangle.numpy()[:, FACE : FACE + FACES] == 0).sum(axis=1).tolist()
    assert {1, 6} <= set(used)
    assert len(set(used)) >= 4
