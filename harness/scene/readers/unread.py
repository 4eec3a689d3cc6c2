"""Formats that are not read, and what converts them into one that is."""

from collections.abc import Iterable
from pathlib import Path

from ...errors import UserError, did_you_mean

_BLENDER = "open it in Blender and export it as glTF (.glb) or USD"
_CAD = "open it in FreeCAD and export its mesh as STL"
_MESHLAB = "open it in MeshLab and export it as PLY"

_UNREAD = {
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
"""By the ending of a name: what it is, and the way out."""


def refusal(path: Path, known: Iterable[str]) -> UserError:
    """The error for a file whose ending is not among those ``known``."""
    suffix = path.suffix.lower()
    if suffix in _UNREAD:
        what, way_out = _UNREAD[suffix]
        return UserError(f"{path}: {what} ({suffix}) is not read; {way_out}")
    return UserError(f"{path}: files ending in {suffix!r} cannot be read{did_you_mean(suffix, known)}")
