"""Room for the shadow bits of many targets: what they need, and how many fit where a method was rejected."""

from collections.abc import Callable
from dataclasses import replace

from ..errors import CapacityRejected
from ..scene.effects import Effects, Limits
from ..scene.prepared import Prepared, under
from ..texts import numbered


def check_bits(effects: Effects, pixels: int, targets: int, limits: Limits) -> None:
    """Raise :class:`~..errors.CapacityRejected` where the shadow bits alone exceed the limit of memory: a byte for each
    target and pixel, as many for receivers, and so for each bounce.
    """
    limited = any(effects.has_receivers(i) for i in range(len(effects.shadows)))
    needed = targets * pixels * (1 + limited) * (1 + effects.bounces)
    if needed > limits.memory:
        fit = limits.memory // (needed // targets)
        raise CapacityRejected(
            f"the shadow bits of {numbered(targets, 'target')} need {needed:,} bytes; "
            f"the limit is {limits.memory:,}, enough for {fit}"
        )


def fewer_that_fit(prepared: Prepared, planned: Callable[[Prepared], object]) -> str:
    """How many targets a light can be planned with after more were rejected, as the end of a message; "" without areas.

    planned  plans a method on a scene, and raises :class:`~..errors.CapacityRejected` where it needs too much
    """
    lights = prepared.scene.lights
    samples = most = max((light.samples for light in lights), default=1)
    while samples > 1:
        samples //= 2
        fewer = tuple(replace(light, samples=min(light.samples, samples)) for light in lights)
        try:
            planned(under(prepared, replace(prepared.scene, lights=fewer)))
        except CapacityRejected:
            continue
        return f"; {numbered(samples, 'target')} of a light fit, of {most:,}"
    return f"; not even one target of a light fits, of {most:,}" if most > 1 else ""
