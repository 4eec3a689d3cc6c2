"""USD files, which hold scenes: transforms, instances and visibility; broken ones are one line."""

import numpy as np
import pytest
from helpers import mesh_files as files
from helpers.mesh_files import refused, written
from shadowbench.harness.scene.readers import usd
from shadowbench.harness.scene.readers.load import load


@pytest.mark.skipif(not usd.available(), reason="usd-core is not installed")
def test_usd_fans_transforms_visibility_and_up(tmp_path):
    loaded = load(written(tmp_path, "a.usda", files.USDA))
    assert loaded.faces.tolist() == [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 1, 4]]
    assert np.array_equal(loaded.frames[0], files.QUAD + np.float32([10, 0, 0]))
    assert loaded.up == (0, 0, 1)


@pytest.mark.skipif(not usd.available(), reason="usd-core is not installed")
@pytest.mark.parametrize(
    ("old", "new", "word"),
    [
        ("[5, 3]", "[5, 2]", "face 1 has 2 vertices"),
        ("[5, 3]", "[5, 3, 3]", "11 corners are declared"),
        ("[0, 1, 2, 3, 4, 0, 1, 4]", "[0, 1, 2, 3, 9, 0, 1, 4]", "vertex 9"),
        ("def Mesh", "def Xform", "no visible mesh"),
        ("#usda 1.0", "#usda", "USD"),
    ],
)
def test_broken_usd_files(tmp_path, old, new, word):
    refused(written(tmp_path, "a.usda", files.USDA.replace(old, new)), word)


def test_without_usd_core_the_line_says_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setattr(usd, "available", lambda: False)
    refused(written(tmp_path, "a.usda", files.USDA), "usd-core", "pip install")
