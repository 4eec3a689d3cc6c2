"""The pixels of a frame in shares that are traced at the same time: by a GPU's streams, or by threads of a CPU.

While the last rays of one share end, the rays of another continue. A share is every n-th block of threads; each has a
list of undecided pairs of its own. A block has 16 x 8 pixels, so that its warps have ways of like length. Blocks come
square by square from the middle of the image outwards, in an ellipse twice as wide as high: most scenes have their longest
rays there. Of a small mesh a GPU sorts the squares in each frame (:mod:`.order`).
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
MOST_SQUARES = 2048


def side_of(width: int, height: int) -> int:
    """Pixels along a side of the squares of an image: 32, or twice as many until there are at most MOST_SQUARES."""
    side = 32
    while -(-width // side) * -(-height // side) > MOST_SQUARES:
        side *= 2
    return side


def squares_of(width: int, height: int) -> NDArray[np.int32]:
    """The squares of an image, nearest to the middle first: column | row << 16."""
    side = side_of(width, height)
    columns, rows = -(-width // side), -(-height // side)
    column, row = np.arange(columns), np.arange(rows)[:, None]
    away = (2 * column + 1 - columns) ** 2 + (2 * (2 * row + 1 - rows)) ** 2
    return (column | row << 16).ravel()[np.argsort(away, axis=None, kind="stable")].astype(np.int32)


def tiles_of(squares: NDArray[np.int32], side: int) -> NDArray[np.int32]:
    """The tiles of squares, [squares, side^2 / 32], four of 16 x 8 pixels after another: column | row << 16 of 8 x 4
    pixels.
    """
    four, k = np.divmod(np.arange(side * side // 32), 4)
    row, column = np.divmod(four, side // 16)
    tiles = 2 * column + k % 2 | (2 * row + k // 2) << 16
    corners = (squares & 0xFFFF) * (side // 8) | (squares >> 16) * (side // 4) << 16
    return (corners[:, None] + tiles).astype(np.int32)


class Shares:
    """``count`` shares of a frame's pixels.

    squares    int32 [squares]: :func:`squares_of` the image
    ordered    int32 [squares, tiles]: :func:`tiles_of` them
    side       pixels along a side of a square
    threads    threads that each share takes, in whole blocks
    all_tiles  int32 [count * threads / 32]: the pixels of each warp, share by share: a tile, or -1
    tiles      of each share its own
    """

    def __init__(self, frame: Frame, count: int):
        self.count = count
        self.threaded = wp.get_device(frame.device).is_cpu
        self.squares, self.side = squares_of(frame.width, frame.height), side_of(frame.width, frame.height)
        self.ordered = tiles_of(self.squares, self.side)
        blocks = self.ordered.reshape(-1, WARPS)
        blocks = np.pad(blocks, ((0, -len(blocks) % count), (0, 0)), constant_values=-1)
        dealt = blocks.reshape(-1, count, WARPS).swapaxes(0, 1).reshape(count, -1)
        self.threads = 32 * dealt.shape[1]
        self.all_tiles = wp.array(dealt.ravel(), dtype=wp.int32, device=frame.device)
        self.tiles = [self.all_tiles[k * dealt.shape[1] : (k + 1) * dealt.shape[1]] for k in range(count)]

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
