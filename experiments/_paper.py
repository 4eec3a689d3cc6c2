"""The paper's configuration for the experiments that start from it: the method's own ``PAPER``, culling apart.

Culling is off here: section 3 offers it ("we also can remove back-facing triangles"), and it is legal only for
closed scenes, of which the six have one; ``ablation`` measures it.
"""

from __future__ import annotations

from ..harness.plan import Entry
from ..methods.perspective_spherical.parameters import PAPER

METHOD = "perspective_spherical"

SCENES = ("fairy", "sibenik", "bunny_dragon", "conference", "cloth", "buddha")
"""The paper's, in its order."""

FAITHFUL = {**PAPER, "cull": "off"}


def faithful(label: str, **changes: str) -> Entry:
    """The paper's configuration with some settings changed."""
    return Entry(METHOD, {**FAITHFUL, **changes}, label)
