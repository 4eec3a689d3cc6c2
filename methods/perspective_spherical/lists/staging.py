"""The blocks of the tracing kernels, and their shared memory: records that threads load for one another, and votes.

A record is moved 16 bytes at once, as in :mod:`...gpu.entries`; the parts of a tile of Warp's vectors would be moved one
by one. A round of a block takes two barriers: one between loading and testing, one in the vote on another round. On a CPU
the threads of a block are fibers of one thread, so that static memory is shared among them.
"""

import functools
from typing import Any

import warp as wp

BLOCKS = (32, 64, 128, 256)
"""Threads of a block on CUDA. On a CPU, blocks have one thread unless ``wp.config.enable_cpu_blocks`` is set."""

SHARED = """
#if defined(__CUDA_ARCH__)
__shared__ float4 shared[{count}];
#else
static float4 shared[{count}];
#endif
if (stores) {{
    float4 stored = {{value[0], value[1], value[2], value[3]}};
    shared[place] = stored;
    return value;
}}
float4 loaded = shared[place];
return {{loaded.x, loaded.y, loaded.z, loaded.w}};
"""


@functools.cache
def make_shared(count: int) -> Any:
    """shared(stores, place, value): ``count`` vec4f of a block. Stores ``value``, or returns what was stored.

    ``stores`` is a constant where it is called, so that one of the two is compiled. Only one such function may be called in
    a kernel: they have the same name.
    """

    @wp.func_native(SHARED.format(count=count))
    def shared(stores: wp.bool, place: wp.int32, value: wp.vec4f) -> wp.vec4f: ...

    return shared


@wp.func_native("""
#if defined(__CUDA_ARCH__)
__syncthreads();
#else
WP_TILE_SYNC();
#endif
""")
def wait_for_block():
    """Return when all threads of the block have come here. All must."""


@wp.func_native("""
#if defined(__CUDA_ARCH__)
return __syncthreads_or(wanted);
#else
static bool any;
any = false;
WP_TILE_SYNC();
if (wanted) any = true;
WP_TILE_SYNC();
bool result = any;
WP_TILE_SYNC();
return result;
#endif
""")
def any_of_block(wanted: wp.bool) -> wp.bool:
    """Whether any thread of the block wants it; also what :func:`wait_for_block` is."""


def block_for(threads: int) -> int:
    """The smallest block that holds ``threads``, or the largest there is."""
    return next((block for block in BLOCKS if block >= threads), BLOCKS[-1])


def wide(device: str) -> bool:
    """Whether thread blocks have more than one thread: on CUDA, and on a CPU with ``wp.config.enable_cpu_blocks``."""
    return wp.get_device(device).is_cuda or bool(wp.config.enable_cpu_blocks)


def staged(staging: str, device: str) -> bool:
    """Whether triangles are staged: where that is set, and blocks have more than one thread."""
    return staging == "shared" and wide(device)
