"""Rays through a tree: kernels, and the passes of a frame that launch them."""
