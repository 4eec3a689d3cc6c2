"""What is left of the primary rays, in one kernel of a GPU: undecided pairs, and further chunks of queued groups.

The pairs that the passes before have queued are decided first, then the chunks are tested. A warp keeps the pairs that are
undecided in its chunks in shared memory, and decides them 32 at a time. So there is no further pass that waits for the last
warps of this one.
"""

import warp as wp

from ....harness.frame.alpha import Alpha
from ....harness.frame.effects.specialise import effects
from ....harness.frame.geometry import Camera, Mesh
from ...common.reads import corners_at, ray_of_pixel, weld_at
from ...exact.holes import opaque_at_hit
from ...exact.triangle import hit_distance, spare_bits
from ...gpu.entries import entry, raise_entry
from ...gpu.warps import LANES, keep_pairs, kept_pair, lane_of, place_of_kept, warp_of
from ..queues import CHUNKS, Queue, held_undecided
from .pixels import hit_word, sign_bound
from .rows import queued_rows, rows_of_lanes, test_pixel_of

REGISTERS = 80

BLOCKS = 6
"""Blocks of 128 per multiprocessor that these registers leave room for."""


@wp.kernel(enable_backward=False, grid_stride=False, cuda_max_registers=REGISTERS)
def last_kernel(
    threads: wp.int32,
    size: wp.int32,
    camera: Camera,
    mesh: Mesh,
    alpha: Alpha,
    nearest: wp.array(dtype=wp.uint64),
    queue: Queue,
):
    """Undecided pairs and further chunks; ``size``: elements of a chunk, at most ``most_chunk`` of
    :class:`..constants.Constants`."""
    thread = wp.tid()
    k = warp_of(thread)
    lane = lane_of(thread)
    step = warp_of(threads)
    stop = wp.min(queue.counts[CHUNKS], queue.chunks.shape[0])
    listed = held_undecided(queue, thread)
    spare = spare_bits(queue.depths.shape[0])
    bound = sign_bound(camera.tangents)
    kept = place_of_kept()
    first = k * LANES
    held = wp.int32(0)
    # All lanes go on together. The code that decides is there once: pairs of the list and kept ones come to it in turn.
    while first < listed or held > 0 or k < stop:
        if first < listed or held >= LANES or (held > 0 and k >= stop):
            pair = wp.vec2i(-1, 0)
            if first < listed:
                if first + lane < listed:
                    pair = entry(queue.undecided, first + lane)
                first += step * LANES
            else:
                number = wp.min(held, LANES)
                held -= number
                found = kept_pair(kept, held + wp.min(lane, number - 1))
                if lane < number:
                    pair = found
            if pair[0] >= 0:
                i = pair[0]
                ray = ray_of_pixel(camera, pair[1])
                corners = corners_at(mesh, i)
                weld = weld_at(mesh, i)
                t = hit_distance(ray, corners, weld)
                hits = t > wp.float64(0.0)
                if wp.static(effects.alpha):
                    if hits:
                        hits = opaque_at_hit(alpha, i, ray, corners, weld)
                if hits:
                    raise_entry(nearest, pair[1], hit_word(wp.float64(1.0) / t, i, spare))
        else:
            further = entry(queue.chunks, k)
            k += step
            rows = queued_rows(queue, further[0], spare, bound, alpha)
            lanes = rows_of_lanes(rows, lane, camera)
            at = further[1] * size
            end = wp.min(lanes.number, at + size)
            while at < end:
                unsure, pixel = test_pixel_of(rows, lanes, at, end, lane, camera, nearest)
                at += LANES
                held = keep_pairs(unsure, rows.candidate.i, pixel, held, kept)
