"""What the lanes of a warp fetch into shared memory ahead of its use: groups of rows, and the rays in them.

A value that is loaded into a register is waited for as soon as an instruction depends on it, and a selection between a value
and zero is one, so rays that were loaded ahead into registers were waited for at once. Copies into shared memory are waited
for by number, and take no registers. These are native snippets for blocks of 128 threads of a GPU; kernels for the CPU read
the arrays themselves. The functions name places of shared memory by their addresses there.
"""

import warp as wp

GROUP_WORDS = 8
"""Words of 16 bytes of a group of rows (:func:`..streams.occlusion.rows.set_group`)."""

FEW_ROWS, PACKED = wp.constant(8), wp.constant(4)
"""Rows that a small group has at most, and how many small groups a warp takes together: a row for every lane."""

GROUP_BYTES = wp.constant(144)
"""From one group in shared memory to the next: 16 more than it has, so that the same word of four groups lies in different
banks.
"""

NOWHERE = wp.constant(2147483647)
"""For :func:`.warps.lane_at`: where the elements of a lane start that holds none."""

STEPS = wp.constant(4)
"""Steps of 32 rays that there is room for: one is tested, three are on their way."""


@wp.func
def step_of(at: wp.int32) -> wp.int32:
    """The step, 0 to 3, of the 32 rays from ``at`` on."""
    return (at >> 5) & (STEPS - 1)


@wp.func
def pack_of(lane: wp.int32) -> wp.int32:
    """Which of the small groups that a warp takes together a lane belongs to."""
    return lane >> 3


@wp.func
def packs_of(small: wp.int32) -> wp.int32:
    """How many warps' worth of small groups there are."""
    return (small + PACKED - 1) >> 2


# A step of a block: 128 rays of 16 bytes, and then the places of their groups.
RAY_BYTES, STEP_BYTES = 2048, 2560


# Each lane copies one word. Two sets of groups: one is filled while the other is read.
@wp.func_native("""
#if defined(__CUDA_ARCH__)
__shared__ float4 sets[2][4][36];
int lane = threadIdx.x & 31, word = lane & 7, member = lane >> 3;
int number = 4 * (item - large) + member;
bool packed = item >= large, wanted = packed ? number < small : member == 0;
long long group = packed ? groups.shape[0] - 1 - number : item;
const float4 *from = reinterpret_cast<const float4*>(groups.data) + (wanted ? 8 * group + word : 0);
float4 *first = sets[set][(threadIdx.x >> 5) & 3], *to = first + 9 * member + word;
#if __CUDA_ARCH__ >= 800
asm volatile("cp.async.cg.shared.global [%0], [%1], 16, %2;"
    :: "r"((unsigned int)__cvta_generic_to_shared(to)), "l"(from), "r"(wanted ? 16 : 0) : "memory");
#else
*to = wanted ? *from : make_float4(0.0f, 0.0f, 0.0f, 0.0f);
#endif
return (int)__cvta_generic_to_shared(first);
#else
return 0;
#endif
""")
def fetch_groups(
    groups: wp.array2d[wp.vec4f], item: wp.int32, large: wp.int32, small: wp.int32, set: wp.int32
) -> wp.int32:
    """Fetch an item's groups into set 0 or 1, and return its place. All lanes must call it.

    Items below ``large`` are a large group each, the others four small ones, of ``small`` in all, from the end of ``groups``
    on. Words of missing groups are zero: they have no rows.
    """


@wp.func_native("""
#if defined(__CUDA_ARCH__)
#if __CUDA_ARCH__ >= 800
asm volatile("cp.async.wait_all;" ::: "memory");
#endif
__syncwarp();
#endif
""")
def wait_for_groups():
    """Wait for everything fetched, and until all lanes have finished with what they read. All lanes must call it."""


@wp.func_native("""
#if defined(__CUDA_ARCH__)
float x = before[0], y = before[1], z = before[2], w = before[3];
asm volatile("{.reg .pred wanted; setp.ne.u32 wanted, %4, 0; @wanted ld.shared.v4.f32 {%0, %1, %2, %3}, [%5];}"
    : "+f"(x), "+f"(y), "+f"(z), "+f"(w) : "r"((int)wanted), "r"(place));
return {x, y, z, w};
#else
return before;
#endif
""")
def shared_entry(wanted: wp.bool, place: wp.int32, before: wp.vec4f) -> wp.vec4f:
    """The 16 bytes at a place of shared memory if ``wanted``, else ``before``."""


