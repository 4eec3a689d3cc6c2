"""A kernel of a test, launched: numpy arrays go in and come out."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

Shape = int | tuple[int, ...]


def launched(
    kernel: wp.Kernel, dim: Shape, inputs: Sequence[Any], shapes: Sequence[Shape], device: str = "cpu"
) -> list[NDArray]:
    """What a kernel writes to its last parameters, which are zeros of these shapes before.

    Numpy arrays among the inputs become arrays of the types that the kernel declares.
    """
    declared = [parameter.type for parameter in kernel.adj.args]
    assert len(declared) == len(inputs) + len(shapes)
    with wp.ScopedDevice(device):
        given = [
            wp.array(np.ascontiguousarray(value), dtype=kind.dtype) if isinstance(value, np.ndarray) else value
            for value, kind in zip(inputs, declared, strict=False)
        ]
        made = [wp.zeros(shape, dtype=kind.dtype) for shape, kind in zip(shapes, declared[len(inputs) :], strict=True)]
        wp.launch(kernel, dim, given, made)
    return [array.numpy() for array in made]
