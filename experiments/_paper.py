"""What experiments share: the paper's configuration and its scenes; presets, :func:`small` for a CPU within minutes and
:func:`large` for a GPU at the paper's size.

Culling is off on all six scenes. All that the paper says of it is "we also can remove back-facing triangles" (section 3):
it is an option, and no result mentions it. It loses hits on a surface that is not closed: Fairy, Sibenik, Bunny/Dragon,
Conference and Cloth are not; only Buddha is. There ``ablation`` measures it separately, with the exact triangle test:
with the paper's test a ray may pass between two front faces and then meets no back face either.
"""

from importlib.util import find_spec
from typing import Any

from ..harness.runner.planning.experiment import Entry, Preset
from ..methods.perspective_spherical.parameters import PAPER

METHOD = "perspective_spherical"

SCENES = ("fairy", "sibenik", "bunny_dragon", "conference", "cloth", "buddha")  # the paper's, in its order
REAL = ("bunny",) if find_spec("pxr") else ()  # a small real scene that needs no download, where USD files can be read
UNBALANCED = "65536"  # hardly any tile has so many rays, except where a far light leaves few tiles: no load balancing


def faithful(label: str, **changes: str) -> Entry:
    """The paper's configuration with some settings changed."""
    return Entry(METHOD, {**PAPER, **changes}, label)


def small(
    side: int, scenes: tuple[str, ...], methods: tuple[Entry, ...], budget_s: float, samples: int = 3, **other: Any
) -> Preset:
    """One frame in one round."""
    usual = {"frames": 1, "samples": samples, "most": samples, "stage_samples": 1, "rounds": 1}
    return Preset(side, side, scenes, methods, budget_s=budget_s, **usual | other)


def large(scenes: tuple[str, ...], methods: tuple[Entry, ...], budget_s: float = 9.0, **other: Any) -> Preset:
    """Nine rounds of one frame of 1024x1024, sampled until its median is known to half a per cent."""
    usual = {
        "frames": 1, "samples": 5, "most": 20, "deviation": 0.005, "stage_samples": 2, "rounds": 9,
        "timeout_s": 600.0,
    }  # fmt: skip
    return Preset(1024, 1024, scenes, methods, budget_s=budget_s, **usual | other)
