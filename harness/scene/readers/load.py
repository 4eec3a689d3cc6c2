"""Read scene files of any supported format. Triangles keep the order of the file; nothing is merged or dropped."""

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from ...errors import UserError, did_you_mean
from ...files import open_regular
from ...texts import visible
from ..scene import Source
from .checks import ALL, Loaded, Wanted
from .gltf.read import read_gltf
from .obj import read_obj
from .off import read_off
from .ply import read_ply
from .sequences import joined, load_npz, numbered
from .stl import read_stl
from .threemf import read_3mf
from .usd import read_usd

READERS: dict[str, Callable[[Path, Wanted], Loaded]] = {
    ".ply": read_ply, ".obj": read_obj, ".glb": read_gltf, ".gltf": read_gltf, ".stl": read_stl, ".off": read_off,
    ".3mf": read_3mf, **dict.fromkeys((".usd", ".usda", ".usdc", ".usdz"), read_usd),
}  # fmt: skip

STILL = (".ply", ".obj", ".stl", ".off", ".3mf")  # formats whose files hold one frame
SUFFIXES = (".npz", *READERS)  # the supported file name endings of meshes
DECLARATION = ".toml"  # the ending of a file that declares a scene (`scene.declaration`)

_BLENDER = "open it in Blender and export it as glTF (.glb) or USD"
_CAD = "open it in FreeCAD and export its mesh as STL"
_MESHLAB = "open it in MeshLab and export it as PLY"

UNREAD = {  # by the ending of a name: what it is, and the way out
    ".abc": ("Alembic", "import it into Blender and export it as USD, which keeps its frames"),
    ".fbx": ("FBX", f"convert it with FBX2glTF, or {_BLENDER}"),
    ".dae": ("COLLADA", f"convert it with COLLADA2GLTF, or {_BLENDER}"),
    ".blend": ("Blender", _BLENDER),
    ".3ds": ("3D Studio", _BLENDER),
    ".bvh": ("motion capture", f"it holds a skeleton and no mesh: import it with a skin, {_BLENDER}"),
    ".x3d": ("X3D", _BLENDER),
    ".wrl": ("VRML", _MESHLAB),
    ".max": ("3ds Max", "export it from 3ds Max as USD"),
    ".ma": ("Maya", "export it from Maya as USD"),
    ".mb": ("Maya", "export it from Maya as USD"),
    ".c4d": ("Cinema 4D", "export it from Cinema 4D as glTF or USD"),
    ".hip": ("Houdini", "export it from Houdini as USD"),
    ".bgeo": ("Houdini geometry", "export it from Houdini as USD, or each frame as PLY"),
    ".skp": ("SketchUp", "export it from SketchUp as glTF or USD"),
    ".3dm": ("Rhino", "export it from Rhino as OBJ, STL or PLY"),
    ".vdb": ("OpenVDB", "it holds a volume: convert it to a mesh in Blender and export that as PLY"),
    ".vtk": ("VTK", "open it in ParaView and export its surface as PLY"),
    ".vtu": ("VTK", "open it in ParaView and export its surface as PLY"),
    ".step": ("STEP", _CAD),
    ".stp": ("STEP", _CAD),
    ".iges": ("IGES", _CAD),
    ".igs": ("IGES", _CAD),
    ".pbrt": ("pbrt", "its meshes are PLY files beside it: declare them, its cameras and lights in a .toml file"),
    ".xml": ("Mitsuba", "its meshes are OBJ or PLY files beside it: declare them and its camera in a .toml file"),
    ".las": ("a point cloud", f"it has no triangles: {_MESHLAB} after reconstructing a surface"),
    ".xyz": ("a point cloud", f"it has no triangles: {_MESHLAB} after reconstructing a surface"),
    ".mtl": ("the materials of an OBJ file", "give the .obj file"),
    ".bin": ("the data of a glTF file", "give the .gltf file"),
    ".gz": ("a compressed file", "unpack it first"),
    ".zip": ("an archive", "unpack it first"),
}


def load(path: str | Path, wanted: Wanted = ALL) -> Loaded:
    """A mesh file, an ``.npz`` sequence, or a folder of numbered frames; of its frames those ``wanted``. Raises
    :class:`UserError` for everything that is not a valid mesh of at least one triangle. Vertices with NaN are allowed:
    their triangles are never hit.
    """
    path = Path(path)
    if path.is_dir():
        frames = numbered(path, READERS)
        if not frames:
            kinds = ", ".join(READERS)
            raise UserError(f"{path}: this folder has no numbered frames ({kinds}); give a file, or a folder of them")
        return load_sequence(frames, wanted)
    suffix = path.suffix.lower()
    if suffix == ".npz":
        return load_npz(path, wanted)
    if suffix not in READERS:
        raise _refusal(path, suffix)
    if suffix in STILL:
        wanted.chosen(path, 1)
    mesh = READERS[suffix](path, wanted)
    return replace(mesh, files=(path, *mesh.files))


def _refusal(path: Path, suffix: str) -> UserError:
    if not path.exists():
        return UserError(f"{path}: no such file; check the path")
    if suffix in UNREAD:
        what, way_out = UNREAD[suffix]
        return UserError(f"{path}: {what} ({suffix}) is not read; {way_out}")
    return UserError(
        f"{path}: files ending in {suffix!r} cannot be read{did_you_mean(suffix, (*SUFFIXES, DECLARATION))}"
    )


def load_sequence(paths: Sequence[Path], wanted: Wanted = ALL) -> Loaded:
    """Numbered frames, all of one format, in the order given; of these the ``wanted`` ones. Each file gives one frame."""
    chosen = wanted.chosen(paths[0].parent, len(paths))
    read, first = READERS[paths[0].suffix.lower()], replace(wanted, frames=(0, 0, 1))
    files = [paths[k] for k in chosen]
    return joined(files, [read(path, first) for path in files], wanted.rate_of(chosen))


def source(files: tuple[Path, ...], wanted: Wanted = ALL) -> Source:
    """The names of the files, one SHA-256 of their contents in order, and what was asked of them, for the record."""
    digest = hashlib.sha256()
    for path in files:
        with open_regular(path) as stream:
            while block := stream.read(1 << 20):
                digest.update(block)
    first, last = visible(files[0].name), visible(files[-1].name)
    named = first if len(files) == 1 else f"{first}..{last} ({len(files)} files)"
    return Source("file", named, digest.hexdigest(), wanted.facts())
