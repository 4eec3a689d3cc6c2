"""On a GPU the shadow rays of a tree mark the receivers themselves, and so does what maps the rays of the paper's grids: the
same as the pass of the harness, and no pass more.

The kernels that do it run on a CPU, too.
"""

import numpy as np
import pytest
import warp as wp
from helpers.answers import assert_same
from helpers.effect_scenes import BEHIND, POINT, SPOT, all_mirrors, scene, session_or_skip
from shadowbench.harness.frame.registry import make_method
from shadowbench.harness.frame.session import Session
from shadowbench.harness.scene.scene import Light, Spot
from shadowbench.methods.perspective_spherical.light import placement
from shadowbench.methods.trees.trace import tree_rays

SIZE = 96, 64
METHODS = [
    ("bvh2", {}),
    ("bvh2", {"precision": "float32"}),
    ("hybrid", {"shadows": "tree"}),
    ("perspective_spherical", {}),
    ("perspective_spherical", {"clamp": "scene", "light_map": "cube"}),
    ("perspective_spherical", {"sort": "radix", "triangle_chunk": "3"}),
]
AWAY = Light((0.0, 5.0, 0.0), spot=Spot((0.0, 1.0, 0.0), 10.0))
SCENES = {
    "spots": {"lights": (SPOT, BEHIND, AWAY)},
    "facing": {"lights": (POINT, BEHIND), "facing": True},
    "facing spots": {"lights": (SPOT, BEHIND), "facing": True},
    "mirrored": {"lights": (SPOT, POINT), "mirror": all_mirrors, "bounces": 1},
}


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize(("method", "settings"), METHODS, ids=str)
def test_a_method_marks_the_receivers_that_the_harness_marks(method, settings, name, device, monkeypatch):
    prepared = scene(**SCENES[name])
    moment = prepared.moment(0, *SIZE)
    monkeypatch.setattr(tree_rays, "marks_receivers", lambda cuda, effects: True)
    monkeypatch.setattr(placement, "marks_receivers", lambda cuda: True)
    marked = session_or_skip(method, settings, prepared, device, SIZE)
    by_harness = Session(make_method("uniform_grid", {}), prepared, *SIZE, device)
    wanted, found = by_harness.answers(moment), marked.answers(moment)
    np.testing.assert_array_equal(marked.frame.receivers.numpy(), by_harness.frame.receivers.numpy())
    assert 0 < marked.frame.receivers.numpy()[0].sum() < (wanted["triangle"] >= 0).sum()
    if settings.get("precision") != "float32":
        assert_same(found, wanted)
    passes = [work.name for work in marked.all_passes]
    assert "light 0: receivers" not in passes
    assert not [work.name for work in marked.all_passes if work.only_if is not None and "bounce" not in work.name]


@pytest.mark.skipif(wp.is_cuda_available(), reason="a GPU has no pass for receivers")
@pytest.mark.parametrize(("method", "settings"), METHODS, ids=str)
def test_on_a_cpu_a_light_that_reaches_nothing_is_left_out(method, settings):
    session = Session(make_method(method, settings), scene((AWAY, POINT)), *SIZE, "cpu")
    conditional = [work.name for work in session.all_passes if work.only_if is not None]
    assert [name for name in conditional if name.startswith("light 0: shadow rays")]
