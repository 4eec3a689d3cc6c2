"""Waiting for what must happen."""

import time
from collections.abc import Callable
from typing import Any

PATIENCE_S = 120.0
"""How long at most: the machine may have much else to do."""


def until(there: Callable[[], Any], what: str, seconds: float = PATIENCE_S) -> Any:
    """Wait for something, and return it."""
    end = time.monotonic() + seconds
    while not (found := there()):
        assert time.monotonic() < end, f"waited in vain for {what}"
        time.sleep(0.02)
    return found
