"""Counting the work of mirrored rays, for methods whose kernels count their tests."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import warp as wp

from ...harness.frame.frame import Frame
from ...harness.scene.effects import Effects


def bounced_tests(
    frame: Frame, effects: Effects, trace: Callable[..., None], shadow: Callable[..., None]
) -> dict[str, int]:
    """Triangle tests of mirrored rays and of their hits' shadow rays, which are traced again to count them. {} without
    mirrored rays.

    trace   trace(tests, bounce);  shadow  shadow(light, tests, bounce): ``tests`` int32 [pixels] is filled or added to
    """
    if not effects.bounces:
        return {}
    first = wp.zeros(frame.pixels, dtype=wp.int32, device=frame.device)
    second = wp.zeros_like(first)
    mirrored, shadowed = 0, 0
    for bounce in range(1, effects.bounces + 1):
        first.zero_()
        second.zero_()
        trace(first, bounce)
        for light, wanted in enumerate(effects.shadows):
            if wanted:
                shadow(light, second, bounce)
        mirrored += int(first.numpy().sum(dtype=np.int64))
        shadowed += int(second.numpy().sum(dtype=np.int64))
    return {"mirror tests": mirrored, "mirror shadow tests": shadowed}
