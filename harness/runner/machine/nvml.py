"""A GPU as NVIDIA's management library knows it."""

import functools
from typing import Any


@functools.cache
def card_of(uuid: str) -> Any:
    """NVML's handle of a GPU. Raises ImportError without the library, and ``NVMLError``."""
    import pynvml

    pynvml.nvmlInit()
    return pynvml.nvmlDeviceGetHandleByUUID(uuid)
