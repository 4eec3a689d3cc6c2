"""Eight at once, in the vectors of a CPU: triangles projected; rays and pixels tested by :mod:`.occlusion.on_cpu` and
:mod:`.camera.on_cpu`.

Most triangles are left out by their boxes, and few rays or pixels meet one: one after the other, they take several times
as long. A kernel of a GPU does not call these functions.
"""

from __future__ import annotations

import warp as wp

from ...harness.frame.frame import AT_ONCE
from ...harness.frame.geometry import Mesh

EIGHT = wp.constant(AT_ONCE)

LANES = """
typedef float floats __attribute__((ext_vector_type(8)));
typedef bool bits __attribute__((ext_vector_type(8)));
auto packed = [](auto lanes, int number) {
    bits some = __builtin_convertvector(lanes, bits);
    unsigned char word;
    memcpy(&word, &some, 1);
    return word & (number < 8 ? (1u << number) - 1u : 255u);
};
"""


def on_cpu(text: str) -> str:
    """The text of a native function that a kernel of a GPU does not call."""
    return f"#if defined(__CUDA_ARCH__)\nreturn {{}};\n#else\n{LANES}{text}\n#endif\n"


@wp.struct
class Window:
    """A plane on which triangles are projected from a point.

    axes      rows: along the way to the plane, across and up      origin, shift  a point p is axes (p - origin) + shift
    low       across / along and up / along where the window's coordinates are 0
    per       of the coordinates, to one of these                  slack  of the coordinates, for rounding that does not
              depend on the triangle
    """

    axes: wp.mat33f
    origin: wp.vec3f
    shift: wp.vec3f
    low: wp.vec2f
    per: wp.vec2f
    slack: wp.float32


Boxes = wp.types.matrix(shape=(5, 8), dtype=wp.float32)


@wp.func_native(
    on_cpu("""
auto least = [](floats a, floats b) { return a < b ? a : b; };
auto most = [](floats a, floats b) { return a > b ? a : b; };
auto size = [](floats a) { return __builtin_elementwise_abs(a); };
const float unit = 32.0f * 0x1p-24f, inf = __builtin_inff(), span = w.per[0] > w.per[1] ? w.per[0] : w.per[1];
floats far = unit, near = inf, behind = -inf, extent = 0.0f, wide = 0x1p-31f, low_x = inf, low_y = inf;
floats high_x = -inf, high_y = -inf;
for (int k = 0; k < 2; ++k) wide = most(wide, __builtin_fabsf(w.low[k]));
for (int corner = 0; corner < 3; ++corner) {
    floats p[3], q[3];
    #pragma unroll
    for (int k = 0; k < 8; ++k) {
        int i = first + k < mesh.triangles.shape[0] ? first + k : first;
        const wp::vec_t<3, float> &at = mesh.points.data[mesh.triangles.data[i][corner]];
        for (int axis = 0; axis < 3; ++axis) p[axis][k] = at[axis] - w.origin[axis];
    }
    extent = most(extent, size(p[0]) + size(p[1]) + size(p[2]));
    for (int axis = 0; axis < 3; ++axis) {
        q[axis] = w.axes.data[axis][0] * p[0] + w.axes.data[axis][1] * p[1] + w.axes.data[axis][2] * p[2] + w.shift[axis];
        far = most(far, size(q[axis]));
    }
    near = least(near, q[0]);
    behind = most(behind, q[0]);
    floats inverse = 1.0f / q[0], x = q[1] * inverse, y = q[2] * inverse;
    wide = most(wide, most(size(x), size(y)));
    low_x = least(low_x, x);
    low_y = least(low_y, y);
    high_x = most(high_x, x);
    high_y = most(high_y, y);
}
extent += more;
floats slack = unit * (extent + size((floats)w.shift[0]) + size((floats)w.shift[1]) + size((floats)w.shift[2]));
floats pad = unit * ((1.0f + wide) * extent / near + wide) * span + w.slack;
auto finite = slack < 1e30f, out = (behind < -slack) & finite;
auto known = (near > 0.01f * far) & (near > 0x1p-125f) & (far < 0x1p125f) & finite;
floats none = out ? (floats)inf : (floats)-inf;
wp::mat_t<5, 8, float> boxes;
auto set = [&](int row, floats of) { memcpy(boxes.data[row], &of, sizeof(of)); };
set(0, known ? (low_x - w.low[0]) * w.per[0] - pad : none);
set(1, known ? (low_y - w.low[1]) * w.per[1] - pad : none);
set(2, known ? (high_x - w.low[0]) * w.per[0] + pad : -none);
set(3, known ? (high_y - w.low[1]) * w.per[1] + pad : -none);
set(4, near - slack);
return boxes;
""")
)
def boxes_of_eight(mesh: Mesh, first: wp.int32, more: wp.float32, w: Window) -> Boxes:
    """Of the triangles from ``first`` on: the least and the greatest coordinates in a window, and a depth along its axis
    that no point is nearer than. The bounds are those of :func:`.cube.footprint.on_bins`; ``more``: added to the extent
    there (:func:`.cube.footprint.extent_with_rays`).

    A triangle behind the point has no coordinate, -inf above inf; one that cannot be projected has all of them.
    """


@wp.func_native(
    on_cpu(
        """
floats low[2], high[2];
for (int k = 0; k < 2; ++k) {
    floats none = 0.0f, last = (floats)size[k];
    memcpy(low + k, boxes.data[k], sizeof(floats));
    memcpy(high + k, boxes.data[2 + k], sizeof(floats));
    low[k] = low[k] > none ? low[k] : none;
    high[k] = high[k] < last ? high[k] : last;
    if (whole) {
        low[k] = __builtin_elementwise_ceil(low[k]);
        high[k] = __builtin_elementwise_floor(high[k]);
    }
}
return packed((low[0] <= high[0]) & (low[1] <= high[1]), number);
"""
    )
)
def boxes_met(boxes: Boxes, size: wp.vec2f, whole: wp.bool, number: wp.int32) -> wp.uint32:
    """A bit for each of the first ``number`` boxes that meets a window, whose coordinates go from 0 to ``size``; ``whole``:
    that holds a point of whole coordinates there.
    """
