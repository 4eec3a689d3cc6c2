"""Devices by the names that a person gives them."""

from __future__ import annotations

import functools
import platform
from pathlib import Path

import warp as wp

from ..errors import UserError
from .method import Method
from .warp_init import start_warp


def find_device(name: str | None) -> str:
    """The device to run on: ``cuda:0`` where there is one, else ``cpu``, unless ``name`` says which."""
    start_warp()
    if name is None:
        return "cuda:0" if wp.is_cuda_available() else "cpu"
    known = ["cpu", *(device.alias for device in wp.get_cuda_devices())]
    chosen = "cuda:0" if name == "cuda" else name
    if chosen not in known:
        raise UserError(
            f"no device {name!r} on this machine; there is {' and '.join(known)}: give --device {known[-1]}"
        )
    return chosen


def device_for(cls: type[Method], device: str) -> str:
    """The device a method runs on: the one asked for where it can, else the CPU (the record says so)."""
    kind = device.split(":")[0]
    if kind not in cls.devices and "cpu" in cls.devices:
        return "cpu"
    return device


def device_title(device: str) -> str:
    """The name a person knows a device by."""
    return str(wp.get_device(device).name) if device.startswith("cuda") else cpu_model()


@functools.cache
def cpu_model() -> str:
    """The processor's name. (psutil does not say it, and ``platform.processor`` is empty or a mere kind on Linux.)"""
    try:
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.lower().startswith("model name"):
                return line.split(":", 1)[1].strip()
    except OSError:
        pass
    return platform.processor() or platform.machine()
