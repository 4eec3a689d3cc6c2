"""Entries of contiguous arrays, read and written where they lie, 8 or 16 bytes at once.

Warp's own index wraps below zero and multiplies by a stride that the launch passes: eight instructions per access, of the
fifty that the test of a pixel takes. Arrays of the frame and of the queues are contiguous and their indices are valid, so
that one instruction suffices. Indices are not checked.

Warp's vectors are aligned only as their components are, so the compiler moves them one component at a time: four times
the instructions, and four times the traffic with the second-level cache where the lanes of a warp access distant entries.
Arrays begin on at least 64 bytes, so that elements of 16 or 8 bytes are aligned where the array is no slice of a narrower
one and rows follow one another without gaps: those are moved at once.
"""

from typing import Any

import warp as wp

ROW = "row * values.shape[1] + column"
"""Place of an entry of an array in rows, if they follow one another without gaps."""

ROW_OF_FOUR = "4 * row + column"

TWO, FOUR = ("v.x, v.y", "value[0], value[1]"), ("v.x, v.y, v.z, v.w", "value[0], value[1], value[2], value[3]")
WIDE = {wp.vec2i: ("int2", *TWO), wp.vec2f: ("float2", *TWO), wp.vec4i: ("int4", *FOUR), wp.vec4f: ("float4", *FOUR)}
"""The types that are moved at once: a GPU's own type, its parts, and those of a value."""


def on_gpu(otherwise: str, text: str) -> str:
    """C++ that is ``text`` on a GPU, if there is any."""
    return f"\n#if defined(__CUDA_ARCH__)\n{text}\n#else\n{otherwise}\n#endif\n" if text else otherwise


def reading(kind: Any, at: str = "i") -> str:
    """C++ that reads an entry of this type."""
    wide, parts, _ = WIDE.get(kind, ("", "", ""))
    text = f"{wide} v = *reinterpret_cast<const {wide}*>(values.data + {at});\nreturn {{{parts}}};"
    return on_gpu(f"return values.data[{at}];", text if wide else "")


def writing(kind: Any, at: str = "i") -> str:
    """C++ that writes an entry of this type."""
    wide, _, parts = WIDE.get(kind, ("", "", ""))
    text = f"*reinterpret_cast<{wide}*>(values.data + {at}) = make_{wide}({parts});"
    return on_gpu(f"values.data[{at}] = value;", text if wide else "")


# The functions of one name are overloads, one for each type.
for kind in (
    *(wp.uint8, wp.int32, wp.float32, wp.uint64, wp.vec3i, wp.vec3f, wp.mat33d),
    *(wp.vec2i, wp.vec2f, wp.vec4i, wp.vec4f),
):

    @wp.func_native(reading(kind))
    def entry(values: wp.array[kind], i: wp.int32) -> kind: ...


for kind in (wp.uint8, wp.int32, wp.float32, wp.vec3f, wp.vec3d, wp.vec2i, wp.vec4i, wp.vec4f):

    @wp.func_native(writing(kind))
    def set_entry(values: wp.array[kind], i: wp.int32, value: kind): ...


for kind in (wp.uint8, wp.vec4f):

    @wp.func_native(reading(kind, ROW))
    def entry(values: wp.array2d[kind], row: wp.int32, column: wp.int32) -> kind: ...

    @wp.func_native(writing(kind, ROW))
    def set_entry(values: wp.array2d[kind], row: wp.int32, column: wp.int32, value: kind): ...


for kind in (wp.int32, wp.float32):

    @wp.func_native(on_gpu("values.data[i] = value;", "__stcs(values.data + i, value);"))
    def set_entry_last(values: wp.array[kind], i: wp.int32, value: kind):
        """Set an entry that no pass of the frame reads: its line is the first to leave the second-level cache."""


@wp.func_native(reading(wp.vec4f, ROW_OF_FOUR))
def entry_of_four(values: wp.array2d[wp.vec4f], row: wp.int32, column: wp.int32) -> wp.vec4f:
    """An entry of an array that is known to have four columns."""


@wp.func_native(writing(wp.vec4f, ROW_OF_FOUR))
def set_entry_of_four(values: wp.array2d[wp.vec4f], row: wp.int32, column: wp.int32, value: wp.vec4f):
    """Set an entry of an array that is known to have four columns."""


# Relaxed and volatile: the compiler moves a plain load to where its value is first used.
@wp.func_native("""
#if defined(__CUDA_ARCH__)
unsigned long long value;
asm volatile("ld.relaxed.gpu.global.u64 %0, [%1];" : "=l"(value) : "l"((unsigned long long)(values.data + i)));
return value;
#else
return values.data[i];
#endif
""")
def entry_now(values: wp.array[wp.uint64], i: wp.int32) -> wp.uint64:
    """values[i], loaded here, so that other instructions hide its latency. Bypasses the first-level cache."""


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
def entry_now(values: wp.array[wp.vec3d], i: wp.int32) -> wp.vec3d: ...


# No branch and no selection depends on the value: the thread would wait for it where it is loaded.
@wp.func_native("""
#if defined(__CUDA_ARCH__)
int value = otherwise;
asm volatile("{.reg .pred wanted; setp.ne.u32 wanted, %1, 0; @wanted ld.global.b32 %0, [%2];}"
    : "+r"(value) : "r"((int)wanted), "l"(values.data + i));
return value;
#else
return wanted ? values.data[i] : otherwise;
#endif
""")
def entry_if(wanted: wp.bool, values: wp.array[wp.int32], i: wp.int32, otherwise: wp.int32) -> wp.int32:
    """values[i] if ``wanted``, loaded here; else ``otherwise``."""


@wp.func_native("""
#if defined(__CUDA_ARCH__)
atomicMax((unsigned long long*)(values.data + i), (unsigned long long)value);
#else
unsigned long long *word = (unsigned long long*)(values.data + i), known = __atomic_load_n(word, __ATOMIC_RELAXED);
while (known < value && !__atomic_compare_exchange_n(word, &known, value, true, __ATOMIC_RELAXED, __ATOMIC_RELAXED)) {}
#endif
""")
def raise_entry(values: wp.array[wp.uint64], i: wp.int32, value: wp.uint64):
    """Raise an entry to at least ``value``; atomic on a CPU, too, where kernels may run in several threads."""
