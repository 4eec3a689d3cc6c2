"""Pictures of scenes: shading, pieces, galleries, what they say about themselves, and their sizes."""

import io
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from PIL import Image
from shadowbench.experiments import figure9
from shadowbench.harness.frame.materials import pieces
from shadowbench.harness.hardcases.shapes import quad
from shadowbench.harness.report import picture as pictures
from shadowbench.harness.report.picture import png_bytes, save_png, shade, shown_in
from shadowbench.harness.results.folder import image_name
from shadowbench.harness.scene.prepared import Prepared, prepare
from shadowbench.harness.scene.scene import Camera, Geometry, Light, Scene

SIZE = 16


def square(lights: tuple[Light, ...], name: str = "square", stand_in: str | None = None) -> Prepared:
    """Two triangles that fill the left half of the view, seen from +z."""
    left = quad((-9, -9, 0), (0, -9, 0), (0, 9, 0), (-9, 9, 0))
    camera = Camera((0.0, 0.0, 4.0), (0.0, 0.0, 0.0))
    return prepare(Scene(name, "Square", lambda: Geometry.static(*left), camera, lights, stand_in))


def points(*scenes: str, size: tuple[int, int] = (60, 40)) -> pd.DataFrame:
    """Measured points of these scenes, as a gallery needs them."""
    return pd.DataFrame({"scene": scenes, "width": size[0], "height": size[1]})


def kept(folder: Path, scene: str, size: tuple[int, int] = (60, 40)) -> Path:
    """Where the picture of a scene is kept."""
    return folder / "images" / image_name(scene, "", *size)


def answers_to(prepared: Prepared, marked: np.ndarray | None = None):
    """The moment, and the answers worked out by hand: the square's plane is z = 0, so t is 4 everywhere."""
    moment = prepared.moment(0, SIZE, SIZE)
    x = np.tile(np.arange(SIZE), SIZE)
    hit = x < SIZE // 2
    t = np.where(hit, 4.0, np.inf).astype(np.float32)
    shadowed = np.zeros((len(moment.lights), SIZE * SIZE), dtype=np.uint8)
    if marked is not None:
        shadowed[:, marked] = 1
    zero = np.zeros(SIZE * SIZE, dtype=np.float32)
    return moment, {
        "triangle": np.where(hit, 0, -1).astype(np.int32), "t": t, "u": zero, "v": zero, "shadowed": shadowed,
    }  # fmt: skip


