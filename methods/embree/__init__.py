"""Embree, through its Python binding embreex: a CPU method to compare with."""

from .method import Embree

METHOD = Embree

__all__ = ["METHOD", "Embree"]
