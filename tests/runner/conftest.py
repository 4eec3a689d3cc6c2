"""What tests of whole runs share: the package of misbehaving methods, and a tiny scene."""

import pytest
from helpers.tiny_runs import install_misbehaving, write_scene


@pytest.fixture(scope="module")
def package(tmp_path_factory):
    """The package of misbehaving methods, for this process and for its workers."""
    folder = tmp_path_factory.mktemp("packages")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PYTHONPATH", install_misbehaving(folder))
        patch.syspath_prepend(str(folder))
        yield folder


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    return write_scene(tmp_path_factory.mktemp("scenes") / "tetra.obj")
