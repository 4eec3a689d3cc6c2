"""The process that reads files which are not trusted, for :mod:`.readers.apart`; it ends with the one that started it.

A message is two lengths, of a JSON text and of the arrays that it names, then the text and the arrays in its order. In the
text a dataclass, an array and a path are objects with the key ``""``, which says what they are; tuples arrive as tuples
where they belong to a dataclass.
"""

import contextlib
import dataclasses
import json
import math
import os
import resource
import signal
import struct
import sys
from collections.abc import Callable
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import UserError
from .. import scene
from . import checks, load

HEAD = struct.Struct("<QQ")  # bytes of the text and of all arrays
MOST_TEXT = 1 << 26  # longest text of a message, bytes

CLASSES = {  # what a message may hold, by name
    kind.__name__: kind
    for module in (scene, checks)
    for kind in vars(module).values()
    if isinstance(kind, type) and dataclasses.is_dataclass(kind)
}

NUMBERS = "fiub"  # kinds of numpy's types that an array of a message may have: never an object

TASKS: dict[str, Callable[..., Any]] = {"load": load.load, "load_sequence": load.load_sequence}


def serve(handle: int) -> None:
    """Answer requests on a socket until its other end is closed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches the whole group: the other process decides
    sys.dont_write_bytecode = True
    for limit in (resource.RLIMIT_CORE, resource.RLIMIT_FSIZE):
        resource.setrlimit(limit, (0, 0))
    with Connection(handle) as line, contextlib.suppress(EOFError, ConnectionError):
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


def send(line: Connection, value: Any) -> None:
    """Send a value: texts, numbers, lists, dictionaries, tuples, paths, arrays and the dataclasses of a scene."""
    arrays: list[NDArray] = []

    def described(one: Any) -> Any:
        if isinstance(one, np.ndarray):
            arrays.append(np.ascontiguousarray(one, one.dtype.newbyteorder("=")))
            return {"": "array", "of": [arrays[-1].dtype.str, *one.shape]}
        if dataclasses.is_dataclass(one):
            fields = {field.name: getattr(one, field.name) for field in dataclasses.fields(one)}
            return {"": type(one).__name__, "of": fields}
        return {"": "path", "of": str(one)} if isinstance(one, Path) else one.item()

    text = json.dumps(value, default=described).encode()
    head = HEAD.pack(len(text), sum(array.nbytes for array in arrays))
    for left in (memoryview(head + text), *(array.reshape(-1).view(np.uint8).data for array in arrays)):
        while left:
            left = left[os.write(line.fileno(), left) :]


def received(line: Connection, most: int = 0) -> Any:
    """The next value, with at most ``most`` bytes of arrays. Raises EOFError, OSError, or what a wrong message does."""
    text_length, left = HEAD.unpack(_filled(line, bytearray(HEAD.size)))
    if text_length > MOST_TEXT or left > most:
        raise ValueError(f"a text of {text_length} bytes with {left} bytes of arrays")

    def made(found: dict[str, Any]) -> Any:
        nonlocal left
        if found.keys() != {"", "of"} or not isinstance(found[""], str):
            return found
        kind, content = found[""], found["of"]
        if kind == "path":
            return Path(content)
        if kind != "array":
            return CLASSES[kind](**{name: _tuples(one) for name, one in content.items()})
        name, *shape = content
        dtype = np.dtype(name)
        size = dtype.itemsize * math.prod(shape)
        if dtype.kind not in NUMBERS or min(shape, default=0) < 0 or size > left:
            raise ValueError(f"an array of {dtype} {shape}")
        left -= size
        array = np.empty(shape, dtype)
        _filled(line, array.reshape(-1).view(np.uint8))
        return array

    value = json.loads(_filled(line, bytearray(text_length)), object_hook=made)
    if left:
        raise ValueError(f"{left} bytes of no array")
    return value


def _filled(line: Connection, room: Any) -> Any:
    """A buffer of bytes, after filling it with the next ones."""
    left = memoryview(room)
    while left:
        got = os.readv(line.fileno(), [left])
        if not got:
            raise EOFError
        left = left[got:]
    return room


def _tuples(value: Any) -> Any:
    return tuple(map(_tuples, value)) if isinstance(value, list) else value
