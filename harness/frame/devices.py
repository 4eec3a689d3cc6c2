"""Devices by name, as ``--device`` gives them."""

import functools
import platform
from collections.abc import Mapping
from pathlib import Path

import warp as wp

from ..errors import UserError
from ..scene.scene import Scene
from .method import Method
from .registry import make_method
from .warp_init import start_warp


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
    kind = device.split(":")[0]
    if kind not in cls.devices and "cpu" in cls.devices:
        return "cpu"
    return device


def placed_method(
    name: str, settings: Mapping[str, str] | None, scene: Scene, device: str
) -> tuple[Method, str, str | None]:
    """A method with parameters given as text, the device that it runs on, and why it cannot trace the scene there."""
    method = make_method(name, dict(settings or {}))
    place = device_for(type(method), device)
    return method, place, method.applies(scene, place)


def device_title(device: str) -> str:
    """The product name of a device."""
    return str(wp.get_device(device).name) if device.startswith("cuda") else cpu_model()


@functools.cache
def cpu_model() -> str:
    """The processor's name. (psutil does not give it; on Linux ``platform.processor`` is empty or only the type.)"""
    try:
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.lower().startswith("model name"):
                return line.split(":", 1)[1].strip()
    except OSError:
        pass
    return platform.processor() or platform.machine()
