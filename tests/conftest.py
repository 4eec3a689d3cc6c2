"""What holds for every test: the devices it runs on, and a machine lock of its own.

A test of a whole run waits for no run of another test process on this machine.
"""

from __future__ import annotations

import os
import tempfile

import pytest
from helpers.devices import DEVICES
from shadowbench.harness.runner.machine_lock import FOLDER

_turns = tempfile.TemporaryDirectory(prefix="shadowbench-turns-")
os.environ[FOLDER] = _turns.name


@pytest.fixture(params=DEVICES)
def device(request: pytest.FixtureRequest) -> str:
    """The CPU, then a GPU; without one that half is skipped with its reason."""
    return request.param
