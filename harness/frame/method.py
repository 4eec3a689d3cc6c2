"""The interface of a method, and a base class for simple methods.

A method is constructed from two frozen dataclasses, its build parameters and its trace parameters. A method never
measures time, never scores and never reads the reference. Inside a frame it only launches kernels. If a buffer is too
small, the method continues to count what it needs and does not drop anything silently: after the frame the harness
reads :meth:`Method.needs`, discards the frame, calls :meth:`Method.grow`, plans again, and records ``regrown``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from types import MappingProxyType
from typing import Any, ClassVar, Protocol

import numpy as np
import warp as wp
from numpy.typing import NDArray

from ..scene.effects import Effects, Limits
from ..scene.scene import Scene
from .effects.mirrors import traced_bounces
from .frame import Frame
from .schedule.passes import Pass

REASONS = MappingProxyType({"orthographic": "its primary rays start in one point"})
"""Why a method does not support an effect, unless it says so itself in ``cannot``."""


@dataclass(frozen=True)
class NoParameters:
    """For methods without parameters."""


class Method(Protocol):
    """The interface of a method, with what many methods need not say. ``build`` and ``trace`` are its parameters."""

    name: ClassVar[str] = ""
    title: ClassVar[str] = ""
    capturable: bool = True
    devices: ClassVar[tuple[str, ...]] = ("cpu", "cuda")
    Build: ClassVar[type] = NoParameters
    Trace: ClassVar[type] = NoParameters

    def __init__(self, build: Any, trace: Any) -> None: ...

    @property
    def finds_closed(self) -> bool:
        """Whether closed surfaces are to be found for it (:mod:`..scene.closed`)."""
        return False

    def applies(self, scene: Scene, device: str) -> str | None:
        """None, or the reason why this method cannot trace this scene on this device."""

    def plan(self, frame: Frame, effects: Effects, limits: Limits) -> list[Pass]:
        """Allocate memory and return the passes of a frame. Launches nothing. Called again after :meth:`grow`."""

    def needs(self) -> wp.array | None:
        """Device int64 array: the capacity that the last frame needed of each buffer; None if no buffer can overflow."""
        return None

    def grow(self, needed: NDArray[np.int64]) -> bool:
        """Between frames: if a capacity was exceeded, raise it and return True; the frame is then repeated.

        Raises :class:`~..errors.CapacityRejected` if the need exceeds the limits given to :meth:`plan`.
        """
        return False

    def counters(self) -> dict[str, int]:
        """Deterministic counters of the work of the last frame. May read from the device; never called while timing.
        Tables read those named in :mod:`..results.costs`.
        """
        return {}

    def held_bytes(self) -> int:
        """Bytes on any device that it holds after the last frame and that Warp did not allocate, such as a structure of
        OptiX. They count as its memory, with Warp's arrays. Never called while timing.
        """
        return 0

    def built(self) -> dict[str, Any]:
        """Facts about the acceleration structure (constructor, threads, ...), for the record and the table."""
        return {}


class BaseMethod(Method):
    """A method that declares what it supports."""

    formerly: ClassVar[tuple[str, ...]] = ()
    """Names that it had in earlier versions. Records with such a name are read as its own."""
    simulates: frozenset[str] = frozenset({"shadows", "directional"})
    """The effects (:meth:`~..scene.effects.Effects.names`) that it supports; give reasons for others in ``cannot``."""
    cannot: ClassVar[Mapping[str, str]] = {}
    """{effect: reason} for effects that it does not support; the reason is shown to the user."""
    outside: Mapping[str, str] = MappingProxyType({})
    """{hard case: reason} for the hard cases that it does not support. ``shadowbench check`` shows the reason and does
    not run the case. With the key "shadows", wrong shadow bits do not fail the check; wrong hits still do.
    """
    sources: ClassVar[tuple[str, ...]] = ()
    """Further files that its answers or its speed depend on, such as kernels that are not Python and data: names beside the
    class's own file, also patterns (``kernels/*.cu``). With them changed, its records are out of date.
    """

    @classmethod
    def present_settings(cls, settings: dict[str, str]) -> dict[str, str]:
        """Settings of an earlier version as they are given now: a record is read with these."""
        return settings

    def __init__(self, build: Any = None, trace: Any = None):
        self.build = self.Build() if build is None else build
        self.trace = self.Trace() if trace is None else trace

    def applies(self, scene: Scene, device: str) -> str | None:
        if device.split(":")[0] not in self.devices:
            return f"runs on {' and '.join(self.devices)} only"
        for effect in Effects.of(scene).names():
            if effect not in self.simulates:
                return f"{effect}: {self.cannot.get(effect, REASONS.get(effect, 'not supported'))}"
        return None


class SimpleMethod(BaseMethod):
    """Base class for simple methods: three functions become the passes of a frame.

    Override :meth:`build_structure`, :meth:`trace_primary` and :meth:`trace_shadow`; allocate in :meth:`prepare`. Set
    ``capturable = False`` if one of them allocates memory or synchronises with the host.
    """

    def prepare(self, frame: Frame) -> None:
        """Allocate the memory of the method. Launches nothing."""

    def build_structure(self, frame: Frame) -> None:
        """Build the structure from ``frame.points`` and ``frame.triangles``."""
        raise NotImplementedError

    def trace_primary(self, frame: Frame) -> None:
        """Fill triangle, t, u, v of ``frame.answers``."""
        raise NotImplementedError

    def trace_shadow(self, frame: Frame, light: int) -> None:
        """Fill row ``light`` of ``frame.answers.shadowed``."""
        raise NotImplementedError

    def trace_bounce(self, frame: Frame, bounce: int) -> None:
        """Fill ``frame.hits(bounce)`` from ``frame.rays(bounce)``. Needed only if ``simulates`` has "mirror"."""
        raise NotImplementedError

    def trace_bounce_shadow(self, frame: Frame, light: int, bounce: int) -> None:
        """Fill row ``light`` of ``frame.bits(bounce)``, the shadow bits of the hits of mirrored rays. With "mirror" only."""
        raise NotImplementedError

    def plan(self, frame: Frame, effects: Effects, limits: Limits) -> list[Pass]:
        self.prepare(frame)
        build, primary = partial(self.build_structure, frame), partial(self.trace_primary, frame)
        passes = [
            Pass("build", "build", ("points", "triangles"), ("structure",), build),
            Pass("primary rays", "trace", ("structure", "camera"), ("hits",), primary),
        ]
        for i in (i for i, wanted in enumerate(effects.shadows) if wanted):
            name, reads, launch = (
                f"light {i}: shadow rays",
                ("hits", f"light/{i}"),
                partial(self.trace_shadow, frame, i),
            )
            passes.append(Pass(name, "shadow", ("structure", *reads), (f"shadowed/{i}",), launch, f"shadows/{i}"))
        bounces = partial(self.trace_bounce, frame), partial(self.trace_bounce_shadow, frame)
        return [*passes, *traced_bounces(effects, ("structure",), *bounces)]
