"""What can be set of the shadow map: its resolution and shape (build), and how it is asked (trace)."""

from __future__ import annotations

import math
from dataclasses import dataclass

SHAPES = ("auto", "aimed", "cube")
BIASES = ("none", "constant", "slope", "normal")
FILTERS = ("nearest", "pcf")
DEFAULT_AMOUNT = {"none": 0.0, "constant": 0.002, "slope": 1.0, "normal": 1.5}
"""Amounts that engines start from: share of the depth range, texels of slope, texels along the normal."""

SIZES = (64, 16384)


@dataclass(frozen=True)
class Build:
    """How the depth map is made.

    size   texels along a side of a map (of each face of a cube)
    shape  "aimed": one perspective map that holds the scene's box; "cube": six maps around the light; "auto":
           aimed where the box fits into 60 degrees about the light's view of its middle, else a cube
    strip_capacity  initial room for queued strips of large triangles (GPU); 0 chooses; grows as needed
    """

    size: int = 2048
    shape: str = "auto"
    strip_capacity: int = 0

    def __post_init__(self) -> None:
        if not SIZES[0] <= self.size <= SIZES[1]:
            raise ValueError(f"size must be {SIZES[0]} to {SIZES[1]} texels")
        if self.shape not in SHAPES:
            raise ValueError(f"shape must be one of {', '.join(SHAPES)}")
        if not 0 <= self.strip_capacity <= 2**28:
            raise ValueError("strip_capacity must be 0..2^28")


@dataclass(frozen=True)
class Trace:
    """How the map is asked.

    bias    "none": the hit point as it is; "constant": nearer to the light by ``amount`` of the map's depth range;
            "slope": by ``amount`` texels times the receiver's slope against the map (slope-scaled, at most 10
            texels); "normal": moved along its normal by ``amount`` texels times the sine of the light's angle
    amount  see bias; negative chooses what engines start from: 0.002, 1 texel, 1.5 texels
    filter  "nearest": one texel; "pcf": percentage-closer filtering (Reeves et al. 1987), 3 x 3 comparisons of
            which more than half must say shadow. Slope and normal amounts are tripled for it, because it looks
            that much further sideways.
    """

    bias: str = "slope"
    amount: float = -1.0
    filter: str = "nearest"

    def __post_init__(self) -> None:
        if self.bias not in BIASES:
            raise ValueError(f"bias must be one of {', '.join(BIASES)}")
        if self.filter not in FILTERS:
            raise ValueError(f"filter must be one of {', '.join(FILTERS)}")
        if not math.isfinite(self.amount):
            raise ValueError("amount must be finite")

    @property
    def bias_amount(self) -> float:
        """The amount that is used."""
        return DEFAULT_AMOUNT[self.bias] if self.amount < 0.0 else self.amount
