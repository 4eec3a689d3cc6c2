"""Damaged USD files, text, crate and package: a mesh or one line, whatever the library does, and no growth of memory."""

import numpy as np
import psutil
import pytest
from helpers.usd_figure import skinned
from helpers.usd_stages import mesh, moved_by, needs_usd
from shadowbench.harness.errors import UserError
from shadowbench.harness.scene.readers import apart
from shadowbench.harness.scene.readers.apart import load

pytestmark = needs_usd

CASES = 1000
"""For each of the three kinds of file."""

ROOM = 200 << 20
"""Bytes by which the reading process may grow after the first hundred files."""

REST = f"""def PointInstancer "Field" {{
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


def seed_file(folder, kind: str) -> bytes:
    """A small stage of everything that is read."""
    from pxr import Usd, UsdUtils

    skinned(folder / "seed.usda", 1)
    text = (folder / "seed.usda").read_text() + REST
    (folder / "whole.usda").write_text(text)
    Usd.Stage.Open(str(folder / "whole.usda")).Export(str(folder / "whole.usdc"))
    assert UsdUtils.CreateNewUsdzPackage(str(folder / "whole.usdc"), str(folder / "whole.usdz"))
    return (folder / f"whole.{kind}").read_bytes()


def damaged(blob: bytes, rng, k: int) -> bytes:
    """Cut at the k-th of positions spread over the file, or with a few bits and bytes changed."""
    if k % 4 == 0:
        return blob[: k * len(blob) // CASES]
    changed = bytearray(blob)
    for at in rng.integers(0, len(blob), rng.integers(1, 4)):
        changed[at] = changed[at] ^ (1 << rng.integers(8)) if k % 2 else rng.integers(256)
    return bytes(changed)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["usda", "usdc", "usdz"])
def test_damaged_files_are_read_or_refused(tmp_path, monkeypatch, kind):
    monkeypatch.setenv(apart.TIME, "2")  # some make the library itself run for ever
    blob = seed_file(tmp_path, kind)
    path = tmp_path / f"case.{kind}"
    path.write_bytes(blob)
    assert len(load(path).frames) == 5
    rng = np.random.default_rng(3)
    read = lines = 0
    for k in range(CASES):
        path.write_bytes(damaged(blob, rng, k))
        try:
            load(path)
            read += 1
        except UserError as error:
            line = str(error)
            assert "\n" not in line
            assert "pxrInternal" not in line
            lines += 1
        if k == 100:
            before = memory()
    assert read > 20
    assert lines > 300
    assert memory() < before + ROOM


def memory() -> int:
    """Bytes that the reading process holds."""
    process = apart._HELPER._process
    return psutil.Process(process.pid).memory_info().rss if process is not None else 0
