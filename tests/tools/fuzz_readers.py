"""Fuzz the readers of scene files, format by format: bytes changed, and files cut at every position.

    python tests/tools/fuzz_readers.py --cases 3000
    python tests/tools/fuzz_readers.py --only .usdc --cases 3000

Each file must give a mesh or one line, within the limits of its reader, and the process that reads may not grow. Prints what
came of each format. Exit code 1 where one fails.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
import traceback
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from helpers.fuzzed_inputs import READ, REFUSED, STOPPED
from helpers.reader_fuzz import fuzz
from helpers.reader_seeds import seeds
from shadowbench.harness.scene.readers import apart

MIB = 1 << 20
MOST_GROWTH = 200 * MIB


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--cases", type=int, default=3000, help="damaged files of each format")
    parser.add_argument("--cuts", type=int, help="files cut short, of each format; default: at every position")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", action="append", help="an ending; repeatable")
    given = parser.parse_args()
    os.environ.setdefault(apart.TIME, "4")  # some damaged stages make USD's library run for ever
    print("format    cases    read  refused  stopped  longest, s  growth, MiB       s", flush=True)
    failed = 0
    for ending, own in seeds().items():
        if given.only and ending not in given.only:
            continue
        began = time.monotonic()
        with tempfile.TemporaryDirectory() as folder:
            try:
                found = fuzz(ending, own, Path(folder), given.cases, given.cuts or sys.maxsize, given.seed)
            except Exception:
                failed += 1
                print(f"{ending}: {traceback.format_exc()}", flush=True)
                continue
        counts = found.outcomes
        print(
            f"{ending:6} {counts.total():8} {counts[READ]:7} {counts[REFUSED]:8} {counts[STOPPED]:8} "
            f"{found.longest:11.2f} {found.growth / MIB:12.0f} {time.monotonic() - began:7.0f}",
            flush=True,
        )
        failed += found.growth > MOST_GROWTH
    return int(failed > 0)


if __name__ == "__main__":
    sys.exit(main())
