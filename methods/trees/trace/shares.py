"""The pixels of a frame in shares that are traced at the same time: by a GPU's streams, or by threads of a CPU.

While the last rays of one share end, the rays of another continue. A share is every n-th block of threads; each has a
list of undecided pairs of its own.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from dataclasses import replace

import warp as wp

from ....harness.frame.frame import Frame
from ....harness.frame.geometry import filled
from ....harness.frame.schedule.passes import Hints, Pass
from ....harness.frame.schedule.threads import Launch, at_once
from ...common.pixels import thread_count
from ..constants import BLOCK
from .closest import Part


class Shares:
    """``count`` shares of a frame's pixels.

    threads  threads that each takes, in whole blocks
    parts    of each what its kernels take (:class:`.closest.Part`)
    """

    def __init__(self, frame: Frame, count: int):
        self.count = count
        self.threaded = wp.get_device(frame.device).is_cpu
        blocks = -(-thread_count(frame.width, frame.height) // BLOCK)
        self.threads = BLOCK * -(-blocks // count)
        self.parts = [filled(Part, share=share, shares=count) for share in range(count)]

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
