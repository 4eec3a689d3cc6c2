"""Effects of a scene, outputs of a frame, limits of a method, and the switches that kernels are compiled for."""

from __future__ import annotations

from dataclasses import dataclass

from .scene import Scene
from .targets import per_target


@dataclass(frozen=True)
class Switches:
    """The effects that a kernel can be compiled for.

    receivers  only receivers have a shadow ray: the kernel reads the flags ``frame.receivers``, or makes them
    alpha      triangles have holes: a hit counts only where the alpha mask is opaque
    bounced    rays are those of a table (``frame.rays``): mirrored ones, or of an orthographic camera
    orthographic  primary rays are computed from an orthographic camera: for kernels that have no table of them
    closed     triangles of closed surfaces are marked (:mod:`.scene.closed`)
    wide       sizes are so unlike that float64 leaves signs open (:mod:`.scene.width`): they are found in more digits
    """

    receivers: bool = False
    alpha: bool = False
    bounced: bool = False
    orthographic: bool = False
    wide: bool = False
    closed: bool = False


OUTPUTS = ("depth", "ids", "shadows", "color", "counters")
"""The outputs of a frame: t and weights; triangles; shadow bits; shaded colour; counters of the work."""


@dataclass(frozen=True)
class Effects:
    """The effects that a frame simulates, derived from its scene. Passes of other effects do not run.

    A light with an area stands for as many lights as it has targets (:mod:`.scene.targets`).

    shadows      one flag per light: whether shadow rays are traced to it
    limited      one flag per light: whether it is a spot; () for none
    directional  one flag per light: whether it is directional; () for none
    facing       whether only hit points that face a light have a shadow ray
    alpha        whether triangles have holes
    bounces      how many times rays are mirrored
    color        whether the frame is shaded
    orthographic whether primary rays are parallel, each with its own origin
    closed       whether closed surfaces are found in the frame, with eye and lights outside (:mod:`.scene.closed`)
    wide         whether sizes are so unlike that more digits are needed than float64 has (:mod:`.scene.width`)
    """

    shadows: tuple[bool, ...]
    limited: tuple[bool, ...] = ()
    directional: tuple[bool, ...] = ()
    facing: bool = False
    alpha: bool = False
    bounces: int = 0
    color: bool = False
    orthographic: bool = False
    wide: bool = False
    closed: bool = False

    @staticmethod
    def of(scene: Scene) -> Effects:
        """The effects of ``scene``. No shadow rays are traced unless its outputs hold shadows or colour."""
        unknown = [name for name in scene.outputs if name not in OUTPUTS]
        if unknown:
            raise ValueError(f"{scene.name}: output {unknown[0]!r} is not one of {', '.join(OUTPUTS)}")
        if scene.bounces < 0:
            raise ValueError(f"{scene.name}: {scene.bounces} bounces; give 0 or more")
        lit = "shadows" in scene.outputs or "color" in scene.outputs
        lights = per_target(scene.lights)
        return Effects(
            shadows=tuple(lit and light.shadows for light in lights),
            limited=tuple(light.spot is not None for light in lights),
            directional=tuple(light.directional for light in lights),
            facing=scene.facing,
            alpha=scene.alpha is not None,
            bounces=scene.bounces if scene.mirror is not None else 0,
            color="color" in scene.outputs,
            orthographic=scene.camera.height is not None,
        )

    def has_receivers(self, light: int) -> bool:
        """Whether only some hit points, its receivers, have a shadow ray to ``light``."""
        spot = light < len(self.limited) and self.limited[light]
        return light < len(self.shadows) and self.shadows[light] and (self.facing or spot)

    def facing_by_triangle(self, triangles: int, pixels: int) -> bool:
        """Whether it is decided once for each triangle, not for each hit, which of the primary hits face a light: rays start
        in one point, so all hits of a triangle face it or none does.
        """
        return self.facing and not self.orthographic and 0 < triangles < pixels

    def receiver_reads(self, light: int, bounce: int = 0) -> tuple[str, ...]:
        """The receivers that are read by a pass that traces shadow rays to ``light`` from the hits of a bounce."""
        if not self.has_receivers(light):
            return ()
        return (f"receivers/{light}/{bounce}" if bounce else f"receivers/{light}",)

    def surface_reads(self) -> tuple[str, ...]:
        """The surface data that are read by a pass that decides whether a hit counts."""
        return ("surfaces",) if self.alpha else ()

    def switches(self, light: int | None = None, bounce: int = 0) -> Switches:
        """Switches of the kernels for primary rays, or shadow rays to ``light``; ``bounce`` > 0: of mirrored ones."""
        return Switches(
            receivers=light is not None and self.has_receivers(light),
            alpha=self.alpha,
            bounced=bounce > 0 or self.orthographic,
            wide=self.wide,
            closed=self.closed and light is not None and not bounce,
        )

    def is_directional(self, light: int) -> bool:
        return light < len(self.directional) and self.directional[light]

    def names(self) -> tuple[str, ...]:
        """The names of the effects, as :attr:`.frame.method.BaseMethod.simulates` names them."""
        lights = range(len(self.shadows))
        called = {
            "shadows": any(self.shadows),
            "receivers": any(self.has_receivers(i) for i in lights),
            "directional": any(self.shadows[i] and self.is_directional(i) for i in lights),
            "alpha": self.alpha,
            "mirror": self.bounces > 0,
            "orthographic": self.orthographic,
        }
        return tuple(name for name, wanted in called.items() if wanted)


@dataclass(frozen=True)
class Limits:
    """Limits of a method. ``memory``: bytes of its structures, counted by the method before it allocates them."""

    memory: int = 8 << 30