def test_shading_lights_what_is_lit_and_darkens_what_is_shadowed():
    lights = (Light((0.0, 0.0, 6.0)),)
    prepared = square(lights)
    upper = np.repeat(np.arange(SIZE), SIZE) < SIZE // 2
    moment, answers = answers_to(prepared, marked=upper)
    picture = shade(prepared, moment, answers, lights)
    assert (picture.shape, picture.dtype) == ((SIZE, SIZE, 3), np.uint8)
    bright = picture.astype(int).sum(axis=2)
    assert bright[: SIZE // 2, : SIZE // 2].max() < 0.8 * bright[SIZE // 2 :, : SIZE // 2].min()
    assert bright[: SIZE // 2, : SIZE // 2].min() > 60, "a shadow is dark, not black"
    assert (picture[:, SIZE // 2 :] > 190).all(), "a miss shows the light background"


@pytest.mark.parametrize("triangle", [-77, 2, 1 << 30])
def test_answers_that_name_no_triangle_are_drawn_as_misses(triangle):
    lights = (Light((0.0, 0.0, 6.0)),)
    prepared = square(lights)
    moment, answers = answers_to(prepared)
    answers["triangle"][:] = triangle
    assert (shade(prepared, moment, answers, lights) > 190).all()


def test_pieces_are_connected_through_welded_vertices():
    a = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    vertices = np.concatenate([a, a + [1, 0, 0], a + [5, 0, 0], a[::-1] + [5, 0, 0]])
    faces = np.arange(12).reshape(4, 3)[::-1].copy()
    geometry = Geometry.static(vertices, faces)
    prepared = prepare(Scene("p", "P", lambda: geometry, Camera((0.0, 0.0, 1.0), (0.0, 0.0, 0.0)), ()))
    label = pieces(prepared)
    # Faces are listed backwards: two that coincide far away, then two that share the vertex (1, 0, 0).
    assert (label[0], label[2]) == (label[1], label[3])
    assert label[0] != label[2]


def test_pngs_are_compact_and_true_to_the_picture(tmp_path):
    y, x = np.mgrid[0:512, 0:512]
    wave = 128 + 100 * np.sin(x / 9.0) * np.cos(y / 7.0)
    picture = np.stack([wave, wave * 0.9, wave * 0.8], axis=2).astype(np.uint8)
    data = png_bytes(picture)
    assert len(data) < 300_000
    back = np.asarray(Image.open(io.BytesIO(data)).convert("RGB")).astype(int)
    assert np.abs(back - picture).max() <= 12
    flat = np.full((4, 5, 3), 200, dtype=np.uint8)
    flat[1, 2] = (10, 20, 30)
    path = save_png(flat, tmp_path / "deep" / "flat.png")
    assert (np.asarray(Image.open(path).convert("RGB")) == flat).all()
    assert [p.name for p in path.parent.iterdir()] == ["flat.png"]


def test_a_stand_in_says_so_in_its_picture(tmp_path):
    lights = (Light((0.0, 0.0, 6.0)),)
    heights = []
    for stand_in in (None, "the paper's Square; made by a program, with as many triangles"):
        prepared = square(lights, stand_in=stand_in)
        moment, answers = answers_to(prepared)
        path = pictures.scene_picture(prepared, moment, answers, lights, tmp_path / f"{bool(stand_in)}.png")
        image = np.asarray(Image.open(path).convert("RGB")).astype(int)
        assert image.shape[1] >= pictures.SMALLEST
        heights.append(image.shape[0])
        strip = image[image.shape[1] :]
        warned = (strip[:, :, 0] > strip[:, :, 2] + 90).sum()
        assert (warned > 50) == bool(stand_in)
    assert heights[1] > heights[0]


def test_the_contact_sheet_holds_every_picture(tmp_path):
    names = [f"s{i}" for i in (3, 0, 1, 2)]
    assert figure9.gallery(tmp_path, points(*names)) == []
    for i in range(4):
        save_png(np.full((40 + 10 * i, 60, 3), 60 * i, dtype=np.uint8), kept(tmp_path, f"s{i}"))
    (path,) = figure9.gallery(tmp_path, points(*names), "title")
    sheet_ = np.asarray(Image.open(path).convert("L"))
    assert {0, 60, 120, 180} <= set(np.unique(sheet_).tolist())


def test_pictures_of_two_sizes_are_on_two_sheets(tmp_path):
    small, large = points("a", "b"), points("a", size=(120, 80))
    for i, (scene, size) in enumerate((("a", (60, 40)), ("b", (60, 40)), ("a", (120, 80)))):
        save_png(np.full((40, 60, 3), 60 * i, dtype=np.uint8), kept(tmp_path, scene, size))
    sheets = figure9.gallery(tmp_path, pd.concat([small, large]))
    assert [sheet.name for sheet in sheets] == ["gallery-60x40.png", "gallery-120x80.png"]
    shades = [set(np.unique(Image.open(sheet).convert("L")).tolist()) for sheet in sheets]
    assert [{0, 60, 120} & shade for shade in shades] == [{0, 60}, {120}]


def test_a_damaged_picture_is_left_out_of_the_sheet_and_told(tmp_path, capsys):
    whole = save_png(np.zeros((40, 60, 3), dtype=np.uint8), kept(tmp_path, "a"), "it")
    half = kept(tmp_path, "b")
    half.write_bytes(whole.read_bytes()[: whole.stat().st_size // 2])
    kept(tmp_path, "c").write_bytes(b"no picture")
    assert shown_in(whole) == "it"
    assert shown_in(half) is None
    (sheet,) = figure9.gallery(tmp_path, points(*"abc"))
    assert sheet.name == "gallery.png"
    said = capsys.readouterr().err
    assert [f"{name}-60x40.png: not a whole picture" in said for name in "abc"] == [False, True, True]
    whole.unlink()
    assert figure9.gallery(tmp_path, points(*"abc")) == []


def test_a_picture_says_what_it_was_made_from(tmp_path):
    lights = (Light((0.0, 0.0, 6.0)),)
    prepared = square(lights)
    moment, answers = answers_to(prepared)
    path = pictures.scene_picture(prepared, moment, answers, lights, tmp_path / "a.png", shows="this moment")
    assert shown_in(path) == "this moment"
    assert shown_in(tmp_path / "none.png") is None
    path.write_bytes(path.read_bytes()[:20])
    assert shown_in(path) is None


@pytest.mark.parametrize(("width", "height"), [(1, 1), (3, 2500), (2500, 3)])
def test_pictures_of_odd_sizes_stay_small(tmp_path, width, height):
    flat = np.full((height, width, 3), 90, dtype=np.uint8)
    factor_limit = max(pictures.TALLEST, height) + 200
    prepared = square((Light((0.0, 0.0, 6.0)),))
    moment = prepared.moment(0, width, height)
    answers = {
        "triangle": np.full(width * height, -1),
        "t": np.full(width * height, np.inf),
        "shadowed": np.zeros((1, width * height), dtype=np.uint8),
    }
    path = pictures.scene_picture(prepared, moment, answers, (), kept(tmp_path, "odd"))
    with Image.open(path) as image:
        assert pictures.NARROWEST <= image.width <= max(2 * pictures.SMALLEST, width)
        assert image.height <= factor_limit
    captioned = pictures.captioned(flat, "Odd", "2 triangles", "procedural stand-in for another")
    assert captioned.shape[1] == max(width, pictures.NARROWEST)
    (sheet_,) = figure9.gallery(tmp_path, points("odd"))
    with Image.open(sheet_) as image:
        assert image.width * image.height < 10_000_000
