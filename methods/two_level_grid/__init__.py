"""A grid of grids, rebuilt every frame by sorting: Kalojanov, Billeter & Slusallek 2011."""

from .method import TwoLevelGrid

METHOD = TwoLevelGrid

__all__ = ["METHOD", "TwoLevelGrid"]
