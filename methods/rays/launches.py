"""Launches of the kernels of :mod:`.kernels`, their passes, and the tests that they count."""

import functools
from collections.abc import Callable
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from ...harness.frame.effects.mirrors import traced_bounces
from ...harness.frame.effects.specialise import specialised
from ...harness.frame.frame import Frame
from ...harness.frame.schedule.passes import Pass
from ...harness.scene.effects import Effects
from ..common.bands import Band, Bands


def shadow_ray_passes(effects: Effects, reads: tuple[str, ...], launch: Callable[[int], None]) -> list[Pass]:
    """A pass for each light that casts shadows: ``launch(light)`` reads ``reads``, the light, its receivers and holes."""
    return [
        Pass(
            f"light {i}: shadow rays",
            "shadow",
            (*reads, f"light/{i}", *effects.receiver_reads(i), *effects.surface_reads()),
            (f"shadowed/{i}",),
            functools.partial(launch, i),
            effect=f"shadows/{i}",
        )
        for i, wanted in enumerate(effects.shadows)
        if wanted
    ]


def ray_passes(
    effects: Effects, structure: str, closest: Callable[..., None], shadow: Callable[..., None]
) -> list[Pass]:
    """Primary, shadow and mirrored rays of a library's structure. ``closest`` and ``shadow`` take a bounce as well."""
    primary = Pass("primary rays", "trace", (structure, "camera"), ("hits",), closest)
    shadows = shadow_ray_passes(effects, (structure, "hits", "camera"), shadow)
    return [primary, *shadows, *traced_bounces(effects, (structure, "points", "triangles"), closest, shadow)]


class PixelRays:
    """The rays of a frame through one structure: one per pixel, light and bounce.

    structure  the struct that the kernels take; primary, shadow: of :mod:`.kernels`
    hit        vec3d [pixels]: hit points of primary rays, where others trace these
    threads    of a CPU, that each trace a band of the image; 0: one for each core
    block      threads of a block on a GPU
    """

    def __init__(
        self, frame: Frame, effects: Effects, structure: Any, primary: wp.Kernel, shadow: wp.Kernel,
        hit: wp.array | None = None, threads: int = 1, block: int = 256,
    ):  # fmt: skip
        self._frame, self._effects, self._structure = frame, effects, structure
        self._primary_kernel, self._shadow_kernel = primary, shadow
        self.bands, self._block = Bands(frame, threads), block
        bounces = effects.bounces
        with wp.ScopedDevice(frame.device):
            self._hit = wp.zeros(frame.pixels, dtype=wp.vec3d) if hit is None else hit
            self._bounced_hit = wp.zeros((bounces, frame.pixels) if bounces else (0, 0), dtype=wp.vec3d)
            self._uncounted = wp.zeros(0, dtype=wp.int32)
            self._all_receive = wp.zeros(0, dtype=wp.uint8)

    def passes(self, structure: tuple[str, ...]) -> list[Pass]:
        """Primary rays, shadow rays, mirrored rays. ``structure``: the resources of the structure."""
        reads = (*structure, "camera", *self._effects.surface_reads())
        passes = [Pass("primary rays", "trace", reads, ("hits",), self.launch_primary)]
        return passes + self.later_passes(structure)

    def later_passes(self, structure: tuple[str, ...]) -> list[Pass]:
        """Shadow rays, mirrored rays."""
        passes = shadow_ray_passes(self._effects, (*structure, "hits"), self.launch_shadow)
        return passes + traced_bounces(
            self._effects,
            (*structure, "points", "triangles"),
            lambda b: self.launch_primary(bounce=b),
            lambda i, b: self.launch_shadow(i, bounce=b),
        )

    def tests_per_pixel(self, bounce: int = 0) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
        """Triangle tests of each pixel's primary (or mirrored) ray and of its shadow rays. The last frame is traced again to
        count them.
        """
        primary = wp.zeros(self._frame.pixels, dtype=wp.int32, device=self._frame.device)
        shadow = wp.zeros_like(primary)
        self.launch_primary(primary, bounce)
        for light, wanted in enumerate(self._effects.shadows):
            if wanted:
                self.launch_shadow(light, shadow, bounce)
        return primary.numpy(), shadow.numpy()

    def counters(self) -> dict[str, int]:
        """Triangle tests of all rays of the last frame."""
        counted = [self.tests_per_pixel(bounce) for bounce in range(self._effects.bounces + 1)]
        (primary, shadow), *mirrored = ([int(tests.sum(dtype=np.int64)) for tests in pair] for pair in counted)
        found = {"primary tests": primary, "shadow tests": shadow}
        if mirrored:
            found |= {"mirror tests": sum(m[0] for m in mirrored), "mirror shadow tests": sum(m[1] for m in mirrored)}
        return found

    def _hits(self, bounce: int) -> wp.array:
        return self._bounced_hit[bounce - 1] if bounce else self._hit

    def launch_primary(self, tests: wp.array | None = None, bounce: int = 0) -> None:
        """Closest hits of the primary rays, or of the mirrored rays of a bounce."""
        self.bands.run(self._primary, bounce, tests=tests)

    def _primary(self, band: Band, bounce: int, tests: wp.array | None = None) -> None:
        frame = self._frame
        inputs = [self._structure, band.camera, frame.mesh, frame.alpha, band.fields_of(frame.rays(bounce))]
        outputs = [
            band.fields_of(frame.hits(bounce)),
            band.of(self._hits(bounce)),
            self._uncounted if tests is None else band.of(tests),
        ]
        kernel = specialised(self._primary_kernel, self._effects.switches(bounce=bounce))
        frame.launch(kernel, band.thread_count(), inputs, outputs, self._block)

    def launch_shadow(self, light: int, tests: wp.array | None = None, bounce: int = 0) -> None:
        """Shadow bits of the hits of :meth:`launch_primary`."""
        self.bands.run(self._shadow, light, bounce, tests=tests)

    def _shadow(self, band: Band, light: int, bounce: int, tests: wp.array | None = None) -> None:
        frame, masks = self._frame, self._frame.masks(bounce)
        receivers = band.of(masks[light]) if masks.size else self._all_receive
        found = [band.fields_of(frame.hits(bounce)), band.of(self._hits(bounce)), receivers]
        scene = [self._structure, band.camera, frame.mesh, frame.alpha, frame.lights]
        inputs = [light, *scene, *found, band.fields_of(frame.rays(bounce))]
        outputs = [band.of(frame.bits(bounce)[light]), self._uncounted if tests is None else band.of(tests)]
        kernel = specialised(self._shadow_kernel, self._effects.switches(light, bounce))
        frame.launch(kernel, band.thread_count(), inputs, outputs, self._block)
