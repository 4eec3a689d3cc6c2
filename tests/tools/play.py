"""Sequences of frames by the thousand: what has played equals what is fresh, bit for bit, and no answer is wrong.

    python tests/tools/play.py --frames 10000 --seed 1
    python tests/tools/play.py --frames 10000 --effects               scenes with spots, holes, mirrors
    python tests/tools/play.py --seconds 120 --device cuda:0          frames are replayed graphs

Each story (``helpers/stories.py``) is played by every method as it is, and with trees and occluders kept over frames. A
session that went through all earlier frames, and one that ran only the passes whose inputs changed, must give the bits
of a session made for the frame alone; the answers of methods that call themselves exact must have no true error. At
the end a story is played again and again: live memory must stay what it is. A failure is found again by its seed.
Exit code 1 where something was found.
"""

import argparse
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # as a program it finds the tests' helpers, too

from helpers.played_stories import Judging, Player, grown_memory, keeps_still, play, players
from helpers.stories import draw_story
from shadowbench.harness.frame.devices import start_warp

STORY = 20
"""Frames of a story."""

MOST_FINDINGS = 20


def played(seed: int, chosen: list[Player], device: str, effects: bool) -> list[str]:
    """Every method on one story, and those for meshes that do not move on one whose mesh does not."""
    found = []
    for still in (False, True):
        story = draw_story(seed, STORY, still, effects=effects)
        judging = Judging(story)
        for player in chosen:
            if keeps_still(player) == still:
                found += [f"seed {seed}: {one}" for one in play(player, story, device, judging)]
    return found


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--frames", type=int, default=1_000_000, help="stop after so many, over all methods")
    parser.add_argument("--seconds", type=float, default=1e9, help="stop after so long")
    parser.add_argument("--seed", type=int, default=int(time.time()), help="default: by the clock; it is printed")
    parser.add_argument("--method", action="append", help="repeatable; default: all")
    parser.add_argument(
        "--effects", action="store_true", help="spots, holes, mirrors: their kernels are compiled first"
    )
    parser.add_argument("--device", default="cpu")
    given = parser.parse_args()
    start_warp()
    chosen = [one for one in players(given.device) if given.method is None or one[0] in given.method]
    if not chosen:
        parser.error(f"argument --method: none of {', '.join(given.method)} runs on {given.device}")
    print(f"seed {given.seed}", flush=True)
    began, seed, frames, found = time.monotonic(), given.seed, 0, []
    while frames < given.frames and time.monotonic() - began < given.seconds and len(found) < MOST_FINDINGS:
        found += played(seed, chosen, given.device, given.effects)
        frames += STORY * len(chosen)
        seed += 1
    print(
        f"seeds {given.seed} to {seed - 1}: {frames} frames of {len(chosen)} methods and ways to keep a tree, "
        f"{time.monotonic() - began:.0f} s"
    )
    for player in chosen:
        more = grown_memory(player, draw_story(given.seed, STORY, keeps_still(player)), given.device)
        if more:
            found.append(f"seed {given.seed}: {player[0]} {player[1]}: memory grows by {more} bytes")
    print(f"{len(found)} findings", *found[:MOST_FINDINGS], sep="\n")
    return int(bool(found))


if __name__ == "__main__":
    sys.exit(main())
