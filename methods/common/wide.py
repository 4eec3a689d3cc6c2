"""Vectors of 16 and 8 bytes read and written at once.

Warp's vectors promise no more alignment than their components have, so the compiler moves them one component at a
time: four times the instructions, and where a warp's lanes lie apart four times the traffic with the second cache.
Arrays begin on at least 64 bytes, so that elements of 16 or 8 bytes are aligned where the array is no slice of a
narrower one and rows follow one another without gaps. Indices must not be negative.
"""

from __future__ import annotations

import warp as wp

READ = """
#if defined(__CUDA_ARCH__)
{wide} v = *reinterpret_cast<const {wide}*>(values.data + index);
return {{{parts}}};
#else
return values.data[index];
#endif
"""

WRITE = """
#if defined(__CUDA_ARCH__)
*reinterpret_cast<{wide}*>(values.data + index) = make_{wide}({parts});
#else
values.data[index] = value;
#endif
"""

FOUR, TWO = "v.x, v.y, v.z, v.w", "v.x, v.y"
FOUR_OF, TWO_OF = "value[0], value[1], value[2], value[3]", "value[0], value[1]"

READ_ROW = READ.replace("values.data + index", "values.data + row * values.shape[1] + column").replace(
    "values.data[index]", "values.data[row * values.shape[1] + column]"
)
WRITE_ROW = WRITE.replace("values.data + index", "values.data + row * values.shape[1] + column").replace(
    "values.data[index]", "values.data[row * values.shape[1] + column]"
)


@wp.func_native(READ.format(wide="float4", parts=FOUR))
def read_wide(values: wp.array(dtype=wp.vec4f), index: wp.int32) -> wp.vec4f: ...


@wp.func_native(READ.format(wide="int4", parts=FOUR))
def read_wide(values: wp.array(dtype=wp.vec4i), index: wp.int32) -> wp.vec4i: ...


@wp.func_native(READ.format(wide="int2", parts=TWO))
def read_wide(values: wp.array(dtype=wp.vec2i), index: wp.int32) -> wp.vec2i: ...


@wp.func_native(READ_ROW.format(wide="float4", parts=FOUR))
def read_wide(values: wp.array2d(dtype=wp.vec4f), row: wp.int32, column: wp.int32) -> wp.vec4f: ...


@wp.func_native(WRITE.format(wide="float4", parts=FOUR_OF))
def write_wide(values: wp.array(dtype=wp.vec4f), index: wp.int32, value: wp.vec4f): ...


@wp.func_native(WRITE.format(wide="int4", parts=FOUR_OF))
def write_wide(values: wp.array(dtype=wp.vec4i), index: wp.int32, value: wp.vec4i): ...


@wp.func_native(WRITE.format(wide="int2", parts=TWO_OF))
def write_wide(values: wp.array(dtype=wp.vec2i), index: wp.int32, value: wp.vec2i): ...


@wp.func_native(WRITE_ROW.format(wide="float4", parts=FOUR_OF))
def write_wide(values: wp.array2d(dtype=wp.vec4f), row: wp.int32, column: wp.int32, value: wp.vec4f): ...
