"""STL, binary and ASCII. trimesh reads it; the number of triangles is checked before and after."""

from __future__ import annotations

import io
import re
from pathlib import Path

import numpy as np

from .checks import ALL, Mesh, Wanted, broken, checked, guarded, read_bytes

_HEADER, _RECORD = 84, 50
_UP = (0.0, 0.0, 1.0)
"""Programs that write STL (printing, machining) take z as up; the format does not define it."""


def read_stl(path: Path, wanted: Wanted = ALL) -> Mesh:
    """Every triangle has three vertices of its own, in file order; several solids are concatenated.

    Raises :class:`UserError` if the count of a binary file does not match its size, or if trimesh reads another number
    of triangles than an ASCII file has.
    """
    import trimesh  # imported here because it is slow and most runs read no STL

    blob = read_bytes(path)
    claimed = int.from_bytes(blob[80:84], "little") if len(blob) >= _HEADER else -1
    if claimed >= 0 and _HEADER + _RECORD * claimed == len(blob):
        expected = claimed
    elif blob.lstrip()[:5].lower() == b"solid":
        vertices = sum(1 for _ in re.finditer(rb"(?im)^[ \t]*vertex[ \t]", blob))
        facets = sum(1 for _ in re.finditer(rb"(?im)^[ \t]*facet[ \t]", blob))
        if vertices != 3 * facets:
            raise broken(path, f"{facets} facets have {vertices} vertices instead of {3 * facets}")
        expected = facets
    elif claimed >= 0:
        size = f"{_HEADER + _RECORD * claimed} bytes, but the file has {len(blob)}"
        raise broken(
            path,
            f"the header claims {claimed} triangles, {size}",
            "the file is truncated or its header wrong",
        )
    else:
        raise broken(path, "is neither binary nor ASCII STL", "the file is truncated or of another kind")
    if not expected:
        raise broken(path, "holds no triangles", "give a triangle mesh")
    with guarded(path, "STL"):
        scene = trimesh.load_scene(io.BytesIO(blob), file_type="stl", process=False)
        parts = [
            np.asarray(mesh.triangles, dtype=np.float64).reshape(-1, 3) for mesh in scene.geometry.values()
        ]
        points = np.concatenate(parts) if parts else np.zeros((0, 3))
    if len(points) != 3 * expected:
        raise broken(path, f"{expected} triangles, but {len(points) // 3} could be read")
    if len(blob) == _HEADER + _RECORD * claimed:
        points = points.astype(np.float32)
    return checked(path, points, np.arange(len(points)).reshape(-1, 3), _UP)
