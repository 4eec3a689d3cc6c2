"""Devices by name, as ``--device`` gives them; and Warp's start, silent on standard output and where there is no GPU."""

import functools
import os
import platform
import sys
import tempfile
from collections.abc import Mapping
from hashlib import sha256
from pathlib import Path

import warp as wp

from ..errors import UserError
from ..scene.scene import Scene
from .method import Method
from .registry import make_method

CACHE = "WARP_CACHE_PATH"  # Warp's environment variable for the folder of compiled kernels

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
    _share_headers(place)


def _share_headers(place: Path) -> None:
    """Let all processes that compile kernels for the CPU use one precompiled copy of Warp's headers, beside the
    kernels. By itself Warp makes a copy for each process, in three seconds. A copy holds for one installation on one
    machine; Warp replaces one that does not fit.
    """
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


def find_device(name: str | None) -> str:
    """The device ``name``; by default ``cuda:0`` if present, else ``cpu``."""
    start_warp()
    if name is None:
        return "cuda:0" if wp.is_cuda_available() else "cpu"
    known = ["cpu", *(device.alias for device in wp.get_cuda_devices())]
    chosen = "cuda:0" if name == "cuda" else name
    if chosen not in known:
        raise UserError(f"no device {name!r} on this machine; it has {' and '.join(known)}: give --device {known[-1]}")
    return chosen


def device_for(cls: type[Method], device: str) -> str:
    """The device a method runs on: the requested one if the method supports it, else the CPU (recorded)."""
    supported = device.split(":")[0] in cls.devices or "cpu" not in cls.devices
    return device if supported else "cpu"


def placed_method(
    name: str, settings: Mapping[str, str] | None, scene: Scene, device: str
) -> tuple[Method, str, str | None]:
    """A method with parameters given as text, the device that it runs on, and why it cannot trace the scene there."""
    method = make_method(name, dict(settings or {}))
    place = device_for(type(method), device)
    return method, place, method.applies(scene, place)


def device_title(device: str) -> str:
    return str(wp.get_device(device).name) if device.startswith("cuda") else cpu_model()


def cpu_model() -> str:
    """The processor's name. (psutil does not give it; on Linux ``platform.processor`` is empty or only the type.)"""
    return cpu_facts().get("model name") or platform.processor() or platform.machine()


@functools.cache
def cpu_facts() -> dict[str, str]:
    """What Linux says of the first processor, by names in small letters; empty on other systems."""
    try:
        text = Path("/proc/cpuinfo").read_text(encoding="utf-8")
    except OSError:
        return {}
    lines = (line.partition(":") for line in text.partition("\n\n")[0].splitlines())
    return {name.strip().lower(): value.strip() for name, _, value in lines}
