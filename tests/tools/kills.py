"""Kills at random moments: whatever is killed, a resumed run has every record whole, nothing twice, and leaves nothing.

    python tests/tools/kills.py --kills 100 --seed 1
    python tests/tools/kills.py --kills 20 --cluster 1.0              all of them on a Dask worker of this machine

A run of two scenes with two methods is started, and one of its processes is killed (SIGKILL) at a random moment: the run
itself, a method's worker, a grader, the guard of one of them, the Dask worker. The same command is given again until the
run is finished (``helpers/kills.py``). Then its records, rounds, scores and answers are compared with those of a run that
nobody disturbed, and its files, the folder for temporary files, and the processes of the machine are searched
for what was left behind. Exit code 1 where something was found.
"""

import argparse
import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # as a program it finds the tests' helpers, too

from helpers.kills import Kills, kill_and_resume


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--kills", type=int, default=100)
    parser.add_argument("--seed", type=int, default=int(time.time()), help="default: by the clock; it is printed")
    parser.add_argument("--cluster", type=float, default=0.3, help="share of the kills in runs with --cluster local")
    given = parser.parse_args()
    print(f"seed {given.seed}", flush=True)
    began, found = time.monotonic(), Kills()
    clustered = round(given.kills * given.cluster)
    with tempfile.TemporaryDirectory(prefix="shadowbench-kills-") as folder:
        for cluster, kills in ((False, given.kills - clustered), (True, clustered)):
            what = "with --cluster local" if cluster else "on one machine"
            if kills:
                place = Path(folder) / ("cluster" if cluster else "alone")
                kill_and_resume(
                    place,
                    kills,
                    given.seed,
                    cluster,
                    found,
                    lambda text, what=what: print(f"{what}: {text}", flush=True),
                )
    print(f"{found.count} kills, {found.resumed} resumed, {found.finished} finished, {time.monotonic() - began:.0f} s")
    for (process, doing), count in sorted(found.kills.items()):
        print(f"{count:4} of the {process} while {doing}")
    print(f"{len(found.findings)} findings", *found.findings, sep="\n")
    return int(bool(found.findings))


if __name__ == "__main__":
    sys.exit(main())
