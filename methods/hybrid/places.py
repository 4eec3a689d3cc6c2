"""The places of the triangles in a tree's order, by triangle."""

from __future__ import annotations

import warp as wp

from ..bvh2.records import Leaves, leads_here
from ..common.entries import entry, set_entry


@wp.kernel(enable_backward=False, grid_stride=False)
def places_kernel(leaves: Leaves, places: wp.array(dtype=wp.int32)):
    """One thread per place. Triangles that the tree leaves out keep their old value: no ray hits them."""
    at = wp.tid()
    if leads_here(leaves, at):
        set_entry(places, entry(leaves.order, at), at)
