"""The pixels of a frame in shares that are traced at the same time: by a GPU's streams, or by threads of a CPU.

While the last rays of one share end, the rays of another continue. A share is every n-th block of threads; each has a
list of undecided pairs of its own. A GPU begins with the blocks in the middle of the image, in an ellipse twice as wide as
high: most scenes have their longest rays there, and nothing is left to do beside those that begin last.
"""

import functools
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import warp as wp
from numpy.typing import NDArray

from ....harness.frame.frame import Frame
from ....harness.frame.schedule.passes import Hints, Pass
from ....harness.frame.schedule.threads import Launch, at_once
from ..constants import BLOCK

WARPS = BLOCK // 32


def blocks_of(width: int, height: int, middle_first: bool) -> NDArray[np.int32]:
    """The tiles of an image as :class:`Shares` has them, [blocks, warps], row by row, or nearest to the middle first."""
    rows, columns = np.divmod(np.arange(-(-width // 8) * -(-height // 4)), -(-width // 8))
    tiles = np.pad(columns | rows << 16, (0, -len(rows) % WARPS), constant_values=-1).reshape(-1, WARPS)
    if middle_first:
        away = (8 * columns - width // 2) ** 2 + (8 * rows - height) ** 2
        tiles = tiles[np.argsort(away[::WARPS], kind="stable")]
    return tiles.astype(np.int32)


class Shares:
    """``count`` shares of a frame's pixels.

    threads  threads that each takes, in whole blocks
    tiles    of each the pixels of its warps, int32 [threads / 32]: column | row << 16 of 8 x 4 pixels, or -1
    """

    def __init__(self, frame: Frame, count: int):
        self.count = count
        self.threaded = wp.get_device(frame.device).is_cpu
        blocks = blocks_of(frame.width, frame.height, not self.threaded)
        self.threads = BLOCK * -(-len(blocks) // count)
        shared = (blocks[share::count].ravel() for share in range(count))
        padded = (np.pad(own, (0, self.threads // 32 - len(own)), constant_values=-1) for own in shared)
        self.tiles = [wp.array(own, dtype=wp.int32, device=frame.device) for own in padded]

    def of(self, share: int) -> str:
        """The ending of the names of a share's passes and resources."""
        return f", share {share + 1} of {self.count}" if self.count > 1 else ""

    def launch(self, work: Callable[[int], None]) -> Launch:
        """A launch of ``work(share)`` for all shares, on a CPU each in a thread of its own."""
        return at_once([functools.partial(work, share) for share in range(self.count)])

    def passes(self, of_share: Callable[[int], list[Pass]]) -> list[Pass]:
        """The passes ``of_share`` of all shares, which run concurrently, after what was made for them.

        Threads of a CPU take the shares of one pass.
        """
        passes: list[Pass] = []
        for steps in zip(*(of_share(share) for share in range(self.count)), strict=True):
            if self.threaded:
                passes.append(self._in_threads(steps))
            elif self.count > 1:
                passes += (
                    replace(step, hints=Hints(parallel=(share,), phase=1), adds=True)
                    for share, step in enumerate(steps)
                )
            else:
                passes += steps
        return passes

    def _in_threads(self, steps: Sequence[Pass]) -> Pass:
        """The same step of all shares as one pass."""
        return replace(
            steps[0],
            name=steps[0].name.removesuffix(self.of(0)),
            reads=tuple(dict.fromkeys(name for step in steps for name in step.reads)),
            writes=tuple(dict.fromkeys(name for step in steps for name in step.writes)),
            launch=at_once([step.launch for step in steps]),
        )
