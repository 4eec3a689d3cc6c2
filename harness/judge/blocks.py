"""Work on many rays, a block on each processor: NumPy and Embree release the interpreter lock while they compute."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

from ..frame.schedule.threads import processors

BLOCK = 1 << 15
"""Rays of a block: its temporary arrays fit into a processor's cache."""


def in_blocks(count: int, work: Callable[[slice], None]) -> None:
    """Call ``work`` on slices of ``count`` rays, on every processor."""
    blocks = [slice(start, min(start + BLOCK, count)) for start in range(0, count, BLOCK)]
    with ThreadPoolExecutor(processors()) as pool:
        list(pool.map(work, blocks))
