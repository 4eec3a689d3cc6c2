"""A uniform grid traversed by packets of primary rays, slice by slice, on the CPU: Wald et al. 2006.

The grid is that of ``uniform_grid``, built in every frame. Shadow rays and mirrored rays are traced one by one, as there.
"""

from __future__ import annotations

from .method import CoherentGrid

METHOD = CoherentGrid
