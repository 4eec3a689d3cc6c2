"""What methods of a tree have in common: a tree, and the rays that are traced through it."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...harness.frame.method import BaseMethod
from .quality import expected
from .trace.tree_rays import TreeRays


class TreeMethod(BaseMethod):
    """``_tree`` says what it is by ``built()``. It and ``_rays`` are None before :meth:`plan`, and without triangles."""

    simulates = frozenset({"shadows", "receivers", "directional", "alpha", "mirror", "orthographic"})

    def __init__(self, build: Any = None, trace: Any = None):
        super().__init__(build, trace)
        self._capacity = self._memory = 0
        self._tree: Any = None
        self._rays: TreeRays | None = None

    def tests_per_pixel(self) -> tuple[NDArray[np.int32], ...]:
        """Triangle tests of each pixel's primary ray, and of its shadow rays."""
        assert self._rays is not None
        return self._rays.tests_per_pixel()

    def counters(self) -> dict[str, int]:
        """Pairs that were left to float64 in the last frame, and how good its trees were."""
        if self._rays is None:
            return {}
        counts = {f"{rays} undecided pairs": pairs for rays, pairs in self._rays.undecided_pairs().items()}
        return counts | expected(self._rays.tree)

    def built(self) -> dict[str, Any]:
        return {} if self._tree is None or self._rays is None else {**self._tree.built(), **self._rays.built()}
