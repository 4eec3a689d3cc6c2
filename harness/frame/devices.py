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
