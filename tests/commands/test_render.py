"""``explain`` gives the verdict that ``verify`` counts; ``render`` writes pictures, and says what cannot be written."""

import json
from dataclasses import replace

import numpy as np
import pytest
from helpers import mesh_files as files
from PIL import Image
from shadowbench.harness.commands import answering
from shadowbench.harness.commands.explain import explain
from shadowbench.harness.frame.devices import start_warp
from shadowbench.harness.judge.context import Judge
from shadowbench.harness.judge.score import score_answers
from shadowbench.harness.judge.verdict import RIGHT, Verdict
from shadowbench.harness.scene.catalogue import resolve
from shadowbench.harness.scene.prepared import prepare


def test_render_draws_what_a_method_answers(call, refused_call, scene, tmp_path):
    code, _, err = call("render", scene, "--method", "warp_bvh", "--out", tmp_path / "a.png", "--size", "48x32")
    assert code == 0
    assert "written" in err
    pixels = np.asarray(Image.open(tmp_path / "a.png"))
    assert pixels.shape[:2] == (32, 48)
    assert pixels.std() > 5
    err = refused_call("render", scene, "--method", "warp_bvh", "--out", tmp_path / "a.png", "--frame", "3")
    assert "frames 0 to 0" in err


def test_without_a_method_the_first_of_the_rivals_draws(call, refused_call, scene, tmp_path):
    pictures = [tmp_path / "a.png", tmp_path / "b.png"]
    for picture, words in zip(pictures, ([], ["--method", "ray_grids"]), strict=True):
        code, _, err = call("render", scene, *words, "--out", picture, "--size", "16x16")
        assert (code, err.count("written")) == (0, 1)
    assert pictures[0].read_bytes() == pictures[1].read_bytes()
    err = refused_call("render", scene, "--set", "embree.threads=1", "--out", pictures[0])
    assert "--set embree: ray_grids traces the picture; give --method embree" in err


def test_a_picture_of_nothing_is_drawn_with_a_warning(call, tmp_path):
    flat = tmp_path / "flat.obj"
    flat.write_text("v 0 0 0\nv 1 0 0\nv nan 1 0\nf 1 2 3\n")
    code, _, err = call("render", flat, "--method", "warp_bvh", "--out", tmp_path / "a.png", "--size", "8x8")
    assert code == 0
    assert "flat.obj: none of 1 triangle can ever be hit (no area, or a corner that is not" in err


def test_a_corner_that_is_no_number_is_noted_where_a_picture_is_drawn_too(call, tmp_path):
    for command, more in (("render", ["--out", tmp_path / "a.png"]), ("verify", [])):
        half = tmp_path / f"{command}.obj"  # a note is printed once in a process
        half.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv nan 1 0\nf 1 2 3\nf 1 2 4\n")
        code, _, err = call(command, half, *more, "--method", "uniform_grid", "--device", "cpu", "--size", "8x8")
        note = f"{half.name}: 1 triangle with a corner that is NaN or infinite, which no ray hits"
        assert (code, err.count(note)) == (0, 1)


def test_render_animates_scenes_side_by_side(call, scene, tmp_path):
    """Of a still scene the light turns; the captions of stand-ins stay."""
    code, _, err = call(
        "render", scene, "cloth", "--method", "embree", "--animate", tmp_path / "a.webp", "--size", "48x32",
        "--frames", "3",
    )  # fmt: skip
    assert (code, err.count("written")) == (0, 1)
    with Image.open(tmp_path / "a.webp") as image:
        assert (image.n_frames, image.info["loop"]) == (3, 0)
        shown = []
        for number in range(3):
            image.seek(number)
            shown.append(np.asarray(image.convert("RGB")).astype(int))
    assert shown[0].shape[0] > 32 + 20, "a caption stands below the stand-in"
    assert shown[0].shape[1] == 48 + 256
    for first, second in ((0, 1), (1, 2), (2, 0)):
        moved = np.abs(shown[first] - shown[second]).max(axis=2) > 24
        assert moved[:32, :48].any(), "the light of the still scene turned"
        assert moved[:32, 48:96].any(), "the cloth moved"


def test_an_animation_takes_as_long_as_its_file_says(call, tmp_path):
    for number in range(5):
        points = files.QUAD + (0.2 * number, 0, 0)
        files.written(tmp_path, f"w_{number}.ply", files.ply_binary(points.astype(np.float32)))
    durations = {}
    for rate in (None, "10", "5"):
        out = tmp_path / f"{rate}.webp"
        code, _, _ = call(
            "render", tmp_path / "w_%d.ply", "--method", "embree", "--animate", out, "--size", "16x16",
            *(["--rate", rate] if rate else []), "--frames", "0:4:2",
        )  # fmt: skip
        assert code == 0
        with Image.open(out) as image:
            assert image.n_frames == 3
            durations[rate] = sum(_duration(image, number) for number in range(3))
    assert durations == {None: 3999, "10": 600, "5": 1200}


def _duration(image, number) -> int:
    image.seek(number)
    image.load()
    return round(image.info["duration"])


