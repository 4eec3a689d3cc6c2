"""The driver's own ray tracing, OptiX, through slangpy: in hardware where the card has units for it."""

from .method import Driver

METHOD = Driver

__all__ = ["METHOD", "Driver"]
