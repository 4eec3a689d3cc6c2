"""Bounding volume hierarchies of Warp: wp.Mesh through its public interface, and wp.Bvh rebuilt in place."""

from .method import WarpBvh

METHOD = WarpBvh

__all__ = ["METHOD", "WarpBvh"]
