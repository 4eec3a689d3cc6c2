"""The GPU's side of every exact method, run on a CPU: hard cases through ``camera/rows.py``, orders of the lanes
(``warps.py``), and snippets that were broken, also in ``prefetch.py``.
"""

import os
import re
import signal
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import pytest
from helpers.judged_hard_cases import EVERYTHING, exact_methods
from helpers.streams import trial
from helpers.turns import TURN, in_turn
from shadowbench import methods
from shadowbench.harness.frame.registry import make_method
from shadowbench.harness.hardcases import all_cases

from emulated.assembly import INSTRUCTIONS

EMULATED = Path(__file__).parent
EVERY = 1 if EVERYTHING else 29
"""Each method is tried on every so many of the hard cases, in turn; ``make fuzz`` takes all."""

CASES = [case.name for case in all_cases() if not case.large][(TURN or 0) % EVERY :: EVERY]

SHORT = ("ray_grids", "bvh2")
"""The methods of the short suite, a grid and a tree, one in each turn; ``make fuzz`` takes all."""

GPU_METHODS = [
    (name, given)
    for name, given in exact_methods()
    if "cuda" in make_method(name, given).devices
    and (EVERYTHING or (name in SHORT and in_turn(SHORT.index(name), len(SHORT))))
]

SEEDS = (0, 1, 2) if EVERYTHING else (1,)
"""Orders of the lanes: 0 is the plain one, which the settings of ray_grids are tried in."""


def emulated(*arguments: str, seed: int | str = 0) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "EMULATED_SEED": str(seed)}
    command = [sys.executable, str(EMULATED), *arguments]
    return subprocess.run(command, env=environment, capture_output=True, text=True, check=False)


def check(
    method: str, given: dict[str, str], cases: Sequence[str], *options: str, seed: int = 0
) -> subprocess.CompletedProcess[str]:
    settings = [word for key, value in given.items() for word in ("--set", f"{key}={value}")]
    chosen = [word for case in cases for word in ("--case", case)]
    return emulated(*options, "check", method, "--device", "cpu", *settings, *chosen, seed=seed)


def checked(method: str, given: dict[str, str], cases: Sequence[str], seed: int = 0) -> str:
    """What ``shadowbench check`` sums up of a method."""
    done = check(method, given, cases, seed=seed)
    found = re.search(rf"^{method} on cpu: .*", done.stdout, re.MULTILINE)
    assert found, done.stdout + done.stderr
    return found[0]


def test_all_assembly_is_known():
    """Of every snippet, also of those that no hard case here runs."""
    found = set()
    for file in Path(methods.__path__[0]).glob("**/*.py"):
        for statement in re.findall(r"\basm\b[^:]*", file.read_text()):
            found.update(re.findall(r"(?<![.\w])[a-z]+(?:\.[a-z0-9_]+)+", statement))
    instructions = {name for name in found if not name.startswith("setp.")}
    assert {name for name in instructions if not any(name in known for known in INSTRUCTIONS)} == set()
    assert {"sqrt.approx.ftz.f32", "fence.acq_rel.gpu", "ld.shared.v4.f32"} <= instructions


def test_one_name_of_warp_is_used_that_is_not_public():
    """The rest of the emulation outlives another version of Warp, or fails with an AttributeError."""
    files = [file for file in EMULATED.glob("*.py") if file != Path(__file__)]
    lines = [line for file in files for line in file.read_text().splitlines()]
    private = [line for line in lines if re.search(r"\b(?:wp|warp)\.(?:\w+\.)*_[a-z]", line)]
    assert [line.partition("  #")[0] for line in private] == ["from warp._src.context import ModuleBuilder"]


def test_what_threads_exchange_is_what_cuda_defines():
    done = emulated(str(EMULATED / "exchanges.py"))
    assert done.returncode == 0, done.stdout + done.stderr
    assert "23 functions agree" in done.stdout


def test_threads_exchange_the_same_in_other_orders():
    done = emulated(str(EMULATED / "exchanges.py"), seed=5)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.slow
@pytest.mark.parametrize(
    ("broken", "said"),
    [
        ("no wait between lanes", "Arrays are not equal"),
        ("no wait for a copy", "Arrays are not equal"),
        ("the last group is not waited for", "Arrays are not equal"),
        ("shared memory that nobody has written", "Arrays are not equal"),
        ("lanes at another place", "waits without end at s"),
        ("masks that do not agree", "lanes 0000ffff wait for it at shfl"),
        ("a lane outside its mask", "lane 4 is not in its mask 0000000f at shfl"),
        ("different exchanges", "at ballot meets lanes at shfl"),
        ("assembly without translation", "knows no C++ for the assembly 'nop;'"),
    ],
)
def test_broken_uses_are_found(broken, said):
    done = emulated(str(EMULATED / "exchanges.py"), broken)
    assert done.returncode != 0
    assert said in done.stdout + done.stderr


