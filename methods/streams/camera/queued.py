"""A queued triangle as pixels are tested against it: planes and 1 / t in the records of the queue."""

import warp as wp

from ....harness.frame.alpha import Alpha
from ....harness.frame.effects.specialise import effects
from ...gpu.entries import entry_now, entry_of_four, set_entry_of_four
from ..queues import Queue
from .pixels import Candidate, Planes


@wp.func
def store_candidate(queue: Queue, candidate: Candidate, more: wp.vec3f):
    """Store the planes of a candidate and its 1 / t, and a number ``more`` of each plane."""
    n0 = candidate.planes.n0
    n1 = candidate.planes.n1
    n2 = candidate.planes.n2
    set_entry_of_four(queue.records, candidate.i, 0, wp.vec4f(n0[0], n0[1], n0[2], more[0]))
    set_entry_of_four(queue.records, candidate.i, 1, wp.vec4f(n1[0], n1[1], n1[2], more[1]))
    set_entry_of_four(queue.records, candidate.i, 2, wp.vec4f(n2[0], n2[1], n2[2], more[2]))
    queue.depths[candidate.i] = candidate.m


@wp.struct
class StoredPlanes:
    """What :func:`store_candidate` stored of the planes."""

    planes: Planes
    more: wp.vec3f


@wp.func
def stored_planes(queue: Queue, i: wp.int32) -> StoredPlanes:
    r0 = entry_of_four(queue.records, i, 0)
    r1 = entry_of_four(queue.records, i, 1)
    r2 = entry_of_four(queue.records, i, 2)
    stored = StoredPlanes()
    stored.planes.n0 = wp.vec3f(r0[0], r0[1], r0[2])
    stored.planes.n1 = wp.vec3f(r1[0], r1[1], r1[2])
    stored.planes.n2 = wp.vec3f(r2[0], r2[1], r2[2])
    stored.more = wp.vec3f(r0[3], r1[3], r2[3])
    return stored


@wp.func
def stored_candidate(
    queue: Queue, i: wp.int32, planes: Planes, spare: wp.int32, bound: wp.float32, alpha: Alpha
) -> Candidate:
    """A queued triangle, with its :func:`stored_planes`."""
    candidate = Candidate()
    candidate.i = i
    candidate.spare = spare
    candidate.bound = bound
    candidate.sure = bound
    candidate.m = entry_now(queue.depths, i)
    candidate.planes = planes
    if wp.static(effects.alpha):
        if alpha.masked[i] != wp.uint8(0):
            candidate.sure = wp.INF
    return candidate
