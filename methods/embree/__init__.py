"""Embree through embreex, used directly: a CPU peer of every other method."""

from .method import Embree

METHOD = Embree

__all__ = ["METHOD", "Embree"]
