"""The look of lights as numbers that a kernel reads."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from .scene.scene import Light

LAMP = 5
"""Numbers of a light's look: red, green and blue, fall-off, and whether its shadow bits count."""


def lamp_rows(lights: Sequence[Light], shadows: Sequence[bool]) -> NDArray[np.float64]:
    """The look of each light, float64 [light_count, 5]; all lights together, seen face on, make 1.

    ``shadows``: whether the bits of each count.
    """
    strength = sum(light.intensity * max(light.color) for light in lights) or 1.0
    rows = np.zeros((len(lights), LAMP))
    for i, light in enumerate(lights):
        rows[i, :3] = np.asarray(light.color) * (light.intensity / strength)
        rows[i, 3] = light.spot.falloff if light.spot is not None else 0.0
        rows[i, 4] = float(shadows[i])
    return rows
