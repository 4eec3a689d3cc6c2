"""C++ that the native functions of trees share, for a GPU and for the CPU, and how a child is referred to.

Loops over a tree need a local array for the stack, votes of a warp and loads of 16 bytes, which Warp's language does not
have. A native function is the body of one C++ function: what several share is text at their start.
"""

LEAF = 0x80000000
"""Bit of a reference to a child that says that it is a leaf: the lower bits are the index of its triangle."""

PAIR = 0x40000000
"""Bit of a reference to a leaf that says that it holds the next triangle of the mesh, too."""

INDEX = PAIR - 1
"""Bits of a reference to a leaf that are the index of its first triangle."""

NONE = 0xFFFFFFFF
"""The reference to nothing: the root of a tree without triangles."""

STACK = 128
"""Entries of a stack: no tree is deeper (:mod:`.builders.hploc`, :mod:`.builders.lbvh`, :mod:`.builders.sah`)."""

BASICS = (
    f"""
struct Quad {{ float x, y, z, w; }};
constexpr unsigned int LEAF = {LEAF}u, PAIR = {PAIR}u, INDEX = {INDEX}u, NONE = {NONE}u;
"""
    + """
auto bits = [](float value) { union { float f; unsigned int u; } both; both.f = value; return both.u; };
auto real = [](unsigned int value) { union { float f; unsigned int u; } both; both.u = value; return both.f; };
auto ordered = [](int word) { return word ^ ((word >> 31) & 0x7fffffff); };
auto threes = [](const void* words, unsigned int k) { return (const char*)words + 48 * (size_t)k; };
#if defined(__CUDA_ARCH__)
auto low = [](float a, float b) { return fminf(a, b); };
auto high = [](float a, float b) { return fmaxf(a, b); };
auto size = [](float a) { return fabsf(a); };
auto load16 = [](const void* at, int k) {
    float4 v = __ldg(reinterpret_cast<const float4*>(at) + k);
    return Quad{v.x, v.y, v.z, v.w};
};
auto store16 = [](void* at, int k, float x, float y, float z, float w) {
    reinterpret_cast<float4*>(at)[k] = make_float4(x, y, z, w);
};
auto about = [](float a) {
    float inverse;
    asm("rcp.approx.ftz.f32 %0, %1;" : "=f"(inverse) : "f"(a));
    return inverse;
};
auto inverse_of = [&](float a) {
    float first = about(a);
    return __fmaf_rn(first, __fmaf_rn(-a, first, 1.0f), first);
};
auto entering = [](float x, float y, float z) {
    return __int_as_float(__vimax3_s32_relu(__float_as_int(x), __float_as_int(y), __float_as_int(z)));
};
auto leaving = [](float x, float y, float z, float limit) {
    return __int_as_float(
        min(__vimin3_s32(__float_as_int(x), __float_as_int(y), __float_as_int(z)), __float_as_int(limit)));
};
auto sum = [](float a, float b) { return __fadd_rn(a, b); };
auto product = [](float a, float b) { return __fmul_rn(a, b); };
auto fused = [](float a, float b, float c) { return __fmaf_rn(a, b, c); };
constexpr bool FUSED = true;
#else
auto low = [](float a, float b) { return a < b ? a : b; };
auto high = [](float a, float b) { return a > b ? a : b; };
auto size = [](float a) { return a < 0.0f ? -a : a; };
auto load16 = [](const void* at, int k) { return reinterpret_cast<const Quad*>(at)[k]; };
auto store16 = [](void* at, int k, float x, float y, float z, float w) {
    reinterpret_cast<Quad*>(at)[k] = Quad{x, y, z, w};
};
auto about = [](float a) { return 1.0f / a; };
auto inverse_of = about;
auto entering = [&](float x, float y, float z) { return high(high(x, y), high(z, 0.0f)); };
auto leaving = [&](float x, float y, float z, float limit) { return low(low(x, y), low(z, limit)); };
auto sum = [](float a, float b) { return a + b; };
auto product = [](float a, float b) { return a * b; };
auto fused = [](float a, float b, float c) { return a * b + c; };
constexpr bool FUSED = false;
#endif
"""
)
"""``threes``: where the k-th three words of 16 bytes begin. ``ordered``: the bits of a float as an integer in the order of
floats, and back.

``about`` is one over a number, with the precision of a GPU's single instruction. ``inverse_of`` is the rounded quotient
without the branches of a division: for normal numbers whose inverse is normal, too; it is 0 for those beyond.

``sum`` and ``product`` are rounded separately: a GPU's compiler would fuse them, and the tree would differ from the CPU's.

``entering`` and ``leaving``: the largest of three numbers and 0, and the smallest of three numbers and ``limit`` > 0. A GPU
has one instruction for three integers. As integers, floats from 0 on are in their order, and negative ones are below
them: of several negative numbers any may be found, which is before 0 like all of them.
"""
