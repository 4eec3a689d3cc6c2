"""The parameters of the shadow map: its resolution and shape (build), and how it is looked up (trace)."""

import math
from dataclasses import dataclass

from ..common.parameters import check_choices

SHAPES = ("auto", "aimed", "cube")
BIASES = ("none", "constant", "slope", "normal")
FILTERS = ("nearest", "pcf", "soft")
DEFAULT_AMOUNT = {"none": 0.0, "constant": 0.002, "slope": 1.0, "normal": 1.5}
"""Amounts that engines start from: share of the depth range, texels of slope, texels along the normal."""

SIZES = (64, 16384)


@dataclass(frozen=True)
class Build:
    """How the depth map is made.

    size   texels along each side of a map, or of each face of a cube
    shape  "aimed": one perspective map that holds the scene's box; "cube": six maps around the light; "auto":
           aimed where the box fits into 60 degrees about the light's view of its middle, else a cube
    strip_capacity  initial capacity, entries, of the queue of strips of large triangles (GPU); 0 chooses; grows when a
                    frame needs more
    """

    size: int = 2048
    shape: str = "auto"
    strip_capacity: int = 0

    def __post_init__(self) -> None:
        if not SIZES[0] <= self.size <= SIZES[1]:
            raise ValueError(f"size must be {SIZES[0]} to {SIZES[1]} texels")
        check_choices(self, shape=SHAPES)
        if not 0 <= self.strip_capacity <= 2**28:
            raise ValueError("strip_capacity must be 0..2^28")


@dataclass(frozen=True)
class Trace:
    """How the map is looked up.

    bias    what is done against self-shadowing: "none"; "constant": the hit point is compared as nearer to the light by
            ``amount`` of the map's depth range; "slope": as nearer by ``amount`` texels times the slope of its surface
            against the map, at most 10 texels; "normal": moved along its normal by ``amount`` texels times the sine of
            the light's angle
    amount  of the bias: a share of the depth range ("constant") or texels ("slope", "normal"); negative chooses what
            engines start from: 0.002, 1, 1.5
    filter  "nearest": one texel; "pcf": percentage-closer filtering (Reeves et al. 1987), a shadow where more than half
            of 3 x 3 texels are nearer; slope and normal amounts are tripled for it, because it looks up texels farther
            away; "soft": a light with an area has one map, drawn from the middle of its targets, and each target looks up
            another texel of it, so that their mean is percentage-closer filtering of one width everywhere
    spread  that width in sizes of the light: the penumbra of an occluder that is so many times as far from the receiver as
            from the light; for "soft" only
    """

    bias: str = "slope"
    amount: float = -1.0
    filter: str = "nearest"
    spread: float = 1.0

    def __post_init__(self) -> None:
        check_choices(self, bias=BIASES, filter=FILTERS)
        if not math.isfinite(self.amount):
            raise ValueError("amount must be finite")
        if not 0.0 < self.spread < math.inf:
            raise ValueError("spread must be finite and greater than 0")

    @property
    def bias_amount(self) -> float:
        """The amount that is used."""
        return DEFAULT_AMOUNT[self.bias] if self.amount < 0.0 else self.amount
