"""The environment of a measurement: machine, driver, versions, commit; stored once, referenced by its id. And after each
round the clocks, power and temperature of a GPU and the load of the host: NVIDIA's management library tells them in a
millisecond where its binding is installed; ``nvidia-smi`` starts a process.
"""

import contextlib
import hashlib
import importlib.metadata
import os
import platform
import re
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import psutil
import shadowbench
import warp as wp

from ...files import digest, write_atomic
from ...frame.cards import has_ray_tracing_units
from ...frame.devices import cpu_facts, cpu_model
from ...frame.schedule.threads import processors
from ...results.folder import read_json
from .nvml import card_of

PACKAGES = ("warp-lang", "numpy", "embreex", "trimesh", "pandas", "scipy", "pillow", "usd-core", "slangpy")
DISTRIBUTION = "shadowbench-rt"  # the name under which this package is installed

GPU_FIELDS = ("name", "driver_version", "memory.total", "clocks.max.sm", "clocks.max.mem", "power.limit")


def environment() -> dict[str, Any]:
    """The environment, with an ``id`` that is a hash of all the rest."""
    facts: dict[str, Any] = {
        "cpu": {"model": cpu_model(), "cores": os.cpu_count(), "usable_cores": processors(), "flags": cpu_flags()},
        "memory_bytes": psutil.virtual_memory().total, "os": system(), "python": platform.python_version(),
        "implementation": platform.python_implementation(), "warp": wp.__version__, "gpus": gpus(),
        "packages": packages(), "git": git_state(),
    }  # fmt: skip
    if facts["gpus"]:
        asked = {"toolkit": wp.get_cuda_toolkit_version, "driver": wp.get_cuda_driver_version}
        facts["cuda"] = {name: _version(read) for name, read in asked.items()}
    return {"id": digest(facts)[:16], **facts}


def keep(folder: Path, facts: dict[str, Any]) -> str:
    """Write the environment into a results folder, unless it is there; return its id."""
    path = folder / "environments" / f"{facts['id']}.json"
    if read_json(path) != facts:
        write_atomic(path, facts)
    return str(facts["id"])


def system() -> str:
    """Operating system, kernel version and machine type, without the name of a particular build."""
    number = re.match(r"\d+(\.\d+)*", platform.release())
    return "-".join((platform.system(), number[0] if number else "unknown", platform.machine()))


def cpu_flags() -> str:
    """A hash of the processor's instruction sets; empty if the system does not list them (psutil does not)."""
    flags = cpu_facts().get("flags") or cpu_facts().get("features") or ""
    return hashlib.sha256(" ".join(sorted(flags.split())).encode()).hexdigest()[:16] if flags else ""


def gpus() -> list[dict[str, Any]]:
    """One entry per CUDA device, with the data of Warp and nvidia-smi; empty without devices."""
    devices = wp.get_cuda_devices()
    # The UUID matches the two lists. It is not stored, because it identifies a single card.
    told = {row.pop("uuid"): row for row in asked_of_driver("uuid", *GPU_FIELDS)} if devices else {}
    return [
        {"alias": device.alias, "name": device.name, "arch": device.arch, "sms": device.sm_count}
        | {"ray_tracing_units": has_ray_tracing_units(device.arch, device.name), "smi": told.get(device.uuid)}
        for device in devices
    ]


def asked_of_driver(*fields: str, device: str = "") -> list[dict[str, str]]:
    """What nvidia-smi says of each GPU, or of one with a UUID; nothing where it is missing or fails."""
    if not shutil.which("nvidia-smi"):
        return []
    command = ["nvidia-smi", f"--query-gpu={','.join(fields)}", "--format=csv,noheader,nounits"]
    command += [f"--id={device}"] if device else []
    try:
        told = subprocess.run(command, capture_output=True, text=True, timeout=20, check=True).stdout
    except (OSError, subprocess.SubprocessError):
        return []
    return [dict(zip(fields, map(str.strip, line.split(",")), strict=False)) for line in told.splitlines()]


def packages() -> dict[str, str]:
    """Installed versions of the packages that affect measurements, and of this one."""
    versions = {DISTRIBUTION: shadowbench.__version__}
    for name in PACKAGES:
        with contextlib.suppress(importlib.metadata.PackageNotFoundError):
            versions[name] = importlib.metadata.version(name)
    return versions


def git_state(file: Path = Path(__file__)) -> dict[str, Any] | None:
    """Commit and whether tracked files differ from it; None without git, and where the repository does not track
    ``file``. An installed package may lie in a repository of something else.
    """
    try:
        _git(file, "ls-files", "--error-unmatch", file.name)
        commit = _git(file, "rev-parse", "HEAD")
        changes = _git(file, "status", "--porcelain", "--untracked-files=no")
    except (OSError, subprocess.SubprocessError):
        return None
    return {"commit": commit, "dirty": bool(changes)}


def _git(file: Path, *words: str) -> str:
    command = ["git", "-C", str(file.resolve().parent), *words]
    return subprocess.run(command, capture_output=True, text=True, timeout=20, check=True).stdout.strip()


def _version(read: Any) -> str | None:
    try:
        return ".".join(str(part) for part in read())
    except Exception:  # Warp raises several kinds here, and a version that cannot be read is no reason to stop
        return None


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
