"""USD stages for tests: short text, small meshes, and what UsdGeom.BBoxCache says of a file."""

from pathlib import Path

import numpy as np
import pytest
from shadowbench.harness.scene.readers import usd
from shadowbench.harness.scene.readers.checks import Loaded
from shadowbench.harness.scene.readers.load import load

from .mesh_files import written

needs_usd = pytest.mark.skipif(not usd.available(), reason="usd-core is not installed")

HEAD = '#usda 1.0\n(\n    upAxis = "Y"\n)\n'

TRIANGLE = """
    int[] faceVertexCounts = [3]
    int[] faceVertexIndices = [0, 1, 2]
    uniform token subdivisionScheme = "none"
"""
POINTS = "    point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]\n"


def moved_by(x: float, y: float = 0.0, z: float = 0.0) -> str:
    """The lines that move a prim."""
    order = 'uniform token[] xformOpOrder = ["xformOp:translate"]'
    return f"    double3 xformOp:translate = ({x}, {y}, {z})\n    {order}\n"


def mesh(name: str, more: str = "", points: str = POINTS, meta: str = "", kind: str = "def") -> str:
    """A mesh of one triangle, 1 wide and high."""
    return f'{kind} Mesh "{name}" {meta}\n{{{TRIANGLE}{points}{more}}}\n'


def read(folder: Path, text: str, head: str = HEAD) -> Loaded:
    """What a stage of this text is read as."""
    return load(written(folder, "a.usda", head + text))


def lefts(loaded: Loaded) -> list[float]:
    """The least x of each triangle, in order."""
    return loaded.frames[0][loaded.faces][..., 0].min(axis=1).tolist()


def bounds(loaded: Loaded, frame: int = 0) -> list[list[float]]:
    """Least and largest coordinates of the triangles that are there at a frame."""
    corners = loaded.frames[frame][loaded.faces].reshape(-1, 3)
    corners = corners[np.isfinite(corners).all(axis=1)]
    return [corners.min(axis=0).tolist(), corners.max(axis=0).tolist()]


def bounds_of_library(path: Path, time: float) -> list[list[float]]:
    """What BBoxCache finds at a time code: the union over all that is drawn, each on its own, so that it is tight."""
    from pxr import Gf, Usd, UsdGeom

    stage = Usd.Stage.Open(str(path))
    cache = UsdGeom.BBoxCache(Usd.TimeCode(time), ["default", "render"])
    total = Gf.Range3d()
    walk = iter(Usd.PrimRange.Stage(stage, Usd.TraverseInstanceProxies()))
    for prim in walk:
        if prim.IsA(UsdGeom.PointInstancer):
            walk.PruneChildren()
        image = UsdGeom.Imageable(prim)
        if not prim.IsA(UsdGeom.Boundable) or image.ComputeVisibility(time) == "invisible":
            continue
        total.UnionWith(cache.ComputeWorldBound(prim).ComputeAlignedRange())
    return [list(total.GetMin()), list(total.GetMax())]