@wp.func_native("""
#if defined(__CUDA_ARCH__)
__shared__ int2 rows[128];
int2 *mine = rows + (threadIdx.x & 96);
unsigned int filled = __ballot_sync(0xffffffffu, wanted);
if (wanted) mine[__popc(filled & ((1u << (threadIdx.x & 31)) - 1u))] = make_int2(base, group);
__syncwarp();
return (int)__cvta_generic_to_shared(mine);
#else
return 0;
#endif
""")
def set_rows(wanted: wp.bool, base: wp.int32, group: wp.int32) -> wp.int32:
    """Store the rows of the lanes that have one, in their order, and return their place. All lanes must call it.

    ``base``: the place of the row's first ray, less the number of rays in the rows before it; ``group``: of its group.
    """


@wp.func_native("""
#if defined(__CUDA_ARCH__)
int base, group;
asm volatile("ld.shared.v2.b32 {%0, %1}, [%2];" : "=r"(base), "=r"(group) : "r"(rows + 8 * row));
return {base, group};
#else
return {0, 0};
#endif
""")
def row_at(rows: wp.int32, row: wp.int32) -> wp.vec2i:
    """(base, group) of a row of those at a place (:func:`set_rows`)."""


@wp.func_native(f"""
#if defined(__CUDA_ARCH__)
__shared__ float4 steps[4 * {STEP_BYTES} / 16];
return (int)__cvta_generic_to_shared(steps) + 16 * (threadIdx.x & 127);
#else
return 0;
#endif
""")
def place_of_steps() -> wp.int32:
    """Where the rays of this thread lie: each reads only what it has fetched itself."""


@wp.func_native(f"""
#if defined(__CUDA_ARCH__)
unsigned int place = steps + {STEP_BYTES} * step, place_of_group = place - 12 * (threadIdx.x & 127) + {RAY_BYTES};
#if __CUDA_ARCH__ >= 800
asm volatile("{{.reg .pred wanted; setp.ne.u32 wanted, %0, 0; @wanted cp.async.cg.shared.global [%1], [%2], 16;}}"
    :: "r"((int)wanted), "r"(place), "l"(rays.data + ray) : "memory");
#else
float4 v = reinterpret_cast<const float4*>(rays.data)[wanted ? ray : 0];
asm volatile("st.shared.v4.f32 [%0], {{%1, %2, %3, %4}};"
    :: "r"(place), "f"(v.x), "f"(v.y), "f"(v.z), "f"(v.w) : "memory");
#endif
asm volatile("st.shared.b32 [%0], %1;" :: "r"(place_of_group), "r"(group) : "memory");
#endif
""")
def fetch_ray(
    rays: wp.array[wp.vec4f], ray: wp.int32, wanted: wp.bool, group: wp.int32, steps: wp.int32, step: wp.int32
):
    """Fetch a ray for step 0 to 3, if ``wanted``; the place of its group is stored in any case."""


@wp.func_native("""
#if defined(__CUDA_ARCH__) && __CUDA_ARCH__ >= 800
asm volatile("cp.async.commit_group;" ::: "memory");
#endif
""")
def end_of_step():
    """What was fetched since the last call is one step, even if that is nothing."""


@wp.func_native("""
#if defined(__CUDA_ARCH__) && __CUDA_ARCH__ >= 800
asm volatile("cp.async.wait_group 2;" ::: "memory");
#endif
""")
def wait_for_step():
    """Wait for all steps but the last two."""


@wp.func_native(f"""
#if defined(__CUDA_ARCH__)
float x, y, z, w;
asm volatile("ld.shared.v4.f32 {{%0, %1, %2, %3}}, [%4];"
    : "=f"(x), "=f"(y), "=f"(z), "=f"(w) : "r"(steps + {STEP_BYTES} * step));
return {{x, y, z, w}};
#else
return {{}};
#endif
""")
def fetched_ray(steps: wp.int32, step: wp.int32) -> wp.vec4f:
    """The ray of a step; anything, if it was not wanted."""


@wp.func_native(f"""
#if defined(__CUDA_ARCH__)
int group;
asm volatile("ld.shared.b32 %0, [%1];"
    : "=r"(group) : "r"(steps + {STEP_BYTES} * step - 12 * (threadIdx.x & 127) + {RAY_BYTES}));
return group;
#else
return 0;
#endif
""")
def fetched_group(steps: wp.int32, step: wp.int32) -> wp.int32:
    """The place of the group of a step's ray."""
