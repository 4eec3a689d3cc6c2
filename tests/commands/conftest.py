"""What tests of several commands share: methods made for the purpose, and a small mesh."""

from __future__ import annotations

import pytest
from helpers.right_and_wrong_methods import INSTALLED, ball_file
from shadowbench.harness.frame import registry


@pytest.fixture
def right_and_wrong(monkeypatch):
    """The methods of :mod:`helpers.right_and_wrong_methods`, as if they were installed."""
    monkeypatch.setattr(registry, "_entry_points", lambda: INSTALLED)


@pytest.fixture(scope="module")
def mesh(tmp_path_factory) -> str:
    return ball_file(tmp_path_factory.mktemp("meshes"))
