"""What tests of whole runs share: the package of misbehaving methods, and a tiny scene."""

import os

import pytest
from helpers.kept import kept, session_folder
from helpers.tiny_runs import install_misbehaving, write_scene


@pytest.fixture(scope="module")
def package():
    """The package of misbehaving methods, for this process and for its workers."""
    folder = session_folder() / "packages"
    kept("the package of misbehaving methods", lambda: install_misbehaving(folder))
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PYTHONPATH", os.pathsep.join([str(folder), os.environ.get("PYTHONPATH", "")]).rstrip(os.pathsep))
        patch.syspath_prepend(str(folder))
        yield folder


@pytest.fixture(scope="module")
def scene():
    return kept("the tetrahedron", lambda: write_scene(session_folder() / "tetra.obj"))
