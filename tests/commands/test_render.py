"""``shadowbench render``: pictures and animations, and one line for what cannot be written."""

import numpy as np
import pytest
from helpers import mesh_files as files
from PIL import Image


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


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ([], "give --out FILE.png for a picture, or --animate FILE.webp"),
        (["--animate", "a.gif"], "animations are WebP files"),
        (["--animate", "a.webp", "--frames", "1"], "an animation has at least 2"),
        (["--animate", "a.webp", "--seconds", "nan"], "give a number between 0 and 3600"),
        (["--animate", "a.webp", "--size", "16000x16000", "--frames", "9"], "too many pixels"),
        (["cloth", "--out", "a.png"], "--out shows one scene"),
    ],
)
def test_what_render_cannot_write_is_one_line(refused_call, scene, arguments, said):
    assert said in refused_call("render", scene, *arguments, "--method", "embree")
