"""The paper's configuration for the experiments that start from it, and its scenes.

Culling is off on all six scenes. All that the paper says of it is "we also can remove back-facing triangles" (section 3):
it is an option, and no result mentions it. It loses hits on a surface that is not closed: Fairy, Sibenik, Bunny/Dragon,
Conference and Cloth are not; only Buddha is. There ``ablation`` measures it separately, with the exact triangle test:
with the paper's test a ray may pass between two front faces and then meets no back face either.
"""

from importlib.util import find_spec

from ..harness.runner.planning.experiment import Entry
from ..methods.perspective_spherical.parameters import PAPER

METHOD = "perspective_spherical"

SCENES = ("fairy", "sibenik", "bunny_dragon", "conference", "cloth", "buddha")
"""The paper's, in its order."""

REAL = ("bunny",) if find_spec("pxr") else ()
"""A small real scene that needs no download, where USD files can be read."""

UNBALANCED = "65536"
"""A value of r that hardly any tile exceeds, except where a far light leaves few tiles: no load balancing."""


def faithful(label: str, **changes: str) -> Entry:
    """The paper's configuration with some settings changed."""
    return Entry(METHOD, {**PAPER, **changes}, label)