@pytest.mark.parametrize(("arguments", "said"), [
    ([], "give --out FILE.png for a picture, or --animate FILE.webp"),
    (["--animate", "a.gif"], "animations are WebP files"),
    (["--animate", "a.webp", "--frames", "1"], "an animation has at least 2"),
    (["--animate", "a.webp", "--seconds", "nan"], "give a number between 0 and 3600"),
    (["--animate", "a.webp", "--size", "16000x16000", "--frames", "9"], "too many pixels"),
    (["cloth", "--out", "a.png"], "--out shows one scene"),
])  # fmt: skip
def test_what_render_cannot_write_is_one_line(refused_call, scene, arguments, said):
    assert said in refused_call("render", scene, *arguments, "--method", "embree")


start_warp()

WIDTH, HEIGHT = 16, 12
GRAVEST_LAST = ("edge", "invalid", "leak", "acne")


DECLARED = {
    "spots": """facing = true
        lights = [{position = [0.4, 4, 1], spot = {direction = [-0.4, -4, -1], angle = 12}},
                  {position = [2, 3, -1], shadows = false}]
    """,
    "holes": """lights = [{position = [-3, 1, 2], directional = true}]
        alpha = {every = 2, holes = 3}
    """,
    "mirrors": """facing = true
        lights = [{position = [2, 3, -1], spot = {direction = [-2, -3, 1], angle = 30}}, {position = [0.2, -2, 0.1]}]
        mirror = {share = 0.8, bounces = 2}
    """,
}
"""Scenes in TOML with all that shadow rays, hits and bounces depend on."""


def spoil(answers: dict, seed: int) -> dict:
    """The answers with every tenth bit turned over, and some triangles lost or replaced."""
    random = np.random.default_rng(seed)
    spoilt = {name: value.copy() for name, value in answers.items()}
    for name in ("shadowed", "bounce_shadowed"):
        if name in spoilt:
            spoilt[name] ^= (random.random(spoilt[name].shape) < 0.1).astype(np.uint8)
    for name in ("triangle", "bounce_triangle"):
        if name in spoilt:
            spoilt[name][random.random(spoilt[name].shape) < 0.1] = 3
    return spoilt


def printed_class(row: dict, bounced: list[dict]) -> str:
    """The class of a pixel by what ``explain`` prints: that of its primary answer, else of the gravest bit, else of the
    first bounce that is wrong; "ok" for ties too.
    """
    for part in (row, *bounced):
        if part["class"] not in ("ok", "tie"):
            return part["class"]
        found = [kind for kind in GRAVEST_LAST if kind in part["shadow_classes"]]
        if found:
            return found[-1]
    return "ok"


@pytest.mark.parametrize("spoilt", [False, True])
@pytest.mark.parametrize("name", DECLARED)
def test_explain_prints_the_class_that_verify_scored(mesh, tmp_path, capsys, monkeypatch, name, spoilt):
    path, seed = tmp_path / "scene.toml", 7
    path.write_text(f'mesh = "{mesh}"\n' + DECLARED[name])
    prepared = prepare(resolve(str(path)))
    moment = prepared.moment(0, WIDTH, HEIGHT)
    outcome = answering.answer("uniform_grid", {}, prepared, moment, "cpu")
    assert outcome.answers is not None, outcome.reason
    if spoilt:
        outcome = replace(outcome, answers=spoil(outcome.answers, seed))
    judge = Judge.of(prepared, moment)
    as_verified = score_answers(judge, outcome.answers)
    every_pixel = score_answers(judge.with_random_pixels(WIDTH * HEIGHT), outcome.answers)
    random = np.random.default_rng(seed)
    wrong = np.nonzero(every_pixel.classes > Verdict.TIE)[0]
    hit = np.nonzero(outcome.answers["triangle"] >= 0)[0]
    pixels = [int(random.choice(some)) for some in (hit, wrong, wrong, wrong) if len(some)]
    pixels.append(int(random.integers(WIDTH * HEIGHT)))
    for pixel in pixels:
        x, y = pixel % WIDTH, pixel // WIDTH
        with monkeypatch.context() as patched:
            patched.setattr("shadowbench.harness.commands.explain.answer", lambda *arguments: outcome)
            code = explain(str(path), f"{x},{y}", ["uniform_grid"], "cpu", f"{WIDTH}x{HEIGHT}", as_json=True)
        facts = json.loads(capsys.readouterr().out)
        reference, row = facts["answers"]
        assert not reference["wrong"] or every_pixel.score.reference_errors.true_errors
        bounced = [one["answers"][0] for one in facts["bounces"] if one["answers"]]
        scored = Verdict(every_pixel.classes[pixel])
        assert printed_class(row, bounced) == ("ok" if scored in RIGHT else scored.key), (x, y)
        if not reference["wrong"]:  # where the reference is right, the pixels that verify decides make no difference
            assert as_verified.classes[pixel] == scored
        assert code == any(part["wrong"] for part in (row, *bounced))
