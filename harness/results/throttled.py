"""Rounds that were disturbed, from what a record has of the GPU's clocks and the host's load at the end of each round."""

from collections.abc import Iterable, Mapping
from math import isfinite
from pathlib import Path
from statistics import median
from typing import Any

from ..texts import numbered
from .folder import read_environment
from .schema import newest_as

REASONS = {
    0x04: "power limit", 0x08: "hardware slowdown", 0x10: "synchronised with a slower GPU",
    0x20: "temperature (software)", 0x40: "temperature (hardware)", 0x80: "power brake",
}  # fmt: skip
"""Bits of NVML's clock event reasons that slow a GPU under load. The others, idle and clocks that a user set, do not."""

LOWEST = 0.97  # share of the usual clock below which a round counts as throttled where the driver reports no reasons


def usual_clock(rounds: Iterable[Mapping[str, Any]]) -> float:
    """The median of the SM clocks that rounds have, MHz; NaN where none has one."""
    known = [mhz for one in rounds if (mhz := _clock(one)) is not None]
    return median(known) if known else float("nan")


CROWDED = 1.25  # load of a host over its cores above which programs wait, so that CPU times are not reliable


def disturbed(one: Mapping[str, Any], usual: float, device: str, cores: int | None) -> str:
    """Why a round should not count: its clocks were throttled or, on a CPU, the load of the machine exceeded its cores.
    "" if neither is known. ``cores``: the number that a run may use; None: not known. The load is the mean of the last
    minute.
    """
    if device.startswith("cuda"):
        return (found := throttled(one, usual)) and f"clocks throttled ({found})"
    load = _number((one.get("clock") or {}).get("load"))
    if cores and load is not None and load > CROWDED * cores:
        return f"load {load:.1f} on {numbered(cores, 'core')}"
    return ""


def disturbances(folder: Path) -> str:
    """The number of disturbed rounds of a results folder and the worst disturbance, as a phrase; "" if there are none."""
    found = newest_as(folder, lambda own: (own.method["device"], own.environment, list(own.rounds or ())))[0]
    usual = usual_clock(one for _, _, rounds in found for one in rounds)
    cores, texts, count = dict[str, int | None](), list[str](), 0
    for device, environment, rounds in found:
        if environment not in cores:
            facts = read_environment(folder, environment) or {}
            cores[environment] = (facts.get("cpu") or {}).get("usable_cores")
        count += len(rounds)
        texts += filter(None, (disturbed(one, usual, device, cores[environment]) for one in rounds))
    worst = max(texts, key=lambda text: (_number(text.split()[1]) or 0.0, text), default="")
    return f"{len(texts)} of {count} rounds were disturbed, the worst by {worst}" if texts else ""


def throttled(one: Mapping[str, Any], usual: float) -> str:
    """Why a round of :attr:`.results.record.Record.rounds` counts as throttled; "" where it does not, or nothing is known.

    usual  :func:`usual_clock` of the runs that are compared, MHz
    """
    bits = _number(_gpu(one).get("clocks_throttle_reasons.active"))
    if bits is not None:
        return ", ".join(name for bit, name in REASONS.items() if int(bits) & bit)
    mhz = _clock(one)
    if mhz is not None and mhz < LOWEST * usual:
        return f"{mhz:.0f} MHz where {usual:.0f} are usual"
    return ""


def _gpu(one: Mapping[str, Any]) -> Mapping[str, Any]:
    return (one.get("clock") or {}).get("gpu") or {}


def _clock(one: Mapping[str, Any]) -> float | None:
    return _number(_gpu(one).get("clocks.sm"))


def _number(text: Any) -> float | None:
    """A number as nvidia-smi prints it, decimal or "0x..."; None for "[N/A]" and the like, and for what is not finite."""
    try:
        number = float(int(text, 16)) if str(text).startswith("0x") else float(text)
    except (TypeError, ValueError, OverflowError):
        return None
    return number if isfinite(number) else None
