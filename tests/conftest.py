"""What holds for every test: the devices it runs on, and a machine lock of its own.

A test of a whole run waits for no run of another test process on this machine.
"""

import gc
import os
import signal
import sys
import tempfile

import pytest
from helpers.devices import DEVICES
from shadowbench.harness.runner.machine.lock import FOLDER

_turns = tempfile.TemporaryDirectory(prefix="shadowbench-turns-")
os.environ[FOLDER] = _turns.name

# A program that is started in the background has this signal ignored, and so would have the runs that tests interrupt.
signal.signal(signal.SIGINT, signal.default_int_handler)

# Source is compiled once for the many Python processes that tests start, whatever this environment says.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """What takes the longest, or compiles the most, stands first in each half of the tests: of two processes each begins
    with one half, and takes from the end of the other's when it is done."""
    emulated, hard, others = [], [], []
    for item in items:
        folder = item.path.parent.name
        (emulated if folder == "emulated" else hard if folder in ("hardcases", "properties") else others).append(item)
    rest = max(0, len(items) // 2 - len(emulated))
    items[:] = [*emulated, *others[:rest], *hard, *others[rest:]]


def pytest_collection_finish() -> None:
    """What was imported stays to the end: a search for garbage, which every judged answer begins with, need not visit it."""
    import hypothesis  # noqa: F401  (it looks at who refers to generators as it is imported: frozen ones are not found)

    gc.collect()
    gc.freeze()


@pytest.fixture(params=DEVICES)
def device(request: pytest.FixtureRequest) -> str:
    """The CPU, then a GPU; without one that half is skipped with its reason."""
    return request.param
