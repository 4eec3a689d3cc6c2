"""Small files that were once read wrongly without a word: triangles and bounds of each, or the line that refuses it.

They lie in ``shared/cases`` beside the checkout. Files of each kind that the tests write themselves are in the tests of its
format.
"""

from pathlib import Path

import numpy as np
import pytest
from helpers.mesh_files import refused
from helpers.usd_stages import bounds, needs_usd
from shadowbench.harness.scene.catalogue import resolve
from shadowbench.harness.scene.readers import apart
from shadowbench.harness.scene.readers.load import load

CASES = Path(__file__).resolve().parents[3] / "shared" / "cases"

pytestmark = pytest.mark.skipif(not CASES.is_dir(), reason="no shared/cases beside the checkout")

FLAT = [[0, 0, 0], [1, 1, 0]]
PLY = [[0, 0, 0], [2, 3, 1]]
READ = {
    "usd_xform_samples.usda": (2, [[0, 0, 0], [6, 1, 0]]),
    "usd_xform_samples_parent.usda": (2, [[0, 0, 0], [3, 3, 10]]),
    "usd_point_instancer.usda": (3, [[10, 0, 0], [31, 1, 0]]),
    "usd_gprims.usda": (1 + 12 + 960, [[-1, -1, -1], [9, 9, 1]]),
    "usd_stale_reference/root.usda": (4, [[0, 0, 0], [4, 1, 4]]),
    "usd_moving_points.usda": (1, FLAT),
    "glb_gpu_instancing.glb": (6, [[0, 0, 0], [11, 1, 0]]),
    "glb_morph_default_weight.glb": (2, [[0, 0, 0], [1, 1, 3]]),
    "glb_sparse_morph_target.glb": (2, FLAT),
    "glb_sparse_positions.glb": (2, [[0, 0, 0], [1, 1, 2]]),
    "glb_quantised.glb": (2, FLAT),
    "glb_trailing.glb": (2, FLAT),
    "glb_animation.glb": (2, FLAT),
    "obj_concave.obj": (6, [[0, 0, 0], [4, 3, 0]]),
    "ply_concave.ply": (4, [[0, 0, 0], [4, 4, 0]]),
    "obj_mixed_cr.obj": (2, [[0, 0, 0], [6, 1, 0]]),
    "obj_comment_backslash.obj": (1, FLAT),
    "obj_comment_backslash2.obj": (3, [[0, 0, 0], [4, 8, 0]]),
    "obj_inline_comment.obj": (2, FLAT),
    "obj_utf16.obj": (1, FLAT),
    "ply_comment_nel.ply": (2, PLY),
    "ply_comment_end_header.ply": (2, PLY),
    "ply_unknown_header_line.ply": (1, FLAT),
    "ply_tristrip.ply": (3, [[0, 0, 0], [1, 2, 0.5]]),
    "stl_noend.stl": (2, FLAT),
    "stl_double_solid.stl": (2, FLAT),
    "stl_bin_trailing.stl": (2, FLAT),
}
REFUSED = {
    "usd_missing_reference.usda": "Could not open asset not_there.usda",
    "usd_two_corner_face.usda": "face 1 has 2 vertices",
    "ply_extra_row_tokens.ply": "the number of values in row 0 (from 0) of 'face', 7",
    "ply_degenerate_face.ply": "face 2 has 2 vertices",
    "crash/damaged.usdz": "its reader ended by SIG",
    "crash/references_of_references.usda": "to read; make it smaller",
}


def cases(table):
    return [pytest.param(name, marks=needs_usd if ".usd" in name else ()) for name in table]


@pytest.mark.parametrize("name", cases(READ))
def test_triangles_and_bounds(name):
    loaded = load(CASES / name)
    triangles, right = READ[name]
    assert (len(loaded.faces), bounds(loaded)) == (triangles, right)
    if "concave" in name:
        a, b, c = loaded.frames[0][loaded.faces].transpose(1, 0, 2)
        area = np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2
        assert area == pytest.approx(8 if name == "obj_concave.obj" else 7)


@pytest.mark.parametrize("name", cases(REFUSED))
def test_refused_in_one_line(monkeypatch, name):
    monkeypatch.setenv(apart.TIME, "1" if "references_of" in name else "9")
    refused(CASES / name, REFUSED[name], read=resolve)


MOVING = {"usd_moving_points.usda": (3, 2), "usd_xform_samples_parent.usda": (2, 20), "glb_animation.glb": (25, 4)}


@pytest.mark.parametrize("name", cases(MOVING))
def test_moving_files_move(name):
    loaded = load(CASES / name)
    assert (len(loaded.frames), bounds(loaded, -1)[1][2]) == MOVING[name]


@pytest.mark.parametrize("name", ["obj_stray_degenerate.obj", "far_marker.obj"])
def test_what_hardly_shows_does_not_set_the_camera(name):
    """A triangle without area 10^9 away, and a marker at the origin far from all others."""
    scene = resolve(CASES / name)
    seen = np.linalg.norm(np.subtract(scene.camera.eye, scene.camera.target))
    assert seen < 1000
    assert ("too far from the others" in scene.source.left_out) == (name == "far_marker.obj")
