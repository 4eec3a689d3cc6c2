"""What the rays of a light cover of its cube: the rectangle, as the rays make it, and the table, as its triangles read it.

The rectangle is int32 [12]: the sides of what the rays cover of face 0, whether each face is in use, the largest coordinate
of a hit point, and what the scene may cover of face 0.

Rows of the table, vec4f: of a face (low u, low v, bins per u, bins per v), zero if it has no ray; after the faces
(cells along a face, largest coordinate of a hit point, sum of 2^face of those with rays, 0).
"""

import warp as wp

from ...gpu.entries import entry
from .cells import FACES

BINS = wp.constant(32)
"""Of each axis of a face (:mod:`.spacing`)."""

LOW_U, LOW_V, HIGH_U, HIGH_V = wp.constant(0), wp.constant(1), wp.constant(2), wp.constant(3)
"""The first words: the sides of what the rays cover of face 0, :func:`ordered`: the least u and v, and the least -u and -v.
Without a ray they are :data:`EMPTY`.
"""

FACE = wp.constant(4)
"""From this word on, one for each face: 0 where rays lie on it, else :data:`EMPTY`."""

LARGEST = wp.constant(10)
"""After the faces: bits of the largest coordinate of a hit point, as float32; 0 without a ray."""

RANGE = wp.constant(11)
"""Last: a bound on the magnitude of u and v of what the scene covers of face 0, as float32; at most 1."""

RECTANGLE_WORDS = wp.constant(12)

EMPTY = wp.constant(2147483647)


@wp.func
def ordered(x: wp.float32) -> wp.int32:
    """An integer that is ordered as the floats are, so that atomics find the least."""
    bits = wp.cast(x, wp.int32)
    if bits < 0:
        bits = bits ^ 2147483647
    return bits


@wp.func
def from_ordered(bits: wp.int32) -> wp.float32:
    """The float of an integer made by :func:`ordered`."""
    word = bits
    if word < 0:
        word = word ^ 2147483647
    return wp.cast(word, wp.float32)


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


@wp.func
def face_rectangle(face: wp.int32, rectangle: wp.array(dtype=wp.int32)) -> wp.vec4f:
    """(low u, low v, bins per u, bins per v) of a face (:mod:`.spacing`)."""
    low_u = wp.float32(-1.0)
    low_v = wp.float32(-1.0)
    high_u = wp.float32(1.0)
    high_v = wp.float32(1.0)
    if face == 0:
        low_u = from_ordered(rectangle[LOW_U])
        low_v = from_ordered(rectangle[LOW_V])
        high_u = -from_ordered(rectangle[HIGH_U])
        high_v = -from_ordered(rectangle[HIGH_V])
    n = wp.float32(BINS)
    margin = 1.0e-6 * wp.max(wp.max(wp.abs(low_u), wp.abs(high_u)), wp.max(wp.abs(low_v), wp.abs(high_v))) + 1.0e-30
    return wp.vec4f(low_u, low_v, n / (high_u - low_u + margin), n / (high_v - low_v + margin))


@wp.func
def cells_in_use(rectangle: wp.array(dtype=wp.int32), cells: wp.vec3i) -> wp.int32:
    """Cells along a face: the first number where rays lie on many faces, the second where they lie on at most ``cells[2]``.
    Face 0 counts even without rays.

    In finer cells a triangle meets fewer rays that it does not cover, but the cells of every face in use are cleared and
    summed.
    """
    others = wp.int32(0)
    for k in range(1, FACES):
        if rectangle[FACE + k] == 0:
            others += 1
    return wp.where(others < cells[2], cells[1], cells[0])


@wp.func
def face_in_use(rectangle: wp.array(dtype=wp.int32), number: wp.int32) -> wp.int32:
    """Face ``number``, counted from 0, of those that hold rays; -1 if there are no more."""
    found = wp.int32(-1)
    left = wp.int32(number)
    for k in range(FACES):
        if rectangle[FACE + k] == 0:
            if left == 0:
                found = k
            left -= 1
    return found


@wp.func
def set_table(k: wp.int32, rectangle: wp.array(dtype=wp.int32), table: wp.array(dtype=wp.vec4f), along: wp.int32):
    """Set row k of the table, if there is one; ``along``: cells along a face."""
    if k < FACES:
        t = wp.vec4f(0.0, 0.0, 0.0, 0.0)
        if rectangle[FACE + k] == 0:
            t = face_rectangle(k, rectangle)
        table[k] = t
    if k == FACES:
        faces = wp.int32(0)
        for face in range(FACES):
            if rectangle[FACE + face] == 0:
                faces = faces | (1 << face)
        table[k] = wp.vec4f(wp.float32(along), wp.cast(rectangle[LARGEST], wp.float32), wp.float32(faces), 0.0)


@wp.func
def last_row(table: wp.array(dtype=wp.vec4f)) -> wp.vec4f:
    """The row for all faces, which the functions below read."""
    return entry(table, FACES)


@wp.func
def cells_of(row: wp.vec4f) -> wp.int32:
    """Cells along a face."""
    return wp.int32(row[0])


@wp.func
def faces_of(row: wp.vec4f) -> wp.uint32:
    """A bit for each face with rays."""
    return wp.uint32(row[2])


@wp.func
def max_coordinate_of(row: wp.vec4f) -> wp.float32:
    """The largest coordinate of a hit point."""
    return row[1]
