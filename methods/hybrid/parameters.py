"""The parameters of the hybrid. None of them changes an answer."""

from __future__ import annotations

from dataclasses import dataclass

from ..trees.parameters import Build as TreeBuild
from ..trees.parameters import Trace as TreeTrace

SHADOWS = ("auto", "tree", "grid")


@dataclass(frozen=True)
class Build(TreeBuild):
    """How the tree is made, as of bvh2; and what takes the shadow rays."""

    shadows: str = "auto"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.shadows not in SHADOWS:
            raise ValueError(f"shadows must be one of {', '.join(SHADOWS)}")


Build.__doc__ = f"""{TreeBuild.__doc__}
    shadows     what takes the shadow rays: "tree": the tree, which all lights share; "grid": a grid of each light, as in
                ray_grids; the tree is then built for mirrored rays only; "auto": the grid where the mesh has more than
                one triangle for every 600 pixels (if a ray of a light crosses more than 1.05 triangles of the first frame on
                average: for every 64) and nothing is mirrored, otherwise the tree
    """


@dataclass(frozen=True)
class Trace:
    """How rays are traced through the tree, exactly.

    registers  limit of registers per thread of the kernels that trace on the GPU
    shares     parts of the pixels whose shadow rays the GPU traces at once, each with queues of its own
    threads    of a CPU: each streams a share of the triangles, and traces the shadow rays of a share of the pixels; 0: one
               for each core that this process may use, at most 16
    """

    registers: int = 48
    shares: int = 1
    threads: int = 0

    def __post_init__(self) -> None:
        self.of_tree()

    def of_tree(self) -> TreeTrace:
        """The same for the tree."""
        return TreeTrace(registers=self.registers, shares=self.shares, threads=self.threads)
