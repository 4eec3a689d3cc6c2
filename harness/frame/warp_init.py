"""Starting Warp without chatter: nothing on standard output, and no warning that a machine without a GPU has none."""

from __future__ import annotations

import os
import sys
import tempfile

import warp as wp

NO_DRIVER = "Could not find or load the NVIDIA CUDA driver"
"""Warp's native code says so on standard error whenever it starts on a machine without a GPU."""


def start_warp() -> None:
    """Initialise Warp (again does nothing). Whatever it says on standard error but :data:`NO_DRIVER` is passed on."""
    wp.config.log_level = wp.LOG_WARNING
    sys.stderr.flush()
    kept = os.dup(2)
    with tempfile.TemporaryFile() as said:
        os.dup2(said.fileno(), 2)
        try:
            wp.init()
        finally:
            os.dup2(kept, 2)
            os.close(kept)
            said.seek(0)
            for line in said.read().decode(errors="replace").splitlines():
                if NO_DRIVER not in line:
                    print(line, file=sys.stderr)
