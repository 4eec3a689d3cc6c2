"""Frames in which only the light or the camera moves: what is traced in one launch with the eye's rays is traced alone."""

import numpy as np
import pytest
import warp as wp
from helpers.brute_force import make_scene, soup
from shadowbench.harness.frame.registry import make_method
from shadowbench.harness.frame.schedule.needed import stale
from shadowbench.harness.frame.session import Session
from shadowbench.harness.scene.scene import Camera, Light

SIZE = 33, 21


@pytest.mark.parametrize("settings", [{"update": "static"}, {"precision": "float32"}], ids=str)
def test_only_what_moved_is_traced_again(settings, device):
    prepared = make_scene(*soup(7, 300), [(5.0, 4.0, 3.0)])
    light = (Light((3.0, 4.0, 5.0)),)
    camera = Camera((0.2, 0.4, 3.0), prepared.scene.camera.target)
    moments = {
        "light/0": prepared.moment(0, *SIZE, lights=light),
        "camera": prepared.moment(0, *SIZE, lights=light, camera=camera),
    }
    session, whole = (Session(make_method("bvh2", settings), prepared, *SIZE, device) for _ in range(2))
    assert (session.method._rays.joint == 0) == wp.get_device(device).is_cuda
    first = session.answers(prepared.moment(0, *SIZE))
    for changed, moment in moments.items():
        again = [work.name for work in stale(session.all_passes, {changed})]
        assert any("primary rays" in name for name in again) == (changed == "camera"), again
        assert session.advance(moment) == {changed}
        found, wanted = session.frame.answers.to_host(), whole.answers(moment)
        for name, values in wanted.items():
            np.testing.assert_array_equal(found[name], values, err_msg=f"{changed}: {name}")
    assert (first["shadowed"] != wanted["shadowed"]).any()
    assert (first["triangle"] != wanted["triangle"]).any()
