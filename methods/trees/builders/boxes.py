"""Boxes of triangles in C++, low then high corner, and how threads that climb a tree exchange them.

The leaves of a block lie side by side, and most nodes above them have leaves of that block only. Threads that climb through
those meet in shared memory: an exchange takes a tenth of the time that one in global memory takes, and the time of a build
is that of one exchange after another. A node is numbered by the last leaf of its left child.
"""

from ..constants import BLOCK

BOXES = """
auto clear = [&](float* box) { for (int k = 0; k < 6; k++) box[k] = k < 3 ? 3.4e38f : -3.4e38f; };
auto join = [&](float* box, const float* other) {
    for (int axis = 0; axis < 3; axis++) {
        box[axis] = low(box[axis], other[axis]);
        box[axis + 3] = high(box[axis + 3], other[axis + 3]);
    }
};
auto box_of_triangle = [&](int at, float* box) {
    wp::vec3i face = mesh.triangles.data[at];
    const float* a = (const float*)(mesh.points.data + face[0]);
    const float* b = (const float*)(mesh.points.data + face[1]);
    const float* c = (const float*)(mesh.points.data + face[2]);
    for (int axis = 0; axis < 3; axis++) {
        box[axis] = low(a[axis], low(b[axis], c[axis]));
        box[axis + 3] = high(a[axis], high(b[axis], c[axis]));
    }
};
"""

EXCHANGED = """
#if defined(__CUDA_ARCH__)
auto put_box = [&](int k, const float* b, unsigned int ref) {
    float4* at = reinterpret_cast<float4*>(scratch.data) + k;
    __stcg(at, make_float4(b[0], b[1], b[2], real(ref)));
    __stcg(at + 1, make_float4(b[3], b[4], b[5], 0.0f));
};
auto take_box = [&](int k, float* b) {
    const float4* at = reinterpret_cast<const float4*>(scratch.data) + k;
    float4 one = __ldcg(at), two = __ldcg(at + 1);
    b[0] = one.x, b[1] = one.y, b[2] = one.z, b[3] = two.x, b[4] = two.y, b[5] = two.z;
    return bits(one.w);
};
#else
auto put_box = [&](int k, const float* b, unsigned int ref) {
    store16(scratch.data, k, b[0], b[1], b[2], real(ref));
    store16(scratch.data, k + 1, b[3], b[4], b[5], 0.0f);
};
auto take_box = [&](int k, float* b) {
    Quad one = load16(scratch.data, k), two = load16(scratch.data, k + 1);
    b[0] = one.x, b[1] = one.y, b[2] = one.z, b[3] = two.x, b[4] = two.y, b[5] = two.z;
    return bits(one.w);
};
#endif
"""
"""``put_box`` and ``take_box``: boxes for a sibling, with a reference, written past the first-level cache, which other
multiprocessors do not see."""

NEAR = (
    f"constexpr int BLOCK = {BLOCK};"
    + """
__shared__ float near_box[12][BLOCK];
__shared__ int arrived[BLOCK];
const int begin = i - (int)threadIdx.x;
arrived[threadIdx.x] = 0;
__syncthreads();
auto is_near = [&](int node) { return node >= begin && node < begin + BLOCK - 1; };
auto put_near_box = [&](int node, int side, const float* b) {
    for (int k = 0; k < 6; k++) near_box[6 * side + k][node - begin] = b[k];
};
auto take_near_box = [&](int node, int side, float* b) {
    for (int k = 0; k < 6; k++) b[k] = near_box[6 * side + k][node - begin];
};
auto is_first = [&](int node) {
    __threadfence_block();
    bool first = atomicAdd(arrived + node - begin, 1) == 0;
    __threadfence_block();
    return first;
};
"""
)
"""``is_near``: whether leaves of this block lie on both sides of a node's split. ``is_first``: of the two threads that come
to a near node; the other takes what the first has put. Those that stay the first after all threads of the block have
climbed wait for a child with leaves of another block."""
