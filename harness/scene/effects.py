"""What a scene calls for: effects, outputs, limits, and the switches that kernels are compiled for."""

from __future__ import annotations

from dataclasses import dataclass

from .scene import Scene


@dataclass(frozen=True)
class Switches:
    """What a kernel can be compiled for.

    masked   only receivers have a shadow ray: the kernel reads the mask ``frame.receivers``
    alpha    triangles have holes: a hit counts where the mask is opaque
    bounced  rays are those of a mirror (``frame.rays``) and not the eye's
    """

    masked: bool = False
    alpha: bool = False
    bounced: bool = False


OUTPUTS = ("depth", "ids", "shadows", "color", "counters")
"""What can be wanted of a frame: t and weights; triangles; shadow bits; shaded colour; counters of the work."""


@dataclass(frozen=True)
class Effects:
    """What a frame must simulate, derived from a scene: nothing else is run.

    shadows      one flag a light: does it ask for shadow rays
    limited      one flag a light: is it a spot; () is none
    directional  one flag a light: is it directional; () is none
    facing       whether only hit points that face a light have a shadow ray
    alpha        whether triangles have holes
    bounces      how often mirrored rays go on
    color        whether the frame is shaded
    """

    shadows: tuple[bool, ...]
    limited: tuple[bool, ...] = ()
    directional: tuple[bool, ...] = ()
    facing: bool = False
    alpha: bool = False
    bounces: int = 0
    color: bool = False

    @staticmethod
    def of(scene: Scene) -> Effects:
        """The effects that ``scene`` calls for. Without shadow bits or colour among its outputs no light does."""
        unknown = [name for name in scene.outputs if name not in OUTPUTS]
        if unknown:
            raise ValueError(f"{scene.name}: output {unknown[0]!r} is not one of {', '.join(OUTPUTS)}")
        if scene.bounces < 0:
            raise ValueError(f"{scene.name}: {scene.bounces} bounces; give 0 or more")
        lit = "shadows" in scene.outputs or "color" in scene.outputs
        return Effects(
            shadows=tuple(lit and light.shadows for light in scene.lights),
            limited=tuple(light.spot is not None for light in scene.lights),
            directional=tuple(light.directional for light in scene.lights),
            facing=scene.facing,
            alpha=scene.alpha is not None,
            bounces=scene.bounces if scene.mirror is not None else 0,
            color="color" in scene.outputs,
        )

    def masked(self, light: int) -> bool:
        """Whether only some hit points have a shadow ray to ``light``: a mask of receivers is made for it."""
        spot = light < len(self.limited) and self.limited[light]
        return light < len(self.shadows) and self.shadows[light] and (self.facing or spot)

    def mask_reads(self, light: int, bounce: int = 0) -> tuple[str, ...]:
        """What a pass that traces shadow rays to ``light`` (of the hits of a bounce) reads of receivers."""
        if not self.masked(light):
            return ()
        return (f"receivers/{light}/{bounce}" if bounce else f"receivers/{light}",)

    def surface_reads(self) -> tuple[str, ...]:
        """What a pass that decides whether a hit counts reads of surfaces."""
        return ("surfaces",) if self.alpha else ()

    def switches(self, light: int | None = None, bounce: int = 0) -> Switches:
        """What kernels are compiled for: those of primary rays, or those of shadow rays to ``light``.

        ``bounce`` > 0: those of mirrored rays, or of the shadow rays of what they hit.
        """
        return Switches(masked=light is not None and self.masked(light), alpha=self.alpha, bounced=bounce > 0)

    def is_directional(self, light: int) -> bool:
        """Whether ``light`` is directional."""
        return light < len(self.directional) and self.directional[light]

    def names(self) -> tuple[str, ...]:
        """The effects called for, as :attr:`.frame.method.BaseMethod.simulates` names them."""
        lights = range(len(self.shadows))
        called = {
            "shadows": any(self.shadows),
            "receivers": any(self.masked(i) for i in lights),
            "directional": any(self.shadows[i] and self.is_directional(i) for i in lights),
            "alpha": self.alpha,
            "mirror": self.bounces > 0,
        }
        return tuple(name for name, wanted in called.items() if wanted)


@dataclass(frozen=True)
class Limits:
    """What a method may take. ``memory``: bytes for its structures, counted by the method before it allocates."""

    memory: int = 8 << 30
