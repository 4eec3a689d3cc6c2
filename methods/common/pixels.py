"""Which pixel a thread takes: those of a warp a block of 8 x 4, so that their rays are similar."""

import warp as wp


def thread_count(width: int, height: int) -> int:
    """Threads of a kernel over an image, in whole blocks."""
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
    """Column and row of a thread's pixel; -1 where its block reaches over the image's edge."""
    across = (width + 7) >> 3
    tile = k >> 5
    down = whole_quotient(tile, across)
    x = ((tile - down * across) << 3) | (k & 7)
    y = (down << 2) | ((k >> 3) & 3)
    if x >= width or y >= height:
        return wp.vec2i(-1, -1)
    return wp.vec2i(x, y)


@wp.func
def pixel_of(thread: wp.int32, width: wp.int32, height: wp.int32) -> wp.int32:
    """The index of :func:`tile_pixel`, or -1."""
    at = tile_pixel(thread, width, height)
    return wp.where(at[0] < 0, -1, at[1] * width + at[0])


@wp.func
def tile_threads(width: wp.int32, height: wp.int32) -> wp.int32:
    """:func:`thread_count`, in a kernel."""
    return ((width + 7) >> 3) * ((height + 3) >> 2) * 32
