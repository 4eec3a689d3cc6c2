"""Bits of a word, one after the other."""

import warp as wp


@wp.func_native("""
#if defined(__CUDA_ARCH__)
return __ffs(bits) - 1;
#else
return __builtin_ctz(bits);
#endif
""")
def lowest_bit(bits: wp.uint32) -> wp.int32:
    """The place of the lowest bit that is set, of a word that is not zero."""


@wp.func
def without_lowest_bit(bits: wp.uint32) -> wp.uint32:
    """The bits of a word but its lowest; zero of zero."""
    return bits & (bits - wp.uint32(1))
