"""Mirrors: what one and four bounces of mirrored rays cost in every structure that can trace them.

The paper (section 6): grids are inefficient for reflected rays, trees do better where the SIMD width is low, and no better
than grids where it is large. The perspective and spherical grids have no place for such rays at all.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..harness.report import compare, document, panels, style
from ..harness.runner.experiment import Entry, Experiment, Preset
from ..harness.scene.overrides import Lighting

if TYPE_CHECKING:
    import pandas as pd

GRIDS = (Entry("uniform_grid", {}, "uniform grid"),)
TREES = (
    Entry("bvh2", {}, "BVH2 rebuilt"),
    Entry("bvh2", {"precision": "float32"}, "BVH2 rebuilt, float32"),
    Entry("bvh", {"update": "bvh_rebuild"}, "Warp LBVH rebuilt"),
    Entry("embree", {}, "Embree"),
)
METHODS = (*GRIDS, *TREES)

BASE = "no mirrors"
LIGHTINGS = (
    Lighting(BASE, count=1),
    Lighting("1 bounce", count=1, bounces=1),
    Lighting("4 bounces", count=1, bounces=4),
)
"""The scene's largest triangles are mirrors (:func:`.scene.surface_rules.largest_triangles`)."""

COLUMNS = [*document.COMMON, "bounces", "added_ms", "added_spread_ms", "ratio", "memory_bytes"]
