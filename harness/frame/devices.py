"""Devices by the names that a person gives them."""

from __future__ import annotations

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
    if not device.startswith("cuda"):
        from .machine import cpu_model

        return cpu_model()
    return str(wp.get_device(device).name)
