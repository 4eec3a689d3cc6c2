"""Spotlights: one rule for which hit points receive a light (``effects/receivers.py``), and the paper's method keeps
to it under every knob.
"""

import numpy as np
import pytest
from helpers.exact_answers import exact_answers
from helpers.paper_knobs import answers_of, drawn
from helpers.small_scenes import make_scene, soup
from shadowbench.harness.errors import UserError
from shadowbench.harness.judge.receivers import in_spot
from shadowbench.harness.scene.scene import Light, Spot
from shadowbench.harness.scene.spotlight import spot_row
from shadowbench.methods.perspective_spherical.parameters import LIGHT_MAPS


def spotted(spot, light=(0.0, 3.0, 0.0)):
    vertices, faces = soup(40, 120, size=0.5)
    return make_scene(vertices, faces, [Light(light, spot=spot), Light((3.0, 3.0, 3.0))])


SPOTS = {
    "narrow cone": (Spot((-0.2, -1.0, -0.4), 12.0), (0.4, 2.5, 1.2)),
    "wide cone": (Spot((-0.2, -1.0, -0.4), 70.0), (0.1, 0.2, 0.9)),
    "more than half": (Spot((0.3, 1.0, 0.1), 130.0), (0.1, 0.2, 0.9)),
    "rectangle": (Spot((-0.2, -1.0, -0.4), 25.0, rise=8.0, up=(0.0, 0.0, 1.0)), (0.4, 2.5, 1.2)),
    "behind the seam": (Spot((-1.0, -0.4, -0.3), 40.0, rise=30.0), (1.6, 0.5, 0.9)),
}


@pytest.mark.parametrize("name", SPOTS)
def test_only_what_the_spot_holds_has_a_shadow(name, device):
    prepared = spotted(*SPOTS[name])
    random = np.random.default_rng(len(name))
    moment = prepared.moment(0, 47, 33)
    exact = exact_answers(prepared, moment)
    hit = exact["triangle"] >= 0
    pixels = np.arange(47 * 33)
    points = moment.eye + moment.directions(pixels).astype(np.float64) * np.where(hit, exact["t"], 0)[:, None]
    held = in_spot(moment.spots[0], points - moment.lights[0].astype(np.float64)) & hit
    bits, others = exact["shadowed"]
    assert 0 < (bits & held).sum() < bits.sum()
    for light_map in LIGHT_MAPS:
        settings = drawn(random, light_map=light_map)
        session, _, got = answers_of(prepared, 47, 33, settings, device)
        assert (got["shadowed"][0] == (bits & held)).all(), settings
        assert (got["shadowed"][1] == others).all()
        assert session.method.counters()["light 0 rays"] == held.sum()


def test_the_spot_rule_agrees_with_angles():
    spot = Spot((0.0, 0.0, -2.0), 30.0, rise=10.0)
    for azimuth, elevation, inside in ((29, 9, 1), (-29, -9, 1), (31, 0, 0), (0, 11, 0), (0, -11, 0), (180, 0, 0)):
        a, e = np.radians(azimuth), np.radians(elevation)
        way = np.array([[np.cos(e) * np.sin(a), np.sin(e), -np.cos(e) * np.cos(a)]]) * 3.0
        assert in_spot(spot_row(spot), way)[0] == bool(inside), (azimuth, elevation)


@pytest.mark.parametrize("spot", [Spot((0, 0, 0), 20.0), Spot((0, 1, 0), 0.0), Spot((0, 1, 0), 20.0, rise=10.0)])
def test_spots_that_make_no_sense_are_named(spot):
    with pytest.raises(UserError, match="spot: "):
        spotted(spot).moment(0, 4, 4)
