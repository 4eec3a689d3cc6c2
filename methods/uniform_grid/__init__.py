"""A uniform grid rebuilt every frame by sorting (triangle, cell) pairs: Kalojanov & Slusallek 2009."""

from .method import UniformGrid

METHOD = UniformGrid

__all__ = ["METHOD", "UniformGrid"]
