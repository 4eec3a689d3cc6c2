"""The driver's own ray tracing, by OptiX or Vulkan, through slangpy: in hardware where the card has units for it."""

from .method import Driver

METHOD = Driver

__all__ = ["METHOD", "Driver"]
