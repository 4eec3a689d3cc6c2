"""Start Warp without output on standard output and without its warning on machines that have no GPU."""

import os
import platform
import sys
import tempfile
from hashlib import sha256
from pathlib import Path

import warp as wp

from ..errors import UserError

CACHE = "WARP_CACHE_PATH"  # Warp's environment variable for the folder of compiled kernels

NO_DRIVER = "Could not find or load the NVIDIA CUDA driver"
"""Message of Warp's native code on standard error when it starts on a machine without a GPU."""


def start_warp() -> None:
    """Initialise Warp; a second call does nothing. Its output on standard error appears, except :data:`NO_DRIVER`.
    Raises :class:`UserError` where its compiled kernels cannot be written."""
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
    _share_headers(place)


def _share_headers(place: Path) -> None:
    """Let all processes that compile kernels for the CPU use one precompiled copy of Warp's headers, beside the
    kernels. By itself Warp makes a copy for each process, in three seconds. A copy holds for one installation on one
    machine; Warp replaces one that does not fit."""
    from warp._src.context import runtime  # no public name says where the copy is

    if not hasattr(runtime, "get_clang_pch_dir"):
        return  # another version of Warp: each process makes its own
    installed = Path(wp.__file__).parent / "native" / "builtin.h"
    about = f"{platform.node()} {installed} {installed.stat().st_mtime_ns}"
    folder = place / f"wp_headers_{sha256(about.encode()).hexdigest()[:8]}"

    def headers() -> str:
        folder.mkdir(exist_ok=True)  # again, where it was cleared meanwhile
        return str(folder)

    runtime.get_clang_pch_dir = headers


def kernel_cache() -> Path:
    """The folder of the compiled kernels of this version of Warp."""
    start_warp()
    return Path(wp.config.kernel_cache_dir)


def _unwritable(place: Path, reason: str) -> UserError:
    return UserError(
        f"{place}: compiled kernels cannot be kept there ({reason}); set {CACHE} to a folder that can be written"
    )
