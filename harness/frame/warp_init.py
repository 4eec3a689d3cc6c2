"""Start Warp without output on standard output and without its warning on machines that have no GPU."""

from __future__ import annotations

import os
import sys
import tempfile
from pathlib import Path

import warp as wp

from ..errors import UserError

CACHE = "WARP_CACHE_PATH"
"""Warp's environment variable for the folder of compiled kernels."""

NO_DRIVER = "Could not find or load the NVIDIA CUDA driver"
"""Message of Warp's native code on standard error when it starts on a machine without a GPU."""


def start_warp() -> None:
    """Initialise Warp; a second call does nothing. Its output on standard error appears, except :data:`NO_DRIVER`.

    Raises :class:`UserError` where its compiled kernels cannot be written.
    """
    wp.config.log_level = wp.LOG_WARNING
    sys.stderr.flush()
    kept = os.dup(2)
    with tempfile.TemporaryFile() as said:
        os.dup2(said.fileno(), 2)
        try:
            wp.init()
        except OSError as error:
            raise _unwritable(Path(error.filename or "~/.cache"), error.strerror or str(error)) from error
        finally:
            os.dup2(kept, 2)
            os.close(kept)
            said.seek(0)
            for line in said.read().decode(errors="replace").splitlines():
                if NO_DRIVER not in line:
                    print(line, file=sys.stderr)
    place = Path(wp.config.kernel_cache_dir)
    if not os.access(place, os.W_OK | os.X_OK):
        raise _unwritable(place, "no permission")


def kernel_cache() -> Path:
    """The folder of the compiled kernels of this version of Warp."""
    start_warp()
    return Path(wp.config.kernel_cache_dir)


def _unwritable(place: Path, reason: str) -> UserError:
    return UserError(
        f"{place}: compiled kernels cannot be kept there ({reason}); set {CACHE} to a folder that can be written"
    )
