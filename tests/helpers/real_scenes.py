"""The folder of real meshes for tests: that of SHADOWBENCH_SCENES, else ``shared/scenes`` beside the checkout."""

import os
from pathlib import Path

import pytest

VARIABLE = "SHADOWBENCH_SCENES"
REAL = Path(os.environ.get(VARIABLE) or Path(__file__).resolve().parents[3] / "shared" / "scenes")
MESHES = sorted(REAL.glob("*.ply"))

needs_real = pytest.mark.skipif(
    not MESHES, reason=f"no folder of real meshes; name one in the environment variable {VARIABLE}"
)
