"""Clocks, power and temperature of a GPU and the load of the host, noted after each round.

NVIDIA's management library tells them in a millisecond where its binding is installed; ``nvidia-smi`` starts a process.
"""

import os
from collections.abc import Callable
from typing import Any

import warp as wp

from .environment import asked_of_driver
from .nvml import card_of

FIELDS: dict[str, Callable[[Any, Any], Any]] = {
    "clocks.sm": lambda nvml, card: nvml.nvmlDeviceGetClockInfo(card, nvml.NVML_CLOCK_SM),
    "clocks.mem": lambda nvml, card: nvml.nvmlDeviceGetClockInfo(card, nvml.NVML_CLOCK_MEM),
    "power.draw": lambda nvml, card: nvml.nvmlDeviceGetPowerUsage(card) / 1e3,
    "temperature.gpu": lambda nvml, card: nvml.nvmlDeviceGetTemperature(card, nvml.NVML_TEMPERATURE_GPU),
    "clocks_throttle_reasons.active": lambda nvml, card: hex(nvml.nvmlDeviceGetCurrentClocksThrottleReasons(card)),
    "utilization.gpu": lambda nvml, card: nvml.nvmlDeviceGetUtilizationRates(card).gpu,
}
"""What is noted of a GPU, by its name in ``nvidia-smi``, and how the library tells it: MHz, W, degrees Celsius, per cent."""


def clock_state(device: str) -> dict[str, Any]:
    """The :data:`FIELDS` of a GPU as texts (null if nothing reports them), and the host's load."""
    known = []
    if device.startswith("cuda"):
        uuid = wp.get_device(device).uuid
        known = _told_by_library(uuid) or asked_of_driver(*FIELDS, device=uuid)
    return {"load": round(os.getloadavg()[0], 2), "gpu": known[0] if known else None}


def _told_by_library(uuid: str) -> list[dict[str, str]]:
    """The :data:`FIELDS` of a GPU; nothing where the library is missing or does not tell one of them."""
    try:
        import pynvml as nvml
    except ImportError:
        return []
    try:
        return [{name: str(told(nvml, card_of(uuid))) for name, told in FIELDS.items()}]
    except nvml.NVMLError:
        return []
