"""The passes of shadow rays, for methods that trace one ray per pixel and light."""

from __future__ import annotations

import functools
from collections.abc import Callable

from ...harness.frame.schedule.passes import Pass
from ...harness.scene.effects import Effects


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
