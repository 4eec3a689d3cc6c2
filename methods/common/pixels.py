"""Which pixel a thread takes: plain rows, or blocks of 8x4 so that the 32 threads of a warp trace similar rays."""

from __future__ import annotations

import warp as wp

BLOCK_WIDTH = wp.constant(8)
BLOCK_HEIGHT = wp.constant(4)
OUTSIDE = wp.constant(-1)


@wp.func
def pixel_of(thread: wp.int32, width: wp.int32, height: wp.int32, blocks: wp.bool) -> wp.int32:
    """The pixel index of a thread, or OUTSIDE where a block reaches over the image's edge."""
    if not blocks:
        return thread
    across = (width + BLOCK_WIDTH - 1) // BLOCK_WIDTH
    block = thread // (BLOCK_WIDTH * BLOCK_HEIGHT)
    lane = thread % (BLOCK_WIDTH * BLOCK_HEIGHT)
    x = (block % across) * BLOCK_WIDTH + lane % BLOCK_WIDTH
    y = (block // across) * BLOCK_HEIGHT + lane // BLOCK_WIDTH
    if x >= width or y >= height:
        return OUTSIDE
    return y * width + x


def thread_count(width: int, height: int, blocks: bool) -> int:
    """How many threads :func:`pixel_of` needs."""
    if not blocks:
        return width * height
    return -(-width // 8) * -(-height // 4) * 32


# The approximate quotient is off by less than 2^-21 of itself, a few roundings of float32, so by less than one.
@wp.func_native("""
#if defined(__CUDA_ARCH__)
int quotient = (int)__fdividef((float)a, (float)b), rest = a - quotient * b;
return quotient + (rest >= b) - (rest < 0);
#else
return a / b;
#endif
""")
def whole_quotient(a: wp.int32, b: wp.int32) -> wp.int32:
    """a / b rounded down; 0 <= a, 0 < b, a / b < 2^15. Half of the instructions of a division."""


@wp.func
def tile_pixel(k: wp.int32, width: wp.int32, height: wp.int32) -> wp.vec2i:
    """Column and row of a thread's pixel, 8 x 4 pixels per warp, or -1: neighbours on the image mostly share a cell."""
    across = (width + 7) >> 3
    tile = k >> 5
    down = whole_quotient(tile, across)
    x = ((tile - down * across) << 3) | (k & 7)
    y = (down << 2) | ((k >> 3) & 3)
    if x >= width or y >= height:
        return wp.vec2i(-1, -1)
    return wp.vec2i(x, y)


@wp.func
def tile_threads(width: wp.int32, height: wp.int32) -> wp.int32:
    """How many threads :func:`tile_pixel` needs (:func:`thread_count`)."""
    return ((width + 7) >> 3) * ((height + 3) >> 2) * 32
