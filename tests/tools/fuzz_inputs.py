"""Fuzz what comes from elsewhere: files of scenes, records, packages of methods, archives, messages of a page.

    python tests/tools/fuzz_inputs.py --cases 40000
    python tests/tools/fuzz_inputs.py --only files --first 17 --cases 1       # the same case again

Every case must end in an answer or in one line, in time, within the memory, and without the end of this process. A case is
made from the seed and its number alone. The inputs of those that fail are kept, and of those that stopped the reader of a
file: these are faults of a reader, from which the program is protected.
"""

import argparse
import contextlib
import io
import resource
import shutil
import sys
import tempfile
import time
import traceback
from collections import Counter
from pathlib import Path
from random import Random

sys.path.insert(0, str(Path(__file__).parents[1]))

from helpers.fuzzed_inputs import STOPPED, Family, at_most, families

GIB = 1 << 30
SECONDS = 120
"""The longest that a case may take. A reader has a limit of its own, which the environment lowers here."""


def family_of(rng: Random, weighted: dict[str, tuple[Family, int]]) -> str:
    """The family of a case."""
    return rng.choices(list(weighted), [weight for _, weight in weighted.values()])[0]


def main() -> int:
    """Run the cases; 1 if one failed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=int, default=1000)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", help="one family: files, records, ...")
    parser.add_argument("--seeds", type=Path, help="a folder with more files of scenes to damage")
    parser.add_argument("--memory", type=float, default=3.0, help="GiB that this process may take")
    parser.add_argument("--keep", type=Path, default=Path("build/fuzz"), help="folder for inputs that failed")
    given = parser.parse_args()
    _, hard = resource.getrlimit(resource.RLIMIT_AS)
    weighted = families(given.seeds)
    if given.only:
        weighted = {given.only: weighted[given.only]}
    now = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (now + int(given.memory * GIB), hard))
    counts: Counter[str] = Counter()
    failed, began = 0, time.monotonic()
    for number in range(given.first, given.first + given.cases):
        rng = Random(f"{given.seed} {number}")
        name = family_of(rng, weighted)
        place = Path(tempfile.mkdtemp(prefix="fuzz-"))
        said, error = io.StringIO(), ""
        try:
            with at_most(SECONDS), contextlib.redirect_stderr(said):
                outcome = weighted[name][0](rng, place)
        except Exception:
            outcome, error = "failed", traceback.format_exc()
        if "\x1b" in said.getvalue():
            outcome, error = "failed", "a terminal's code on standard error"
        counts[f"{name}: {outcome}"] += 1
        if error or outcome == STOPPED:
            kept = given.keep / f"{number}-{outcome.replace(' ', '-')}"
            shutil.rmtree(kept, ignore_errors=True)
            shutil.copytree(place, kept)
            (kept / "why.txt").write_text(error or "the reader of the file was stopped\n")
        if error:
            failed += 1
            print(f"case {number}, {name}: {error.strip().splitlines()[-1]} (kept: {kept})", flush=True)
        shutil.rmtree(place, ignore_errors=True)
        if (number + 1) % 1000 == 0:
            print(f"{number + 1 - given.first} cases, {time.monotonic() - began:.0f} s, {failed} failed", flush=True)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
    for what, count in sorted(counts.items()):
        print(f"{count:7d}  {what}")
    print(f"{given.cases} cases, {failed} failed, peak memory {peak / GIB:.2f} GiB, {time.monotonic() - began:.0f} s")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
