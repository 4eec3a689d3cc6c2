"""Small mesh files written by hand, byte for byte, for the tests of loading."""

import contextlib
import io
import struct
import tracemalloc
import zipfile
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

import numpy as np
import pytest
from shadowbench.harness.errors import UserError
from shadowbench.harness.scene import shape
from shadowbench.harness.scene.readers.checks import Loaded
from shadowbench.harness.scene.readers.load import load

from .gltf_samples import Gltf, binary

QUAD = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, 0.5, 1]], dtype=np.float32)
FACES = [(0, 1, 2), (0, 2, 3), (0, 1, 4), (1, 2, 4)]


def ply_binary(points=QUAD, polygons=FACES, *, big=False, vertices=None, faces=None, count="uchar", index="int"):
    """A binary PLY. ``vertices`` and ``faces`` are what the header claims, by default the right numbers."""
    order, kinds = "><"[not big], {"uchar": "B", "int": "i", "ushort": "H", "uint": "I"}
    header = [
        "ply",
        f"format binary_{'big' if big else 'little'}_endian 1.0",
        "comment by hand",
        f"element vertex {len(points) if vertices is None else vertices}",
        *[f"property float {axis}" for axis in "xyz"],
        f"element face {len(polygons) if faces is None else faces}",
        f"property list {count} {index} vertex_indices",
        "end_header\n",
    ]
    rows = [struct.pack(f"{order}{kinds[count]}{len(p)}{kinds[index]}", len(p), *p) for p in polygons]
    body = np.asarray(points, dtype=order + "f4").tobytes() + b"".join(rows)
    return "\n".join(header).encode() + body


def ply_ascii(points=QUAD, polygons=FACES, vertices=None, faces=None):
    """An ASCII PLY."""
    lines = ["ply", "format ascii 1.0", f"element vertex {len(points) if vertices is None else vertices}"]
    lines += [f"property float {axis}" for axis in "xyz"]
    lines += [f"element face {len(polygons) if faces is None else faces}"]
    lines += ["property list uchar int vertex_indices", "end_header"]
    lines += [" ".join(f"{x:.9g}" for x in row) for row in points]
    lines += [" ".join(map(str, [len(p), *p])) for p in polygons]
    return ("\n".join(lines) + "\n").encode()


def obj(points=QUAD, polygons=FACES):
    """An OBJ without anything but positions and faces."""
    lines = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in np.asarray(points).tolist()]
    lines += ["f " + " ".join(str(i + 1) for i in p) for p in polygons]
    return ("\n".join(lines) + "\n").encode()


def off(points=QUAD, polygons=FACES, first="OFF\n", vertex="", face="", counts=None) -> bytes:
    """An OFF; ``vertex`` and ``face``: what follows on the lines of each."""
    counts = counts or f"{len(points)} {len(polygons)} 0"
    lines = [" ".join(f"{x:.9g}" for x in row) + vertex for row in points]
    lines += [" ".join(map(str, [len(p), *p])) + face for p in polygons]
    return (f"{first}{counts}\n" + "\n".join(lines) + "\n").encode()


def stl_binary(points=QUAD, triangles=FACES, claimed=None):
    """A binary STL; ``claimed``: the count in its header."""
    corners = np.asarray(points, dtype="<f4")[np.asarray(triangles)].reshape(-1, 9)
    body = b"".join(bytes(12) + row.tobytes() + b"\0\0" for row in corners)
    return bytes(80) + struct.pack("<I", len(corners) if claimed is None else claimed) + body


def stl_ascii(points=QUAD, triangles=FACES):
    """An ASCII STL."""
    lines = ["solid hand"]
    for triangle in triangles:
        lines += ["facet normal 0 0 0", " outer loop"]
        lines += ["  vertex " + " ".join(f"{x:.9g}" for x in points[i]) for i in triangle]
        lines += [" endloop", "endfacet"]
    return ("\n".join([*lines, "endsolid hand"]) + "\n").encode()


def glb(points=QUAD, triangles=FACES, change=None, index="<u4"):
    """A GLB whose mesh hangs twice in the scene, once moved by (10, 0, 0). ``change`` edits the JSON part."""
    made = Gltf()
    mesh = made.mesh(points, np.asarray(triangles, dtype=index).ravel())
    made.node(mesh=mesh)
    made.node(made.node(), mesh=mesh, translation=[10.0, 0.0, 0.0])
    whole = made.glb()
    if change is None:
        return whole
    change(made.head)
    return binary(made.head, bytes(made.data))


USDA = """#usda 1.0
(
    upAxis = "Z"
)
def Xform "part" {
    double3 xformOp:translate = (10, 0, 0)
    uniform token[] xformOpOrder = ["xformOp:translate"]
    def Mesh "pentagon" {
        point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0.5, 0.5, 1)]
        int[] faceVertexCounts = [5, 3]
        int[] faceVertexIndices = [0, 1, 2, 3, 4, 0, 1, 4]
    }
    def Mesh "hidden" {
        token visibility = "invisible"
        point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0)]
        int[] faceVertexCounts = [3]
        int[] faceVertexIndices = [0, 1, 2]
    }
}
"""


def written(tmp_path, name, content) -> Path:
    path = tmp_path / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


def refused(path, *words, read=load) -> str:
    """Loading fails with one line that names the file and all words."""
    with pytest.raises(UserError) as caught:
        read(path)
    line = str(caught.value)
    assert "\n" not in line
    assert str(path) in line
    assert "; " in line, "the line names no way out"
    for word in words:
        assert word in line
    return line


def shape_of(loaded: Loaded) -> shape.Shape:
    return shape.shape_of(loaded.geometry(), loaded.up)


@contextlib.contextmanager
def traced_memory() -> Iterator[Callable[[], int]]:
    """In the block the call that it gives tells the most bytes that were held at once since its beginning."""
    tracemalloc.start()
    try:
        yield lambda: tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def zipped(files: Mapping[str, str | bytes], how: int = zipfile.ZIP_DEFLATED) -> bytes:
    """The bytes of a ZIP file."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", how) as archive:
        for name, content in files.items():
            archive.writestr(name, content)
    return stream.getvalue()
