"""Cameras and lights of files and declarations, used by name; docs/files.md says what the code reads."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from helpers import mesh_files as files
from helpers.mesh_files import written
from shadowbench.harness.commands.listing import list_
from shadowbench.harness.commands.options import view_of
from shadowbench.harness.errors import UserError
from shadowbench.harness.scene import catalogue
from shadowbench.harness.scene.catalogue import resolve
from shadowbench.harness.scene.chosen_view import ChosenView
from shadowbench.harness.scene.readers import checks
from shadowbench.harness.scene.readers.load import DECLARATION, READERS, SUFFIXES, UNREAD, load
from shadowbench.harness.scene.scene import Camera, Light, Spot

DOOR, ABOVE = Camera((1, 2, 3), (0, 0, 0), fov=30.0), Camera((0, 9, 0), (0, 0, 0), (0, 0, 1), height=4.0)
LAMP, SUN = Light((0, 3, 0), spot=Spot((0, -1, 0), 40.0)), Light((1, 1, 0), directional=True, intensity=2.0)


@pytest.fixture
def path(tmp_path, monkeypatch):
    """A file that offers two cameras and two lights."""

    def with_views(path, *more):
        return replace(
            load(path, *more), cameras={"door": DOOR, "above": ABOVE}, lights={"lamp": LAMP, "sun": SUN}, rate=24.0
        )

    monkeypatch.setattr(catalogue, "load", with_views)
    return written(tmp_path, "room.ply", files.ply_binary())


def seen(path, **options):
    return view_of(None, None, None, **options).resolved(path)


def test_the_automatic_view_is_the_default(path):
    scene = resolve(path)
    assert scene.camera not in (DOOR, ABOVE)
    assert scene.lights[0] not in (LAMP, SUN)
    assert (scene.cameras, scene.lamps) == ({"door": DOOR, "above": ABOVE}, {"lamp": LAMP, "sun": SUN})


def test_a_camera_and_lights_are_used_by_name(path):
    scene = seen(path, camera_of="door", light_of=["sun", "lamp"])
    assert (scene.camera, scene.lights, seen(path, camera_of="above").camera) == (DOOR, (SUN, LAMP), ABOVE)
    assert seen(path, camera_of="door").lights == resolve(path).lights
    wide = view_of(None, 70.0, ["1,2,3"], camera_of="door", light_of=["sun"]).resolved(path)
    assert (wide.camera, wide.lights) == (replace(DOOR, fov=70.0), (SUN, Light((1, 2, 3))))


def test_what_is_named_travels_as_json_and_stands_in_tables():
    view = ChosenView(camera_of="door", lights_of=("sun", "lamp"))
    assert ChosenView.read(json.loads(json.dumps(view.facts()))) == view
    assert view.text() == "camera 'door' of the file; light 'sun' of the file; light 'lamp' of the file"


def test_other_names_are_refused(path, tmp_path):
    with pytest.raises(UserError, match=r"room\.ply: has no camera 'dor'; did you mean door\?"):
        seen(path, camera_of="dor")
    with pytest.raises(UserError, match="has no light 'moon'; known: lamp, sun"):
        seen(path, light_of=["moon"])
    with pytest.raises(UserError, match="--camera and --camera-of: give one of them"):
        view_of(("0,0,1", "0,0,0"), None, None, camera_of="door")
    with pytest.raises(UserError, match=r"Cloth.*: has no camera 'door'; its file offers none"):
        seen("cloth", camera_of="door")


def test_a_file_is_listed_with_its_cameras_and_lights(path, capsys):
    list_("scenes", [str(path)], as_json=True)
    (row,) = json.loads(capsys.readouterr().out)
    assert (row["triangles"], row["frames"], row["rate"]) == (4, 1, 24.0)
    assert row["cameras"]["door"]["eye"] == [1, 2, 3]
    assert row["lights"]["sun"]["directional"] is True
    list_("scenes", [str(path)])
    text = " ".join(capsys.readouterr().out.split())
    assert "room.ply: 4 triangles" in text
    assert "camera 'door': from 1,2,3 to 0,0,0, 30 degrees" in text
    assert "camera 'above': from 0,9,0 to 0,0,0, orthographic, 4 high" in text
    assert "light 'lamp': spot at 0,3,0" in text
    assert "light 'sun': directional, from 1,1,0" in text
    with pytest.raises(UserError, match=r"room\.ply"):
        list_("experiments", [str(path)])


def test_frames_and_what_was_left_out_are_listed(tmp_path, capsys):
    for number in (1, 2, 4):
        written(tmp_path, f"w_{number}.obj", files.obj())
    list_("scenes", [str(tmp_path / "w_%d.obj")], rate=12.0)
    text = " ".join(capsys.readouterr().out.split())
    assert "4 triangles, 3 frames at 12 a second" in text
    assert "not evenly spaced: 2 is followed by 4" in text


DECLARED = """
mesh = "room.ply"
[camera]
of = "door"
fov = 50
[[cameras]]
name = "far"
of = "above"
eye = [0, 90, 0]
[[cameras]]
name = "own"
eye = [5, 5, 5]
[[lights]]
of = "sun"
shadows = false
[[lights]]
name = "candle"
position = [0, 1, 0]
"""


def test_a_declaration_uses_and_offers_them(path):
    scene = resolve(written(path.parent, "a.toml", DECLARED.encode()))
    assert scene.camera == replace(DOOR, fov=50.0)
    assert scene.lights == (replace(SUN, shadows=False), Light((0, 1, 0)))
    assert (scene.cameras["far"], scene.cameras["own"].eye) == (replace(ABOVE, eye=(0, 90, 0)), (5, 5, 5))
    assert set(scene.cameras) == {"door", "above", "far", "own"}
    assert scene.lamps == {"lamp": LAMP, "sun": SUN, "candle": Light((0, 1, 0)), "light": replace(SUN, shadows=False)}
    assert seen(path.parent / "a.toml", camera_of="far", light_of=["candle"]).camera.height == 4.0


def test_lights_without_a_name_are_numbered_and_listed(path, capsys):
    """By names that neither a light of the declaration nor one of the file has."""
    lights = [("", 1), ("light 2", 2), ("", 3), ("light", 4)]
    told = "".join(f"[[lights]]\nposition = [0, {y}, 0]\n" + f'name = "{name}"\n' * bool(name) for name, y in lights)
    room = written(path.parent, "a.toml", f'mesh = "room.ply"\n{told}'.encode())
    assert [light.position[1] for light in resolve(room).lights] == [1, 2, 3, 4]
    heights = {name: light.position[1] for name, light in resolve(room).lamps.items()}
    assert heights == {"lamp": 3, "sun": 1, "light 3": 1, "light 2": 2, "light 4": 3, "light": 4}
    list_("scenes", [str(room)])
    text = " ".join(capsys.readouterr().out.split())
    assert (
        "light 'light 3': at 0,1,0 light 'light 2': at 0,2,0 light 'light 4': at 0,3,0 light 'light': at 0,4,0" in text
    )
    assert seen(room, light_of=["light 4"]).lights == (Light((0, 3, 0)),)


@pytest.mark.parametrize(("text", "words"), [
    ('[camera]\nof = "dor"', r"camera\.of: room\.ply: has no camera 'dor'; did you mean door\?"),
    ("[camera]\nof = 1", r"camera\.of must be a text in quotes, not 1"),
    ('[[lights]]\nof = "moon"', r"lights\[0\]\.of: .*has no light 'moon'"),
    ("[[cameras]]\neye = [0, 0, 1]", r"cameras\[0\]: add its name"),
    ('[[cameras]]\nname = "a"\n[[cameras]]\nname = "a"', r"cameras\[1\]: the name 'a' is taken"),
    ('[[cameras]]\nname = "a"\nmoves = true', r"cameras\[0\]: unknown key 'moves'"),
    ('[camera]\nof = "above"\nfov = 40', r"camera\.fov does not apply to a camera of kind orthographic"),
    ("[[lights]]\nspot = 3\nposition = [0, 0, 0]", r"lights\[0\]\.spot must be a table"),
])  # fmt: skip
def test_mistakes_in_a_declaration(path, text, words):
    with pytest.raises(UserError, match=words):
        resolve(written(path.parent, "a.toml", f'mesh = "room.ply"\n{text}\n'.encode()))


def test_views_of_several_meshes_stand_in_their_places(path):
    turned = "transform = {scale = 2, rotate = [0, 90, 0], translate = [10, 0, 0]}"
    text = f'[[meshes]]\nfile = "room.ply"\n[[meshes]]\nfile = "room.ply"\n{turned}\n'
    scene = resolve(written(path.parent, "b.toml", text.encode()))
    assert list(scene.cameras) == ["door", "above", "door 2", "above 2"]
    assert np.allclose(scene.cameras["door 2"].eye, (16, 4, -2))
    assert np.allclose(scene.cameras["above 2"].up, (2, 0, 0))
    assert scene.cameras["above 2"].height == pytest.approx(8.0)
    assert np.allclose(scene.lamps["lamp 2"].position, (10, 6, 0))
    assert np.allclose(scene.lamps["sun 2"].position, (0, 2, -2))


TEXT = (Path(__file__).resolve().parents[2] / "docs" / "files.md").read_text(encoding="utf-8")
EXAMPLE = re.compile(r"```(\w+)\n((?:(?!```).)*)```\n\nRead as (.*?)\.\n", re.DOTALL)


def test_every_ending_that_is_read_stands_in_the_first_table():
    first = TEXT.split("## The same for all")[0]
    assert set(re.findall(r"`(\.\w+)`", first)) == {*SUFFIXES, DECLARATION}
    for suffix in READERS:
        assert re.search(rf"^## .*`{re.escape(suffix)}`", TEXT, re.MULTILINE), f"{suffix} has no section"


def test_the_table_of_what_is_not_read_is_that_of_the_messages():
    last = TEXT.split("## Not read")[1]
    found = {}
    for row in re.findall(r"^\| `.*\|$", last, re.MULTILINE):
        endings, what, way_out = (cell.strip() for cell in row.strip("|").split("|"))
        found |= dict.fromkeys(re.findall(r"`(\.\w+)`", endings), (what, way_out))
    assert found == UNREAD
    assert not set(found) & set(SUFFIXES)


def test_its_links_within_lead_to_a_heading():
    slug = lambda heading: re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-")  # noqa: E731
    headings = {slug(heading) for heading in re.findall(r"^#+ (.*)$", TEXT, re.MULTILINE)}
    links = re.findall(r"\]\(#([\w-]+)\)", TEXT)
    assert len(links) > 5
    assert set(links) <= headings


def test_its_limits_are_those_of_the_code():
    assert "not exceed 1e37" in TEXT
    assert "at least\n  1e-38" in TEXT
    assert (checks.LARGEST, checks.SMALLEST) == (1e37, 1e-38)
    assert "may have 2^27 triangles" in TEXT
    assert checks.MAX_TRIANGLES == 1 << 27
    assert "a line of more than 2^20 bytes" in TEXT
    assert checks.MAX_LINE == 1 << 20


@pytest.mark.parametrize(("suffix", "content", "told"), EXAMPLE.findall(TEXT), ids=lambda text: text[:4])
def test_its_examples_are_read_as_it_says(tmp_path, suffix, content, told):
    loaded = load(files.written(tmp_path, f"a.{suffix}", content.encode()))
    count, low, high, noted = re.fullmatch(
        r"(\d+) triangles? from \((.*?)\) to \((.*?)\)(?:; noted: (.*))?", told.replace("\n", " ")
    ).groups()
    points = loaded.frames[0][np.unique(loaded.faces)]
    assert (len(loaded.faces), points.min(axis=0).tolist()) == (int(count), [float(x) for x in low.split(",")])
    assert points.max(axis=0).tolist() == [float(x) for x in high.split(",")]
    assert loaded.notes == ((noted,) if noted else ())


def test_it_has_an_example_of_every_text_format():
    assert {suffix for suffix, _, _ in EXAMPLE.findall(TEXT)} == {"obj", "ply", "stl"}


@pytest.fixture
def folder(tmp_path):
    """The files that the declarations of the document name."""
    files.written(tmp_path, "room.obj", files.obj())
    (tmp_path / "dancer").mkdir()
    for number in range(91):
        files.written(tmp_path / "dancer", f"{number:04}.ply", files.ply_binary(files.QUAD + number))
    return tmp_path


def test_its_declarations_are_read(folder):
    several, views = re.findall(r"```toml\n(.*?)```", TEXT, re.DOTALL)
    scene = resolve(files.written(folder, "several.toml", several.encode()))
    assert (scene.geometry().frame_count, len(scene.geometry().faces)) == (10, 12)
    assert np.allclose(scene.geometry().positions(9)[5], (0.9, -0.9, 2.9))
    assert scene.geometry().positions(9)[10].tolist() == [3, 0, 0]
    scene = resolve(files.written(folder, "views.toml", views.encode()))
    assert (scene.camera.eye, scene.camera.fov) == ((0, 1.7, 4), 50)
    assert view_of(None, None, None, camera_of="door", light_of=["lamp"]).applied(scene).camera.fov != 50


def test_its_patterns_are_read(folder, monkeypatch):
    monkeypatch.chdir(folder)
    (folder / "frames").mkdir()
    for number in (1, 2, 10):
        files.written(folder / "frames", f"{number:04}.ply", files.ply_binary())
        files.written(folder / "frames", f"wave_{number}.obj", files.obj())
        files.written(folder / "frames", f"{number}.stl", files.stl_binary())
    for pattern in re.findall(r"^\| `(frames/\S+)`", TEXT, re.MULTILINE):
        assert resolve(pattern).geometry().frame_count == 3
    assert len(re.findall(r"^\| `frames/", TEXT, re.MULTILINE)) == 3
