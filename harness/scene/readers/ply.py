"""Stanford PLY: ASCII and binary of either byte order, any element order, polygons of any size, triangle strips.

trimesh 5.2 is not used because it refuses binary files that mix triangles and larger polygons, and files whose elements
or lists have an unusual order; it moves the second halves of quads behind all other faces; it reads a truncated ASCII
file as a smaller mesh, and an index of 1.5 as 1. tests/scene/test_load.py has a file for each case, and compares files
of triangles with what trimesh reads.
"""

from pathlib import Path

import numpy as np

from ...arrays import I32, Floats
from .checks import ALL, Loaded, Wanted, broken, checked, read_bytes
from .ply_data import CORNERS, NOTHING, Column, Columns, Element, Records, Rows, read_header
from .polygons import polygon_sizes, triangulate
from .text import decoded

_DRAWN = ("vertex", "face", "tristrips")
"""The elements that are read; others are left out with a note."""

_RESTART = -1
"""Ends a triangle strip, after which another begins."""


def read_ply(path: Path, wanted: Wanted = ALL) -> Loaded:
    """Positions (float32 if a binary file stores float32, else float64) and triangulated faces, in file order.

    Faces come before strips where the file has both. Needs memory of up to about ten times the file's size. Raises
    :class:`UserError` if header and contents disagree, an index is out of range, a face has fewer than 3 vertices, or there
    are no faces.
    """
    blob = decoded(read_bytes(path))
    header = read_header(path, blob)
    data = (Records if header.order else Rows)(path, header, blob)
    elements = {element.name: element for element in header.elements}
    columns: dict[str, Columns] = {}
    for name, element in elements.items():
        there = element.length and element.properties
        columns[name] = data.columns(element) if there else {p.name: NOTHING for p in element.properties}
    data.finish()
    if "vertex" not in elements:
        raise broken(path, "has no element 'vertex'")
    points = _positions(elements["vertex"], columns["vertex"], bool(header.order))
    polygons = _corners(path, columns.get("face", {}))
    polygon_sizes(path, polygons.counts)
    faces = triangulate(points, polygons.counts, polygons.values)
    strips = _strips(_corners(path, columns.get("tristrips", {})))
    others = [name for name, one in elements.items() if name not in _DRAWN and one.length]
    notes = (f"elements left out: {', '.join(others)}",) if others else ()
    return checked(path, points, np.concatenate([faces, strips]) if len(strips) else faces, notes=notes)


def _positions(element: Element, columns: Columns, binary: bool) -> Floats:
    """x, y, z of the vertices, [length, 3]."""
    kinds = {p.kind for p in element.properties if p.name in ("x", "y", "z")}
    short = binary and kinds <= {"f4", "i1", "u1", "i2", "u2"}
    points = np.empty((element.length, 3), dtype=np.float32 if short else np.float64)
    for i, axis in enumerate("xyz"):
        points[:, i] = columns[axis].values
    return points


def _corners(path: Path, columns: Columns) -> Column:
    """The lists of vertex indices, after checking that these are integers in the range of int32."""
    name = next((name for name in CORNERS if name in columns), None)
    found, counts = columns[name] if name else NOTHING
    limit = 1 << 31
    if len(found) and not (-limit <= found.min() and found.max() < limit and not (found % 1).any()):
        raise broken(path, "a face has a vertex index that is not a whole number below 2^31")
    return Column(found.astype(np.int32, copy=False), counts)


def _strips(lists: Column) -> I32:
    """The triangles of strips, each turned like the first of its strip; int32 [triangle_count, 3].

    A strip goes on to the end of its list, or to :data:`_RESTART`.
    """
    corners = np.insert(lists.values, np.cumsum(lists.counts), _RESTART)
    places = np.arange(len(corners))
    place = places - np.maximum.accumulate(np.where(corners == _RESTART, places, -1)) - 1
    last = np.flatnonzero(place >= 2)
    odd = place[last] % 2
    return np.stack([corners[last - 2 + odd], corners[last - 1 - odd], corners[last]], axis=1)
