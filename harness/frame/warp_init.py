"""Start Warp without output on standard output and without its warning on machines that have no GPU."""

from __future__ import annotations

import os
import sys
import tempfile

import warp as wp

NO_DRIVER = "Could not find or load the NVIDIA CUDA driver"
"""Message of Warp's native code on standard error when it starts on a machine without a GPU."""


def start_warp() -> None:
    """Initialise Warp; a second call does nothing. Its output on standard error appears, except :data:`NO_DRIVER`."""
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
