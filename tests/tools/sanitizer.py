"""Every method's frames under NVIDIA's compute-sanitizer: accesses out of bounds, races in shared memory, and the like.

    python tests/tools/sanitizer.py --tool memcheck                 every method, at its default settings
    python tests/tools/sanitizer.py --tool racecheck --method ray_grids
    python tests/tools/sanitizer.py --tool memcheck --graphs        each frame also as a replayed graph
    python tests/tools/sanitizer.py --tool initcheck --planted      errors that the tool must find, in place of methods
    python tests/tools/sanitizer.py --tool none                     without the sanitizer: compiles the kernels

A method runs four frames of a moving scene at 32 x 32 pixels by plain launches, then again with every initial capacity
at 1, so that buffers overflow and grow. Warp's memory pools are off: each array is an allocation of its own, and the
sanitizer puts a gap behind it. Needs a CUDA device and compute-sanitizer. Exit code 1 where an error was found.
"""

import argparse
import hashlib
import re
import shutil
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import warp as wp

SIDE = 32
ERROR_EXIT = 99
"""Exit code that the sanitizer is asked to give where it found an error."""

GAP = 256
"""Bytes left unused behind each allocation, so that an access a little past the end is one out of bounds."""

TOOLS = ("memcheck", "racecheck", "initcheck", "synccheck")
LINES_SHOWN = 24

PLANTED = "planted errors"
"""Stands for a method whose kernel is wrong."""


def frames(name: str, device: str, graphs: bool) -> str:
    """Run a method's frames; a digest of all answers, so that two runs may be compared. Or why it does not run."""
    from shadowbench.harness.frame.devices import start_warp
    from shadowbench.harness.frame.registry import make_method, method_class, parameters
    from shadowbench.harness.frame.session import Session
    from shadowbench.harness.hardcases.conformance import moving_scene

    start_warp()
    if wp.get_device(device).is_cuda and not graphs:  # a graph that allocates needs the pools
        wp.set_mempool_enabled(device, False)
    prepared = moving_scene()
    reason = make_method(name).applies(prepared.scene, device)
    if reason:
        return f"not run: {reason}"
    small = {one.name: "1" for one in parameters(method_class(name)) if one.name.endswith("capacity")}
    digests = []
    for settings in ({}, small) if small else ({},):
        digest = hashlib.sha256()
        session = Session(make_method(name, settings), prepared, SIDE, SIDE, device)
        for frame in range(prepared.frame_count):
            answers = session.answers(prepared.moment(frame, SIDE, SIDE))
            if graphs and session.replays:
                session.replay()
                answers = session.frame.answers.to_host()
            for key in sorted(answers):
                digest.update(answers[key].tobytes())
        digests.append(f"{digest.hexdigest()[:12]} (grown {session.regrown} times)")
    return ", ".join(digests)


def planted(device: str, graphs: bool) -> str:
    """A read of memory that nobody wrote, a write behind the end of an array, and threads of a block that exchange values in
    shared memory without a barrier; launched, or replayed from a graph.
    """

    @wp.func_native("""
    __shared__ int seat[64];
    seat[threadIdx.x] = i;
    values.data[i] = seat[63 - threadIdx.x];
    """)
    def exchange(values: wp.array(dtype=wp.int32), i: wp.int32): ...

    @wp.kernel(enable_backward=False, module="unique")
    def wrong(values: wp.array(dtype=wp.int32), unwritten: wp.array(dtype=wp.int32)):
        i = wp.tid()
        exchange(values, i)
        values[i + 1] = i + (unwritten[i] & 1)

    wp.set_mempool_enabled(device, False)
    values = wp.zeros(64, dtype=wp.int32, device=device)
    unwritten = wp.empty(64, dtype=wp.int32, device=device)

    def launched() -> None:
        wp.launch(wrong, dim=64, inputs=[values, unwritten], device=device, block_dim=64)

    if graphs:
        wp.load_module(module=wrong.module, device=device, block_dim=64)
        with wp.ScopedCapture(device, force_module_load=False) as capture:
            launched()
        wp.capture_launch(capture.graph)
    else:
        launched()
    wp.synchronize_device(device)
    return f"{int(np.count_nonzero(values.numpy()))} of 64 written"


def watched(name: str, tool: str, device: str, graphs: bool, seconds: float) -> tuple[int, str]:
    """The exit code of a process that runs :func:`frames` under a tool, and what it printed."""
    command = [sys.executable, str(Path(__file__).resolve()), "--frames", name, "--device", device]
    command += ["--graphs"] if graphs else []
    if tool != "none":
        found = shutil.which("compute-sanitizer") or "/usr/local/cuda/bin/compute-sanitizer"
        prefix = [found, "--tool", tool, "--error-exitcode", str(ERROR_EXIT), "--print-limit", "5"]
        command = [*prefix, *(["--padding", str(GAP)] if tool == "memcheck" else []), *command]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=seconds, check=False)
    except subprocess.TimeoutExpired as error:
        return 124, f"no answer within {seconds:.0f} s: {str(error.stdout or '')[-500:]}"
    except FileNotFoundError:
        return 127, f"{command[0]} was not found; name its folder in PATH"
    return done.returncode, done.stdout + done.stderr


def summary(name: str, code: int, text: str, seconds: float) -> str:
    """One line where all is well, else the first lines of what the sanitizer says."""
    answers = re.search(r"^answers: (.*)$", text, re.MULTILINE)
    errors = re.search(r"(ERROR|RACECHECK) SUMMARY: .*$", text, re.MULTILINE)
    said = f"{answers.group(1) if answers else 'no answers'}; {errors.group(0) if errors else 'no summary'}"
    line = f"{name}: {'ok' if code == 0 else f'exit code {code}'}; {said}; {seconds:.0f} s"
    return line if code == 0 else "\n    ".join([line, *text.splitlines()[:LINES_SHOWN]])


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--tool", choices=("none", *TOOLS), default="memcheck")
    parser.add_argument("--method", action="append", help="repeatable; default: all")
    parser.add_argument("--device", default="cuda:0")
    parser.add_argument("--graphs", action="store_true", help="each frame also as a replayed graph")
    parser.add_argument("--jobs", type=int, default=4, help="methods at the same time")
    parser.add_argument("--seconds", type=float, default=600.0, help="limit of a method")
    parser.add_argument("--planted", action="store_true", help="errors that the tool must find, in place of methods")
    parser.add_argument("--frames", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.frames == PLANTED:
        print(f"answers: {planted(given.device, given.graphs)}", flush=True)
        return 0
    if given.frames:
        print(f"answers: {frames(given.frames, given.device, given.graphs)}", flush=True)
        return 0
    from shadowbench.harness.frame.registry import method_names

    def one(name: str) -> int:
        began = time.monotonic()
        code, text = watched(name, given.tool, given.device, given.graphs, given.seconds)
        print(summary(name, code, text, time.monotonic() - began), flush=True)
        return code

    if given.planted:
        return int(one(PLANTED) != ERROR_EXIT)
    with ThreadPoolExecutor(given.jobs) as pool:
        return int(any(list(pool.map(one, given.method or method_names()))))


if __name__ == "__main__":
    sys.exit(main())
