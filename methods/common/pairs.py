"""Rooms of lists that grow between frames, and what a frame needed of them."""

from typing import Any

import numpy as np
import warp as wp

from ...harness.errors import CapacityRejected

PAIR_BYTES = 16
"""Two keys and two values of four bytes: a sort needs room for both sides."""

SPARE = 2
"""On a GPU a frame does not need as much of some lists each time: a pair is queued or not by what other threads have found.
Where lights and shares run at the same time, up to 1.5 times the undecided pairs of a launch pass by pass were seen, and a
replayed frame cannot ask for more room.
"""


def zeroed(kind: Any, size: int = 0, /, **others: Any) -> Any:
    """A struct whose arrays are zeros [size] on the current device. ``others``: sizes of some, and fields as they are."""
    struct = kind()
    for name, field in kind.vars.items():
        value = others.get(name, size)
        makes = isinstance(field.type, wp.array) and isinstance(value, int)
        setattr(struct, name, wp.zeros(value, dtype=field.type.dtype) if makes else value)
    return struct


@wp.kernel(enable_backward=False)
def need_kernel(scan: wp.array(dtype=wp.int64), need: wp.array(dtype=wp.int64), slot: wp.int32):
    need[slot] = scan[scan.shape[0] - 1]


def all_needs(*counts: wp.array) -> wp.array:
    """Counters of several kinds one after another, as :meth:`...harness.frame.method.Method.needs` gives them."""
    found = [array.numpy().astype(np.int64).ravel() for array in counts]
    return wp.array(np.concatenate(found), dtype=wp.int64, device="cpu")


def grown(needed: int, capacity: int, memory: int, what: str, varies: bool = False) -> int:
    """The new capacity: unchanged if it suffices, else a third more than needed. Of a list whose need ``varies`` from run to
    run, it suffices with a part in :data:`SPARE` to spare, and grows so that it does for a run that needs so much more.

    Raises :class:`CapacityRejected` if even the bare need exceeds ``memory`` bytes or what 31 bits can count.
    """
    enough, part = (needed + needed // SPARE, SPARE) if varies else (needed, 3)
    if enough <= capacity:
        return capacity
    if needed > capacity and (needed * PAIR_BYTES > memory or needed >= 2**30):
        raise CapacityRejected(f"needs {needed:,} {what} ({needed * PAIR_BYTES / 2**30:.1f} GiB)")
    return max(capacity, min(enough + enough // part + 1024, max(needed, memory // PAIR_BYTES), 2**30))
