"""V scale, V far, V sun: scenes, lights and directions near the ends of what float32 holds.

Products of two lengths overflow from 2e19 on and underflow from 1e-19 down, those of three from 7e12 and 2e-13.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

from ..scene.scene import Light
from .case import HardCase, Trial, view
from .variants import ball_on_floor, small_scene

SCALES = (1e-36, 1e-30, 1e-24, 1e-18, 1e-12, 1e12, 1e15, 5e18, 2e19, 1e20, 1e28, 1e36)
LIGHTS = (1e10, 1e15, 1e20, 1e30, 1e38)
SUNS = (1e-36, 1e-12, 1e12, 1e19, 1e20)


def far_light(radii: float, turn: int) -> Trial:
    """A ball on a floor, and a light so far away that its directions to the scene are the same in float32."""
    x, y, z = (radii * c for c in (0.36, 0.8, 0.48))
    return view(
        ball_on_floor(),
        [(x, y, z), (-z, 0.7 * y, -x)],
        (0.3, 1.7, 3.1),
        (-0.1, -0.45, -1),
        0.5,
        (24, 24),
        turn=turn,
    )


def sun(scale: float) -> Trial:
    """The same under directional lights, at a scale."""
    suns = [Light(way, directional=True) for way in ((0.36, 0.8, 0.48), (-0.9, 0.3, 0.1))]
    return view(ball_on_floor(), suns, (0.3, 1.7, 3.1), (-0.1, -0.45, -1), 0.5, (24, 24), scale=scale)


def _cases() -> Iterator[HardCase]:
    for scale in SCALES:
        yield HardCase(
            f"V scale {scale:g}", f"ball on a floor, scale {scale:g}", "float32 products that overflow or vanish",
            partial(small_scene, scale, 0.0),
        )  # fmt: skip
    for k, radii in enumerate(LIGHTS):
        yield HardCase(
            f"V far {radii:g}", f"light {radii:g} radii away", "directions and distances from a light far away",
            partial(far_light, radii, k % 3),
        )  # fmt: skip
    for scale in SUNS:
        yield HardCase(
            f"V sun {scale:g}", f"directional lights, scale {scale:g}", "a light that stands where float32 ends",
            partial(sun, scale),
        )  # fmt: skip
    yield HardCase(
        "V sun 3e21", "directional lights, scale 3e21", "a light at infinity, no shadow, and no word",
        partial(sun, 3e21), refused=True,
    )  # fmt: skip


CASES = tuple(_cases())
