"""A tiny scene for tests of folders that a run writes to."""

import pytest
from helpers.tiny_runs import write_scene


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    return write_scene(tmp_path_factory.mktemp("scenes") / "tetra.obj")
