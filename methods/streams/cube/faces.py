"""Where the shadow rays lie on the light's cube, and the rectangle that holds them all (:mod:`.aim`).

On a face, planes through the light are lines, so bounds computed there are exact.
"""

from __future__ import annotations

from typing import Any

import warp as wp

from ...exact.triangle import to_float64
from .aim import EMPTY, FACE, HIGH_U, HIGH_V, LARGEST, LOW_U, LOW_V, ordered


@wp.func
def face_of(q: wp.vec3d) -> wp.int32:
    """Face of the largest coordinate: 0 +x, 1 -x, 2 +y, 3 -y, 4 +z, 5 -z."""
    x = wp.abs(q[0])
    y = wp.abs(q[1])
    z = wp.abs(q[2])
    face = wp.int32(0)
    along = q[0]
    if y > x and y >= z:
        face = 2
        along = q[1]
    elif z > x and z > y:
        face = 4
        along = q[2]
    if along < wp.float64(0.0):
        face += 1
    return face


@wp.func
def on_face(q: Any, face: wp.int32) -> Any:
    """(along, across, up) of a point in the frame of a face."""
    r = q
    if face >> 1 == 1:
        r = type(q)(q[1], q[2], q[0])
    elif face >> 1 == 2:
        r = type(q)(q[2], q[0], q[1])
    if face & 1 == 1:
        r = type(q)(-r[0], r[1], r[2])
    return r


# The threads of a block combine their values before one thread per word updates the words that all blocks share: an
# access by every warp would be as many requests to one address of the second-level cache, and would take several times as
# long as the pass.
@wp.func_native(f"""
#if defined(__CUDA_ARCH__)
__shared__ int agreed[6];
if (threadIdx.x < 6) agreed[threadIdx.x] = threadIdx.x < {FACE} ? {EMPTY} : 0;
if (!__syncthreads_or(face >= 0)) return;
int used = face < 0 ? 0 : 1 << face;
#if __CUDA_ARCH__ >= 800
low_u = __reduce_min_sync(0xffffffffu, low_u);
low_v = __reduce_min_sync(0xffffffffu, low_v);
high_u = __reduce_min_sync(0xffffffffu, high_u);
high_v = __reduce_min_sync(0xffffffffu, high_v);
used = __reduce_or_sync(0xffffffffu, used);
largest = __reduce_max_sync(0xffffffffu, largest);
if ((threadIdx.x & 31) == 0 && used)
#else
if (used)
#endif
{{
    atomicMin(agreed + {LOW_U}, low_u);
    atomicMin(agreed + {LOW_V}, low_v);
    atomicMin(agreed + {HIGH_U}, high_u);
    atomicMin(agreed + {HIGH_V}, high_v);
    atomicOr(agreed + 4, used);
    atomicMax(agreed + 5, largest);
}}
__syncthreads();
int k = threadIdx.x, *word = words.data + k;
if (k < {FACE}) {{
    if (agreed[k] < __ldcg(word)) atomicMin(word, agreed[k]);
}} else if (k < {LARGEST}) {{
    if (agreed[4] >> (k - {FACE}) & 1 && __ldcg(word)) *word = 0;
}} else if (k == {LARGEST}) {{
    if (agreed[5] > __ldcg(word)) atomicMax(word, agreed[5]);
}}
#else
if (face < 0) return;
// Kernels may run in several threads. Few rays change a word, and what nobody writes the threads' caches share.
auto change = [&](int k, int value, bool raise) {{
    int *word = words.data + k, known = __atomic_load_n(word, __ATOMIC_RELAXED);
    while ((raise ? known < value : value < known) &&
        !__atomic_compare_exchange_n(word, &known, value, true, __ATOMIC_RELAXED, __ATOMIC_RELAXED)) {{}}
}};
change({LOW_U}, low_u, false);
change({LOW_V}, low_v, false);
change({HIGH_U}, high_u, false);
change({HIGH_V}, high_v, false);
change({FACE} + face, 0, false);
change({LARGEST}, largest, true);
#endif
""")
def record_rays(
    words: wp.array(dtype=wp.int32),
    low_u: wp.int32,
    low_v: wp.int32,
    high_u: wp.int32,
    high_v: wp.int32,
    face: wp.int32,
    largest: wp.int32,
):
    """Lower a rectangle's sides, mark the face as in use (-1: no ray), raise the largest coordinate.

    All threads of a block, full warps of it, must call it.
    """


@wp.func
def place_of(hit: wp.vec3d, light: wp.vec3f, frame: wp.mat33d) -> wp.vec4f:
    """(u, v, face, depth) of a hit point; computed in float64, so that u and v keep a float's digits at any distance.

    The depth is taken along the face's axis; infinite where the point is the light.
    """
    q = frame * (hit - to_float64(light))
    face = face_of(q)
    r = on_face(q, face)
    u = wp.float32(0.0)
    v = wp.float32(0.0)
    depth = wp.float32(wp.INF)
    if r[0] > wp.float64(0.0):
        scale = wp.float64(1.0) / r[0]
        u = wp.float32(r[1] * scale)
        v = wp.float32(r[2] * scale)
        depth = wp.float32(r[0])
    return wp.vec4f(u, v, wp.float32(face), depth)


@wp.func
def record_place(p: wp.vec4f, size: wp.float32, rectangle: wp.array(dtype=wp.int32)):
    """Include a place (face -1: no ray) and the size of its point in the bounds of all rays (:func:`record_rays`)."""
    low_u = EMPTY
    low_v = EMPTY
    high_u = EMPTY
    high_v = EMPTY
    face = wp.int32(p[2])
    if face == 0:
        low_u = ordered(p[0])
        low_v = ordered(p[1])
        high_u = ordered(-p[0])
        high_v = ordered(-p[1])
    record_rays(rectangle, low_u, low_v, high_u, high_v, face, wp.cast(size, wp.int32))
