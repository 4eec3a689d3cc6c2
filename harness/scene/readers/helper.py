"""The process that reads files which are not trusted, for :mod:`.readers.apart`; it ends with the one that started it.

A message is two lengths, of a JSON text and of the arrays that follow it, then both. A dataclass, an array, a path or a
tuple is an object in the text with one key that says which; arrays stand in the order in which the text names them.
"""

import contextlib
import dataclasses
import json
import os
import resource
import signal
import socket
import struct
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import UserError
from .. import scene
from . import checks, load

HEAD = struct.Struct("<QQ")
"""Bytes of the text and of all arrays."""

MOST_TEXT = 1 << 26
"""Longest text of a message, bytes."""

CLASSES = {
    kind.__name__: kind
    for module in (scene, checks)
    for kind in vars(module).values()
    if isinstance(kind, type) and dataclasses.is_dataclass(kind)
}
"""What a message may hold, by name."""

NUMBERS = "fiub"
"""Kinds of numpy's types that an array of a message may have: never an object."""

TASKS: dict[str, Callable[..., Any]] = {"load": load.load, "load_sequence": load.load_sequence}


def serve(handle: int) -> None:
    """Answer requests on a socket until its other end is closed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches the whole group: the other process decides
    sys.dont_write_bytecode = True
    for limit in (resource.RLIMIT_CORE, resource.RLIMIT_FSIZE):
        resource.setrlimit(limit, (0, 0))
    with socket.socket(fileno=handle) as line, contextlib.suppress(EOFError, BrokenPipeError):
        while True:
            request = received(line)
            os.chdir(request["folder"])
            limit_to(request["memory"], request["seconds"])
            send(line, answer(request))


def answer(request: dict[str, Any]) -> dict[str, Any]:
    """What came of a request: ``result``, ``error`` with its one line, ``memory`` that ran out, or a reader's ``fault``."""
    try:
        return {"result": TASKS[request["task"]](*request["arguments"])}
    except UserError as error:
        short_of_memory = isinstance(error.__cause__, MemoryError)
        return {"memory": True} if short_of_memory else {"error": str(error)}
    except MemoryError:
        return {"memory": True}
    except Exception as error:
        return {"fault": f"{type(error).__name__}: {error}"}


def limit_to(memory: int, seconds: int) -> None:
    """Limit this process to so many bytes of memory more than it has now, and so many seconds of the processor."""
    with contextlib.suppress(OSError, ValueError):  # not every system can limit memory
        pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0])
        _soft_limit(resource.RLIMIT_AS, pages * resource.getpagesize() + memory)
    used = resource.getrusage(resource.RUSAGE_SELF)
    _soft_limit(resource.RLIMIT_CPU, int(used.ru_utime + used.ru_stime) + 1 + seconds)


def _soft_limit(kind: int, value: int) -> None:
    _, hard = resource.getrlimit(kind)
    resource.setrlimit(kind, (value if hard == resource.RLIM_INFINITY else min(value, hard), hard))


def send(line: socket.socket, value: Any) -> None:
    """Send a value: texts, numbers, lists, dictionaries, tuples, paths, arrays and the dataclasses of a scene."""
    arrays: list[NDArray] = []
    text = json.dumps(_packed(value, arrays)).encode()
    line.sendall(HEAD.pack(len(text), sum(array.nbytes for array in arrays)) + text)
    for array in arrays:
        if array.nbytes:
            line.sendall(array.data.cast("B"))


def received(line: socket.socket, wait: Callable[[], None] = lambda: None, most: int = 0) -> Any:
    """The next value. ``wait``: called before each read. ``most``: bytes of arrays that it may hold.

    Raises EOFError at the end, ValueError, KeyError or TypeError for a wrong message.
    """
    text_length, array_bytes = HEAD.unpack(_bytes(line, HEAD.size, wait))
    if text_length > MOST_TEXT or array_bytes > most:
        raise ValueError(f"a text of {text_length} bytes with {array_bytes} bytes of arrays")
    unpacked = _Unpacked(line, wait, array_bytes)
    value = unpacked.value(json.loads(_bytes(line, text_length, wait)))
    if unpacked.left:
        raise ValueError(f"{unpacked.left} bytes of no array")
    return value


def _bytes(line: socket.socket, count: int, wait: Callable[[], None]) -> bytearray:
    content = bytearray(count)
    _fill(line, memoryview(content), wait)
    return content


def _fill(line: socket.socket, room: memoryview, wait: Callable[[], None]) -> None:
    while room:
        wait()
        got = line.recv_into(room)
        if not got:
            raise EOFError
        room = room[got:]


def _packed(value: Any, arrays: list[NDArray]) -> Any:
    if isinstance(value, np.ndarray):
        arrays.append(np.ascontiguousarray(value))
        return {"array": [value.dtype.newbyteorder("=").str, *value.shape]}
    if isinstance(value, np.generic):
        return value.item()
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        fields = {one.name: _packed(getattr(value, one.name), arrays) for one in dataclasses.fields(value)}
        return {type(value).__name__: fields}
    if isinstance(value, Path):
        return {"path": str(value)}
    if isinstance(value, tuple):
        return {"tuple": [_packed(one, arrays) for one in value]}
    if isinstance(value, list):
        return [_packed(one, arrays) for one in value]
    if isinstance(value, dict):
        return {"dict": [[key, _packed(one, arrays)] for key, one in value.items()]}
    return value


class _Unpacked:
    """The values of a message's text, with its arrays as they arrive. ``left``: bytes of arrays that are still to come."""

    def __init__(self, line: socket.socket, wait: Callable[[], None], left: int):
        self.line = line
        self.wait = wait
        self.left = left

    def value(self, found: Any) -> Any:
        if isinstance(found, list):
            return [self.value(one) for one in found]
        if not isinstance(found, dict):
            return found
        ((kind, content),) = found.items()
        if kind == "array":
            return self.array(*content)
        if kind == "path":
            return Path(content)
        if kind == "tuple":
            return tuple(self.value(one) for one in content)
        if kind == "dict":
            return {key: self.value(one) for key, one in content}
        return CLASSES[kind](**{name: self.value(one) for name, one in content.items()})

    def array(self, kind: str, *shape: int) -> NDArray:
        dtype = np.dtype(kind)
        size = dtype.itemsize
        for count in shape:
            size *= count
        if dtype.kind not in NUMBERS or min(shape, default=0) < 0 or size > self.left:
            raise ValueError(f"an array of {kind} {shape}")
        made = np.empty(shape, dtype)
        if size:
            _fill(self.line, made.data.cast("B"), self.wait)
        self.left -= size
        return made
