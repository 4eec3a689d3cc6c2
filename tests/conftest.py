"""What holds for every test: the devices it runs on, and a machine lock of its own.

A test of a whole run waits for no run of another test process on this machine.
"""

import gc
import io
import os
import signal
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import warp as wp
from helpers.called_command import exit_code
from helpers.devices import DEVICES
from helpers.kept import PLACE
from helpers.turns import PARTS, in_turn
from shadowbench.harness.errors import UserError
from shadowbench.harness.runner.machine.lock import FOLDER

gc.disable()  # until all tests are imported

_turns = tempfile.TemporaryDirectory(prefix="shadowbench-turns-")
os.environ[FOLDER] = _turns.name

if PLACE not in os.environ:  # the first of the test processes
    _session = tempfile.TemporaryDirectory(prefix="shadowbench-session-")
    os.environ[PLACE] = _session.name

# A program that is started in the background has this signal ignored, and so would have the runs that tests interrupt.
signal.signal(signal.SIGINT, signal.default_int_handler)

# Source is compiled once for the many Python processes that tests start, whatever this environment says.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False

# A kernel that tests launch a few times takes longer to compile than to run. Warp's own flags inline up to nine times as
# much: kernels take a third longer to compile, and at most 7 % less to run. No bit of an answer depends on what is inlined.
if wp.config.optimization_level is None:  # the emulated GPU has flags of its own
    wp.config.cpu_compiler_flags = "-march=native -mllvm=-inline-threshold=1000"


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    leave_to_other_turns(items)
    begin_with_the_longest(items)


def leave_to_other_turns(items: list[pytest.Item]) -> None:
    """Slow tests that have their turn another time (:mod:`helpers.turns`) are skipped, which is told."""
    for place, item in enumerate(item for item in items if item.get_closest_marker("slow")):
        if not in_turn(place, PARTS):
            item.add_marker(pytest.mark.skip(reason="has another turn (make test-all)"))


def begin_with_the_longest(items: list[pytest.Item]) -> None:
    """What takes the longest, or compiles the most, stands first in the parts of the tests with which the first two
    processes begin; who is done takes from the end of another's part.
    """
    processes = int(os.environ.get("PYTEST_XDIST_WORKER_COUNT", "1"))
    hard, emulated, others = [], [], []
    for item in items:
        folder = item.path.parent.name
        (emulated if folder == "emulated" else hard if folder in ("hardcases", "properties") else others).append(item)
    arranged: list[pytest.Item] = []
    for part, first in enumerate([hard, emulated], 1):
        arranged += first
        room = max(0, len(items) * part // processes - len(arranged))
        arranged += others[:room]
        del others[:room]
    items[:] = arranged + others


@pytest.hookimpl(tryfirst=True)
def pytest_runtestloop() -> None:
    """What was imported stays to the end: a search for garbage, which every judged answer begins with, need not visit it."""
    import hypothesis  # noqa: F401  (it looks at who refers to generators as it is imported: frozen ones are not found)

    gc.collect()
    gc.freeze()
    gc.enable()


@pytest.fixture
def unpainted(monkeypatch: pytest.MonkeyPatch) -> None:
    """Drawings are put together and not painted, which takes a third of the time: pictures are files of nothing."""
    from matplotlib.figure import Figure
    from PIL import Image

    def save(figure: Figure, to: Path | io.StringIO, **_: object) -> None:
        if isinstance(to, io.StringIO):
            to.write("<svg/>")
        else:
            Image.new("RGB", (1, 1)).save(to)

    monkeypatch.setattr(Figure, "savefig", save)


@pytest.fixture(params=DEVICES)
def device(request: pytest.FixtureRequest) -> str:
    """The CPU, then a GPU; without one that half is skipped with its reason."""
    return request.param


@pytest.fixture
def call(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Callable[..., tuple[int, str, str]]:
    """Run a command in this process: exit code, standard output, standard error."""

    def run(*words: object) -> tuple[int, str, str]:
        code = exit_code(monkeypatch, *words)
        said = capsys.readouterr()
        return code, said.out, said.err

    return run


@pytest.fixture
def refused_call(call: Callable[..., tuple[int, str, str]]) -> Callable[..., str]:
    """Run a command that ends with exit code 2, prints nothing and says why in one line, which is returned."""

    def run(*words: object) -> str:
        code, out, err = call(*words)
        assert (code, out, err.count("\n")) == (2, "", 1), err
        return err

    return run


@pytest.fixture(autouse=True)
def refusals_of_one_line() -> Iterator[None]:
    """Every refusal that a test provokes in this process is one line, whatever else the test looks at."""
    longer: list[str] = []

    def made(error: UserError, *given: object) -> None:
        Exception.__init__(error, *given)
        longer.extend(text for text in map(str, given) if "\n" in text)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(UserError, "__init__", made)
        yield
    assert longer == []
