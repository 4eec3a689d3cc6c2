"""A uniform grid traversed by packets of coherent rays, slice by slice, on the CPU: Wald et al. 2006.

The grid is that of ``uniform_grid``, built in every frame. Primary and shadow rays are traced in packets; mirrored rays,
which are seldom coherent, one by one as in ``uniform_grid``.
"""

from __future__ import annotations

from .method import CoherentGrid

METHOD = CoherentGrid
