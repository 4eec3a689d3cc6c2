"""Shading: the kernel against the rule written out in numpy, spots and mirrors in pictures, and nothing unless asked."""

import dataclasses

import numpy as np
import pytest
from helpers.method_trials import box
from helpers.mirror_scenes import FLOATING, seen_from_within, with_mirrors
from helpers.small_scenes import assert_same, make_scene, trace
from PIL import Image
from shadowbench.harness.commands import render as render_command
from shadowbench.harness.frame.effects.shading import AMBIENT, HEADLIGHT, REFLECTANCE, SKY_BOTTOM, SKY_TOP, shaded
from shadowbench.harness.frame.materials import reflectances
from shadowbench.harness.frame.registry import make_method
from shadowbench.harness.frame.session import Session
from shadowbench.harness.judge.receivers import in_spot
from shadowbench.harness.report.picture import display, shade
from shadowbench.harness.scene import chosen_view
from shadowbench.harness.scene.prepared import Prepared, prepare
from shadowbench.harness.scene.scene import Light, Spot
from shadowbench.harness.scene.spotlight import spot_row

SIZE = 24
LIGHTS = (
    Light((0.3, 0.5, 0.4), color=(1.0, 0.5, 0.3), intensity=2.0),
    Light((-0.4, 0.6, 0.2), color=(0.3, 0.5, 1.0), spot=Spot((0.2, -1.0, 0.1), 50.0, falloff=3.0)),
    Light((1.0, 2.0, 0.5), directional=True, intensity=0.5),
    Light((0.1, 0.1, 0.7), shadows=False, color=(0.2, 1.0, 0.2)),
)


def room(bounces: int = 2, lights=LIGHTS, outputs=("shadows", "color")) -> Prepared:
    """An open box, half of its walls mirrors, seen from within, with triangles floating in it."""
    walls, sides = box(2)
    prepared = seen_from_within((walls, sides[16:]), list(lights))
    number = np.arange(len(prepared.faces))
    mirror = (number % 4 < 2) & (number < len(number) - FLOATING)
    return with_mirrors(prepared, mirror.astype(np.uint8), bounces, outputs=outputs)


def traced(prepared: Prepared, device: str = "cpu"):
    return trace("uniform_grid", {}, prepared, SIZE, SIZE, device)


def unit(vectors):
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-300)


