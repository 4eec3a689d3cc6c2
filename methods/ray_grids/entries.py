"""Entries of contiguous arrays, read where they lie.

Warp's own index wraps below zero and multiplies by a stride that it is told at the launch: eight instructions an
access, of the fifty that a pixel's test takes. Arrays of the frame and of the queues are contiguous, and their indices
within: one instruction does. Nothing is checked here.
"""

from __future__ import annotations

import warp as wp

READ = "return values.data[i];"
WRITE = "values.data[i] = value;"


@wp.func_native(READ)
def entry(values: wp.array(dtype=wp.uint8), i: wp.int32) -> wp.uint8: ...


@wp.func_native(READ)
def entry(values: wp.array(dtype=wp.int32), i: wp.int32) -> wp.int32: ...


@wp.func_native(READ)
def entry(values: wp.array(dtype=wp.uint64), i: wp.int32) -> wp.uint64: ...


@wp.func_native(READ)
def entry(values: wp.array(dtype=wp.vec3i), i: wp.int32) -> wp.vec3i: ...


@wp.func_native("""
#if defined(__CUDA_ARCH__)
int4 v = reinterpret_cast<const int4*>(values.data)[i];
return {v.x, v.y, v.z, v.w};
#else
return values.data[i];
#endif
""")
def entry(values: wp.array(dtype=wp.vec4i), i: wp.int32) -> wp.vec4i:
    """All four at once: Warp's vectors of four words may lie anywhere, but the arrays begin at multiples of 256."""


@wp.func_native(READ)
def entry(values: wp.array(dtype=wp.vec3f), i: wp.int32) -> wp.vec3f: ...


@wp.func_native(READ)
def entry(values: wp.array(dtype=wp.vec3d), i: wp.int32) -> wp.vec3d: ...


@wp.func_native("""
#if defined(__CUDA_ARCH__)
float4 v = reinterpret_cast<const float4*>(values.data)[4 * i + k];
return {v.x, v.y, v.z, v.w};
#else
return values.data[4 * i + k];
#endif
""")
def entry_of_four(values: wp.array2d(dtype=wp.vec4f), i: wp.int32, k: wp.int32) -> wp.vec4f:
    """values[i, k] of an array of four columns, all four words at once."""


@wp.func_native(WRITE)
def set_entry(values: wp.array(dtype=wp.int32), i: wp.int32, value: wp.int32): ...


@wp.func_native(WRITE)
def set_entry(values: wp.array(dtype=wp.float32), i: wp.int32, value: wp.float32): ...


@wp.func_native(WRITE)
def set_entry(values: wp.array(dtype=wp.vec3d), i: wp.int32, value: wp.vec3d): ...


@wp.func_native("""
#if defined(__CUDA_ARCH__)
reinterpret_cast<int4*>(values.data)[i] = make_int4(value[0], value[1], value[2], value[3]);
#else
values.data[i] = value;
#endif
""")
def set_entry(values: wp.array(dtype=wp.vec4i), i: wp.int32, value: wp.vec4i):
    """values[i] = value, all four words at once."""


@wp.func_native("""
#if defined(__CUDA_ARCH__)
reinterpret_cast<float4*>(values.data)[4 * i + k] = make_float4(value[0], value[1], value[2], value[3]);
#else
values.data[4 * i + k] = value;
#endif
""")
def set_entry_of_four(values: wp.array2d(dtype=wp.vec4f), i: wp.int32, k: wp.int32, value: wp.vec4f):
    """values[i, k] = value of an array of four columns, all four words at once."""


# Relaxed and volatile: a plain load is put off by the compiler until something needs the value.
@wp.func_native("""
#if defined(__CUDA_ARCH__)
unsigned long long value;
asm volatile("ld.relaxed.gpu.global.u64 %0, [%1];" : "=l"(value) : "l"((unsigned long long)(values.data + i)));
return value;
#else
return values.data[i];
#endif
""")
def entry_now(values: wp.array(dtype=wp.uint64), i: wp.int32) -> wp.uint64:
    """values[i], asked for here, so that it comes while other things are reckoned. Read past the first cache."""


@wp.func_native("""
#if defined(__CUDA_ARCH__)
double x, y, z;
asm volatile("ld.relaxed.gpu.global.f64 %0, [%1];" : "=d"(x) : "l"((unsigned long long)(values.data + i)));
asm volatile("ld.relaxed.gpu.global.f64 %0, [%1 + 8];" : "=d"(y) : "l"((unsigned long long)(values.data + i)));
asm volatile("ld.relaxed.gpu.global.f64 %0, [%1 + 16];" : "=d"(z) : "l"((unsigned long long)(values.data + i)));
return {x, y, z};
#else
return values.data[i];
#endif
""")
def entry_now(values: wp.array(dtype=wp.vec3d), i: wp.int32) -> wp.vec3d: ...


@wp.func_native("""
#if defined(__CUDA_ARCH__)
atomicMax((unsigned long long*)(values.data + i), (unsigned long long)value);
#else
if (value > values.data[i]) values.data[i] = value;
#endif
""")
def raise_entry(values: wp.array(dtype=wp.uint64), i: wp.int32, value: wp.uint64):
    """Raise an entry to at least ``value``."""
