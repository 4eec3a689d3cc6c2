"""The contract of a method, and a base class for simple ones.

A method is made with two frozen dataclasses, build and trace parameters: one build serves a sweep of trace
parameters. It never times, never scores and never reads truth. Inside a frame it only launches. When a capacity
does not suffice it counts on and drops nothing silently: the harness reads :meth:`Method.needs` after the frame,
discards the frame, calls :meth:`Method.grow`, plans again, and records ``regrown``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, ClassVar, Protocol, runtime_checkable

import numpy as np
import warp as wp
from numpy.typing import NDArray

from ..scene.effects import Effects, Limits
from ..scene.scene import Scene
from .frame import Frame
from .mirrors import traced_bounces
from .passes import Pass


@dataclass(frozen=True)
class NoParameters:
    """For methods that have nothing to set."""


@runtime_checkable
class Method(Protocol):
    """What the harness asks of a method. ``build`` and ``trace`` are its parameters."""

    name: ClassVar[str]
    title: ClassVar[str]
    capturable: bool
    devices: ClassVar[tuple[str, ...]]
    Build: ClassVar[type]
    Trace: ClassVar[type]

    def __init__(self, build: Any, trace: Any) -> None: ...

    def applies(self, scene: Scene, device: str) -> str | None:
        """None, or the reason why this method cannot do this scene on this device."""

    def plan(self, frame: Frame, effects: Effects, limits: Limits) -> list[Pass]:
        """Allocate, and return the passes of a frame. Launches nothing. Called again after :meth:`grow`."""

    def needs(self) -> wp.array | None:
        """Device int64 array: what the last frame needed of each capacity, or None where nothing can overflow."""

    def grow(self, needed: NDArray[np.int64]) -> bool:
        """Between frames: True if a capacity was exceeded (and raised), so that the frame must be repeated.

        Raises :class:`~.errors.CapacityRejected` where the need lies beyond the limits given to :meth:`plan`.
        """

    def counters(self) -> dict[str, int]:
        """Deterministic work counters of the last frame. May read back; never called inside a timing."""

    def built(self) -> dict[str, Any]:
        """What was really built (constructor, threads, ...), for the record and the table."""


class BaseMethod:
    """Defaults for the parts of the contract that many methods do not need."""

    name: ClassVar[str] = ""
    title: ClassVar[str] = ""
    capturable: bool = True
    devices: ClassVar[tuple[str, ...]] = ("cpu", "cuda")
    simulates: frozenset[str] = frozenset({"shadows", "directional"})
    """The effects (:meth:`~.scene.scene.Effects.names`) that it takes part in; what it leaves out it says with a reason."""
    cannot: ClassVar[Mapping[str, str]] = {}
    """Reasons for effects that it cannot simulate, shown as they stand."""
    outside: Mapping[str, str] = MappingProxyType({})
    """Hard cases that lie outside what it can do, each with the reason, which ``shadowbench check`` shows: they are not
    run. Under "shadows" the reason why no shadow bit is held against it; everything else still is."""
    Build: ClassVar[type] = NoParameters
    Trace: ClassVar[type] = NoParameters

    def __init__(self, build: Any = None, trace: Any = None):
        self.build = self.Build() if build is None else build
        self.trace = self.Trace() if trace is None else trace

    def applies(self, scene: Scene, device: str) -> str | None:
        if device.split(":")[0] not in self.devices:
            return f"runs on {' and '.join(self.devices)} only"
        for effect in Effects.of(scene).names():
            if effect not in self.simulates:
                return f"{effect}: {self.cannot.get(effect, 'not supported')}"
        return None

    def needs(self) -> wp.array | None:
        return None

    def grow(self, needed: NDArray[np.int64]) -> bool:
        return False

    def counters(self) -> dict[str, int]:
        return {}

    def built(self) -> dict[str, Any]:
        return {}


class SimpleMethod(BaseMethod):
    """For authors of simple methods: three plain functions become the passes of a frame.

    Override :meth:`build_structure`, :meth:`trace_primary` and :meth:`trace_shadow`; allocate in
    :meth:`prepare`. Set ``capturable = False`` where one of them allocates or touches the host.
    """

    def prepare(self, frame: Frame) -> None:
        """Allocate what the frame needs. Launches nothing."""

    def build_structure(self, frame: Frame) -> None:
        """Build the structure from ``frame.points`` and ``frame.triangles``."""
        raise NotImplementedError

    def trace_primary(self, frame: Frame) -> None:
        """Fill triangle, t, u, v of ``frame.answers``."""
        raise NotImplementedError

    def trace_shadow(self, frame: Frame, light: int) -> None:
        """Fill row ``light`` of ``frame.answers.visibility``."""
        raise NotImplementedError

    def trace_bounce(self, frame: Frame, bounce: int) -> None:
        """Fill ``frame.hits(bounce)`` from ``frame.rays(bounce)``; asked for where ``simulates`` has "mirror"."""
        raise NotImplementedError

    def trace_bounce_shadow(self, frame: Frame, light: int, bounce: int) -> None:
        """Fill row ``light`` of ``frame.bits(bounce)``: shadows where mirrored rays hit; with "mirror" as well."""
        raise NotImplementedError

    def plan(self, frame: Frame, effects: Effects, limits: Limits) -> list[Pass]:
        self.prepare(frame)
        passes = [
            Pass(
                "build", "build", ("points", "triangles"), ("structure",), lambda: self.build_structure(frame)
            ),
            Pass(
                "primary rays", "trace", ("structure", "camera"), ("hits",), lambda: self.trace_primary(frame)
            ),
        ]
        for i, wanted in enumerate(effects.shadows):
            if wanted:
                passes.append(
                    Pass(
                        f"light {i}: shadow rays",
                        "shadow",
                        ("structure", "hits", f"light/{i}"),
                        (f"visibility/{i}",),
                        lambda i=i: self.trace_shadow(frame, i),  # type: ignore[misc]
                        effect=f"shadows/{i}",
                    )
                )
        passes += traced_bounces(
            effects,
            ("structure",),
            lambda b: self.trace_bounce(frame, b),
            lambda i, b: self.trace_bounce_shadow(frame, i, b),
        )
        return passes
