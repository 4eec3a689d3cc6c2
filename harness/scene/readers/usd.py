"""USD through the package usd-core: every visible mesh of the stage, in the order of the stage."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import UserError, install
from .checks import ALL, Mesh, Wanted, broken, checked, guarded, read_bytes
from .polygons import polygon_sizes, triangulate


def missing() -> str:
    """What to do where usd-core is not installed."""
    return f"reading USD needs the package usd-core; {install('usd-core')}"


def available() -> bool:
    """Whether usd-core is installed."""
    try:
        import pxr.Usd  # noqa: F401
    except ImportError:
        return False
    return True


def read_usd(path: Path, wanted: Wanted = ALL) -> Mesh:
    """The triangulated meshes at the stage's default time, transformed, float64; ``up`` is the stage's up axis.

    Invisible prims, guides and proxies are skipped. Holes and subdivision are ignored: the control mesh is read.
    Instances are expanded. Raises :class:`UserError` if usd-core is missing, the stage cannot be opened, or its arrays
    contradict each other.
    """
    if not available():
        raise UserError(f"{path}: {missing()}")
    from pxr import Tf, Usd, UsdGeom

    read_bytes(path)  # missing and unreadable files get the same message as in every other format
    parts, offset = [], 0
    with guarded(path, "USD"):
        try:
            stage = Usd.Stage.Open(str(path))
        except Tf.ErrorException:  # USD's own message names lines of its source code
            raise broken(path, "USD cannot open it: it is damaged, truncated or not a USD file") from None
        axis = str(UsdGeom.GetStageUpAxis(stage))
        transforms = UsdGeom.XformCache()
        for prim in stage.Traverse(Usd.TraverseInstanceProxies()):
            if not prim.IsA(UsdGeom.Mesh):
                continue
            mesh = UsdGeom.Mesh(prim)
            if mesh.ComputeVisibility() == "invisible" or mesh.ComputePurpose() in ("guide", "proxy"):
                continue
            own, faces = _one(path, mesh)
            matrix = np.array(transforms.GetLocalToWorldTransform(prim), dtype=np.float64)
            with np.errstate(over="ignore", invalid="ignore"):
                # USD multiplies row vectors by the matrix on their right.
                moved = own if np.array_equal(matrix, np.eye(4)) else own @ matrix[:3, :3] + matrix[3, :3]
            parts.append((moved, faces + offset))
            offset += len(own)
    if not parts:
        raise broken(path, "holds no visible mesh", "give a stage with meshes")
    up = (0.0, 0.0, 1.0) if axis == "Z" else (0.0, 1.0, 0.0)
    return checked(path, np.concatenate([p for p, _ in parts]), np.concatenate([f for _, f in parts]), up)


def _one(path: Path, mesh: Any) -> tuple[NDArray, NDArray]:
    """Positions float64 [n, 3] and triangles of one mesh, indices from 0."""
    points = _values(mesh.GetPointsAttr(), np.float64).reshape(-1, 3)
    counts = _values(mesh.GetFaceVertexCountsAttr(), np.int64)
    corners = _values(mesh.GetFaceVertexIndicesAttr(), np.int64)
    polygon_sizes(path, counts)
    if counts.sum() != len(corners):
        raise broken(
            path, f"{mesh.GetPath()}: {counts.sum()} corners are declared, but there are {len(corners)}"
        )
    if len(corners) and (corners.min() < 0 or corners.max() >= len(points)):
        bad = int(corners.max()) if corners.min() >= 0 else int(corners.min())
        raise broken(path, f"{mesh.GetPath()}: a face names vertex {bad}, but there are {len(points)}")
    faces = triangulate(points, counts, corners)
    holes = _values(mesh.GetHoleIndicesAttr(), np.int64)
    if len(holes):
        faces = faces[~np.isin(np.repeat(np.arange(len(counts)), counts - 2), holes)]
    return points, faces


def _values(attribute: Any, dtype: type) -> NDArray:
    """An array attribute at the default time, or at its first time sample; empty where it has no value."""
    value = attribute.Get()
    if value is None and attribute.GetTimeSamples():
        value = attribute.Get(attribute.GetTimeSamples()[0])
    return np.zeros(0, dtype=dtype) if value is None else np.array(value, dtype=dtype)
