"""What tests of several commands share: methods made for the purpose, and small meshes."""

import pytest
from helpers.right_and_wrong_methods import INSTALLED, ball_file
from helpers.tiny_runs import write_scene
from shadowbench.harness.commands import answering
from shadowbench.harness.frame import registry


@pytest.fixture
def scene(tmp_path):
    return write_scene(tmp_path / "tetra.obj")


@pytest.fixture
def right_and_wrong(monkeypatch):
    """The methods of :mod:`helpers.right_and_wrong_methods`, as if they were installed; frames are repeated twice only."""
    monkeypatch.setattr(registry, "_entry_points", lambda: INSTALLED)
    monkeypatch.setattr(answering, "REPEATS", 2)


@pytest.fixture(scope="module")
def mesh(tmp_path_factory) -> str:
    return ball_file(tmp_path_factory.mktemp("meshes"))
