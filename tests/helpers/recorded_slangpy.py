"""A recording that stands for slangpy: what the method ``driver`` asks it for, without a GPU."""

import sys
from enum import IntFlag
from types import SimpleNamespace
from unittest.mock import MagicMock

import numpy as np
import pytest

SIZES = {"acceleration_structure_size": 1000, "scratch_size": 64, "update_scratch_size": 32}


class Flags(IntFlag):
    none, allow_update, prefer_fast_trace, prefer_fast_build = 0, 1, 4, 8


class Recording:
    """What slangpy was asked for. ``arguments``: of each root object; ``memory``: of each buffer; ``builds``: in order."""

    def __init__(self) -> None:
        self.arguments: list[dict] = []
        self.memory: list[np.ndarray] = []
        self.slangpy, self.device = MagicMock(), MagicMock()
        self.slangpy.AccelerationStructureBuildFlags = Flags
        self.slangpy.AccelerationStructureBuildDesc = lambda facts: SimpleNamespace(**facts)
        self.slangpy.ShaderCursor.side_effect = lambda root: self.arguments.append({}) or self.arguments[-1]
        self.device.get_acceleration_structure_sizes.return_value = SimpleNamespace(**SIZES)
        self.device.create_buffer.side_effect = self._buffer

    def _buffer(self, size: int, usage: object) -> SimpleNamespace:
        self.memory.append(np.zeros(size, dtype=np.uint8))
        return SimpleNamespace(device_address=self.memory[-1].ctypes.data, size=size)

    @property
    def builds(self) -> list:
        encoder = self.device.create_command_encoder.return_value
        return [call.kwargs for call in encoder.build_acceleration_structure.call_args_list]


def recorded(monkeypatch: pytest.MonkeyPatch, device: object, memory: object) -> Recording:
    """A recording in the place of slangpy and of what ``device`` and ``memory``, modules of the method, make with it."""
    made = Recording()
    monkeypatch.setitem(sys.modules, "slangpy", made.slangpy)
    monkeypatch.setattr(device, "device_of", lambda api, alias: made.device)
    monkeypatch.setattr(device, "pipeline_of", lambda api, alias, holes: ("program", "pipeline", "table"))
    monkeypatch.setattr(memory.SharedMemory, "submit", lambda self, encoder, reads=(), writes=(): encoder.finish())
    return made
