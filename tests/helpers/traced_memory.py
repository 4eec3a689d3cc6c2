"""The memory that Python and numpy take in a block of a test."""

import contextlib
import tracemalloc
from collections.abc import Callable, Iterator


@contextlib.contextmanager
def traced_memory() -> Iterator[Callable[[], int]]:
    """In the block the call that it gives tells the most bytes that were held at once since its beginning."""
    tracemalloc.start()
    try:
        yield lambda: tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
