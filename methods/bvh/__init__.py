"""Bounding volume hierarchies of Warp: its Mesh as users call it, and its Bvh rebuilt in place."""

from .method import WarpBvh

METHOD = WarpBvh

__all__ = ["METHOD", "WarpBvh"]
