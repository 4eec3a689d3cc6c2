"""A kd-tree by the surface area heuristic, built on the device in every frame: Zhou et al. 2008."""

from .method import KdTree

METHOD = KdTree

__all__ = ["METHOD", "KdTree"]