@pytest.mark.parametrize(
    ("arguments", "seed", "said"),
    [
        ([], 0, "usage: "),
        (["--replace", "a"], 0, "usage: "),
        (["none.py"], 0, "no program 'none.py'"),
        (["list", "methods"], "abc", "EMULATED_SEED is a number from 0 on, not 'abc'"),
        (["list", "methods"], -1, "EMULATED_SEED is a number from 0 on, not '-1'"),
    ],
)
def test_broken_uses_of_the_command_are_one_line(arguments, seed, said):
    done = emulated(*arguments, seed=seed)
    assert done.returncode == 1
    assert done.stderr.startswith(said)
    assert done.stderr.count("\n") == 1


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize(("name", "given"), GPU_METHODS, ids=[name for name, _ in GPU_METHODS])
def test_the_side_of_the_gpu_answers_hard_cases_exactly_in_any_order_of_lanes(name, given, seed):
    said = checked(name, given, CASES, seed)
    assert f"{len(CASES)} cases, 0 with true errors" in said


CELLS = trial(cells=640)
"""Offsets of cells: rows longer than a block has threads."""

LISTED = trial(chunk=64, inline_pixels=0)
"""Pairs that warps keep in lists."""

OF_LISTS = ("P30 1000", "P31 1e+06")
"""Cases with many rays in a cell."""

SETTINGS = [
    (CELLS, OF_LISTS),
    (LISTED, OF_LISTS),
    (trial(inline_pixels=0, inline_rays=0, inline_cells=0, chunk=32, groups="split"), CASES[::2]),  # all through queues
    # Rays that are stopped by what stopped them before, and triangles that meet no ray left out, as of many triangles.
    ({"occluders": "last", **trial(shares=3, overlaps="false")}, CASES[::2]),
    *([(trial(region="triangles", spacing="rays", shares=3), CASES), (trial(groups="split"), CASES)] * EVERYTHING),
]


@pytest.mark.slow
@pytest.mark.parametrize(("given", "cases"), SETTINGS, ids=str)
def test_no_setting_of_ray_grids_changes_an_answer(given, cases):
    assert "0 with true errors" in checked("ray_grids", given, cases)


@pytest.mark.parametrize(
    ("tests", "passed"), [("streams/test_cube_rectangle.py", 12), ("trees/test_trees_shares.py", 11)]
)
def test_what_lanes_find_together_is_what_one_thread_finds(tests, passed):
    """Cells where few and many faces have other numbers; the order of blocks."""
    done = emulated(str(EMULATED / "run_tests.py"), str(EMULATED.parent / "methods" / tests), "-m", "not gpu")
    assert done.returncode == 0, done.stdout + done.stderr
    assert f"{passed} passed" in done.stdout


@pytest.mark.slow
def test_trees_are_those_of_a_cpu():
    """Of a block's leaves, one less, one more and several blocks."""
    program = EMULATED / "tree_hashes.py"
    on_cpu = subprocess.run([sys.executable, str(program)], capture_output=True, text=True, check=True)
    found = [
        [line for line in out.splitlines() if "{" in line] for out in (on_cpu.stdout, emulated(str(program)).stdout)
    ]
    assert len(found[0]) == 21
    assert found[0] == found[1]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("given", "old", "new"),
    [
        (CELLS, "for (int k = 0; k < part; k++) before += sums[k];", ""),
        (LISTED, "held += __popc(among);", "held = __popc(among);"),
        (LISTED, 'asm volatile("cp.async.wait_all;" ::: "memory");', ""),
        (LISTED, 'asm volatile("cp.async.wait_group 2;" ::: "memory");', ""),
        # Of an odd number of pairs that a warp keeps, one is decided twice and one never.
        (LISTED, '"r"(kept + 8 * number)', '"r"(kept + 8 * (number ^ 1))'),
    ],
)
def test_a_snippet_that_was_broken_is_found(given, old, new):
    """So these cases run these snippets, and judge what comes of them. A number that nobody wrote may be no place to write
    to.
    """
    done = check("ray_grids", given, OF_LISTS, "--replace", old, new)
    assert "no snippet holds" not in done.stderr
    judged = done.returncode == 1 and "with true errors" in done.stdout
    assert judged or -done.returncode == signal.SIGSEGV, done.stdout + done.stderr