def by_hand(prepared, moment, answers, lights) -> np.ndarray:
    """The rule of the module in numpy, pixel by pixel and bounce by bounce. float64 [pixels, 3]"""
    pixels = np.arange(SIZE * SIZE)
    share = (pixels // SIZE / (SIZE - 1))[:, None]
    top, bottom = np.array(SKY_TOP), np.array(SKY_BOTTOM)
    seen = surface(
        prepared, moment, lights, np.broadcast_to(moment.eye, (len(pixels), 3)), moment.directions(pixels), answers,
        top * (1 - share) + bottom * share,
    )  # fmt: skip
    result, weight = np.zeros_like(seen), np.ones((len(pixels), 1))
    going = np.ones(len(pixels), dtype=bool)
    for b in range(len(answers["bounce_active"])):
        going &= answers["bounce_active"][b] == 1
        met = {name: answers[f"bounce_{name}"][b] for name in ("triangle", "t", "shadowed")}
        ways = answers["bounce_direction"][b].astype(np.float64)
        share = (0.5 * (1 - unit(ways) @ np.array(prepared.scene.camera.up)))[:, None]
        onward = surface(
            prepared, moment, lights, answers["bounce_origin"][b], ways, met, top * (1 - share) + bottom * share
        )
        mix = float(REFLECTANCE)
        result[going] += (seen * weight * (1 - mix))[going]
        weight[going] *= mix
        seen = np.where(going[:, None], onward, seen)
    return result + seen * weight


def surface(prepared, moment, lights, origins, ways, answers, sky):
    """What each pixel's ray meets, lit; ``sky`` where it meets nothing."""
    result = sky.copy()
    hit = np.nonzero(answers["triangle"] >= 0)[0]
    ways = np.asarray(ways, dtype=np.float64)[hit]
    place = np.asarray(origins, dtype=np.float64)[hit] + ways * answers["t"][hit, None].astype(np.float64)
    a, b, c = np.moveaxis(moment.points[prepared.faces[answers["triangle"][hit]]].astype(np.float64), 1, 0)
    normal = unit(np.cross(b - a, c - a))
    facing = -(normal * unit(ways)).sum(axis=1)
    normal[facing < 0] *= -1
    up = np.array(prepared.scene.camera.up)
    grey = float(AMBIENT) * (0.72 + 0.28 * normal @ up) + float(HEADLIGHT) * np.abs(facing)
    total = grey[:, None] * [0.96, 0.99, 1.04]
    most = sum(light.intensity * max(light.color) for light in lights)
    for i, light in enumerate(lights):
        toward = moment.lights[i].astype(np.float64) - place
        cosine = np.maximum((normal * unit(toward)).sum(axis=1), 0.0)
        if light.shadows:
            cosine[answers["shadowed"][i, hit] != 0] = 0.0
        if light.spot:
            row = spot_row(light.spot)
            along = -unit(toward) @ row[1:4]
            cosine *= in_spot(row, -toward) * np.maximum(along, 0.0) ** light.spot.falloff
        total += cosine[:, None] * np.array(light.color) * light.intensity / most
    result[hit] = total * reflectances(prepared)[answers["triangle"][hit]]
    return result


@pytest.mark.parametrize("bounces", [1, 3])
def test_the_kernel_is_the_rule(device, bounces):
    prepared = room(bounces)
    session, moment, answers = traced(prepared, device)
    color = session.frame.color.numpy()
    assert color.shape == (SIZE * SIZE, 3)
    assert answers["bounce_active"].any(axis=1).all()
    assert answers["shadowed"].any(axis=1)[:3].all()
    np.testing.assert_allclose(color, by_hand(prepared, moment, answers, LIGHTS), rtol=1e-5, atol=1e-6)


def test_a_picture_is_the_frame_s_colour_displayed():
    prepared = room()
    session, moment, answers = traced(prepared)
    color = session.frame.color.numpy()
    for block in (SIZE * SIZE, 100):
        colours = shaded(prepared, moment, answers, LIGHTS)
        parts = [colours(at, min(block, SIZE * SIZE - at)).copy() for at in range(0, SIZE * SIZE, block)]
        np.testing.assert_allclose(np.concatenate(parts), color, rtol=1e-6)
    shown = display(color.astype(np.float64)).reshape(SIZE, SIZE, 3)
    np.testing.assert_array_equal(shade(prepared, moment, answers, LIGHTS), shown)


def test_colour_is_one_pass_more_and_nothing_where_nobody_asks():
    plain, colored = (
        Session(make_method("uniform_grid"), room(1, outputs=outputs), SIZE, SIZE, "cpu")
        for outputs in (("shadows",), ("shadows", "color"))
    )
    names = [work.name for work in plain.all_passes]
    assert [work.name for work in colored.all_passes] == [*names, "shade"]
    assert [work.name for work in colored.all_passes if work.effect == "color"] == ["shade"]
    assert plain.frame.color.size == plain.frame.tint.size == plain.frame.lamps.size == 0
    moment = room(1).moment(0, SIZE, SIZE)
    expected, got = plain.answers(moment), colored.answers(moment)
    assert_same(got, expected)


def test_a_moved_light_is_shaded_anew():
    prepared = room(1)
    session, moment, _ = traced(prepared)
    lights = (LIGHTS[0].moved((0.2, 0.4, 0.1)), *LIGHTS[1:])
    after = prepared.moment(0, SIZE, SIZE, lights=lights)
    before = session.frame.color.numpy().copy()
    session.select(set())
    assert not session.passes
    session.advance(after)
    fresh = Session(make_method("uniform_grid"), prepared, SIZE, SIZE, "cpu")
    fresh.answers(after)
    np.testing.assert_array_equal(session.frame.color.numpy(), fresh.frame.color.numpy())
    assert (session.frame.color.numpy() != before).any()
    assert moment is not after


def test_render_shows_mirrors_where_a_scene_declares_them(tmp_path, monkeypatch):
    pictures = []
    for bounces in (0, 2):
        monkeypatch.setattr(chosen_view, "resolve", lambda *_, bounces=bounces: room(bounces).scene)
        path = tmp_path / f"{bounces}.png"
        render_command.render(["room"], "uniform_grid", path, size="48x48", device="cpu")
        with Image.open(path) as image:
            pictures.append(np.asarray(image.convert("RGB")).astype(int)[:48])
    assert (np.abs(pictures[0] - pictures[1]).max(axis=2) > 8).mean() > 0.2


def test_an_empty_frame_has_the_colour_of_the_sky():
    empty = make_scene(np.zeros((0, 3)), np.zeros((0, 3)), [Light((1.0, 1.0, 1.0))])
    scene = dataclasses.replace(empty.scene, outputs=("color",))
    session, _, _ = traced(prepare(scene))
    rows = session.frame.color.numpy().reshape(SIZE, SIZE, 3)
    np.testing.assert_allclose(rows[0], np.broadcast_to(SKY_TOP, (SIZE, 3)), rtol=1e-6)
    np.testing.assert_allclose(rows[-1], np.broadcast_to(SKY_BOTTOM, (SIZE, 3)), rtol=1e-6)
    shown = display(np.array([SKY_TOP, SKY_BOTTOM], dtype=np.float64))
    np.testing.assert_allclose(shown / 255, [[0.80, 0.86, 0.93], [0.96, 0.97, 0.98]], atol=1 / 255)
