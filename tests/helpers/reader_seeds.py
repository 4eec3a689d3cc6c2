"""Whole files of each format with much of what it can say, small: what is damaged to try the readers."""

import io
import zipfile
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from shadowbench.harness.scene.readers import usd

from . import mesh_files as files
from . import threemf_files as threemf
from .gltf_samples import FACES, POINTS, draco, everything, packed
from .usd_stages import mesh, moved_by, skinned

MIXED = [(0, 1, 2, 3), (0, 1, 4), (0, 1, 2, 3, 4)]
CONCAVE = [(0, 3, 0), (0, 0, 0), (4, 0, 0), (4, 3, 0), (3, 3, 0), (3, 1, 0), (1, 1, 0), (1, 3, 0)]
STRIPS = files.ply_binary(polygons=[(0, 1, 2, 3, -1, 4, 3, 2)]).replace(b"element face", b"element tristrips")
CONTINUED = files.obj(polygons=MIXED).replace(b" 3", b" \\\n3 # c\\").replace(b"f 1", b"# d:\\\nf 1")

STAGE = f"""def PointInstancer "Field" {{
    rel prototypes = </Field/P>
    int[] protoIndices = [0, 0, 0]
    point3f[] positions.timeSamples = {{ 0: [(1, 0, 0), (2, 0, 0), (3, 0, 0)], 4: [(1, 1, 0), (2, 1, 0), (3, 1, 0)] }}
    int64[] invisibleIds = [1]
{mesh("P")}}}
class "Kind" {{
{mesh("M")}}}
def "Instance" (instanceable = true
    references = </Kind>) {{
}}
def Capsule "Capsule" {{
    double radius.timeSamples = {{ 1: 1, 2: 4 }}
{moved_by(3)}}}
def Camera "Eye" {{
}}
def DistantLight "Sun" {{
}}
"""


def npz(frames=(files.QUAD, files.QUAD + 1), faces=files.FACES) -> bytes:
    stream = io.BytesIO()
    np.savez(stream, V=np.stack(frames), F=np.array(faces))
    return stream.getvalue()


def package() -> bytes:
    """A 3MF package of two parts, not compressed."""
    twice = threemf.group(2, threemf.use(1, (1, 0, 0)), threemf.use(1, path="/3D/other.model"))
    text = threemf.model([threemf.mesh(1), twice], threemf.item(2), threemf.item(1))
    return threemf.package(text, zipfile.ZIP_STORED, other=threemf.model([threemf.mesh(1)]))


def stages() -> dict[str, bytes]:
    """The same stage of a skinned figure, an instancer, an instance and a moving shape as text, crate and package."""
    from pxr import Usd, UsdUtils

    with TemporaryDirectory() as place:
        folder = Path(place)
        skinned(folder / "seed.usda", 1)
        (folder / "a.usda").write_text((folder / "seed.usda").read_text() + STAGE)
        Usd.Stage.Open(str(folder / "a.usda")).Export(str(folder / "a.usdc"))
        assert UsdUtils.CreateNewUsdzPackage(str(folder / "a.usdc"), str(folder / "a.usdz"))
        return {ending: (folder / f"a{ending}").read_bytes() for ending in (".usda", ".usdc", ".usdz")}


def seeds() -> dict[str, list[bytes]]:
    """Whole files by their ending. Without the package that reads USD there is none of it."""
    made = {
        ".ply": [
            files.ply_binary(), files.ply_binary(polygons=MIXED, big=True), files.ply_ascii(polygons=MIXED),
            files.ply_ascii(CONCAVE, [tuple(range(8))]), STRIPS,
        ],
        ".obj": [
            files.obj(), files.obj(polygons=MIXED).replace(b"f 1 2 5", b"f -5/1/1 2//3 5/1"), CONTINUED,
            files.obj(polygons=MIXED).decode().replace("\n", "\r").encode("utf-16"),
        ],
        ".stl": [files.stl_binary(), files.stl_ascii()],
        ".off": [
            files.off(),
            files.off(polygons=MIXED, first="# x\nCOFF\n", vertex=" 1 0 0 1", face=" 0.5"),
        ],
        ".3mf": [package()],
        ".npz": [npz()],
        ".glb": [everything().glb(), draco(POINTS, FACES).glb(), packed(POINTS, FACES).glb()],
        ".gltf": [everything().text()],
    }  # fmt: skip
    return made | ({ending: [blob] for ending, blob in stages().items()} if usd.available() else {})
