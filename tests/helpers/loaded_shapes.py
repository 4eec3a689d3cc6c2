"""The measurements of a loaded file."""

from shadowbench.harness.scene import shape
from shadowbench.harness.scene.readers.checks import Loaded


def shape_of(loaded: Loaded) -> shape.Shape:
    return shape.shape_of(loaded.geometry(), loaded.up)
