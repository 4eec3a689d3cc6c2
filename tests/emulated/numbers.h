// CUDA's types, atomics and functions of one thread, in C++.
#pragma once

typedef unsigned int uint;
typedef unsigned long long word64;

struct alignas(8) int2 { int x, y; };
struct alignas(16) int4 { int x, y, z, w; };
struct alignas(8) float2 { float x, y; };
inline int2 make_int2(int x, int y) { return {x, y}; }
inline int4 make_int4(int x, int y, int z, int w) { return {x, y, z, w}; }
inline float2 make_float2(float x, float y) { return {x, y}; }
inline float4 make_float4(float x, float y, float z, float w) { return {x, y, z, w}; }

template <typename T> inline word64 emulated_bits(T value)
{
    word64 bits = 0;
    __builtin_memcpy(&bits, &value, sizeof(T));
    return bits;
}
template <typename T> inline T emulated_value(word64 bits)
{
    T value;
    __builtin_memcpy(&value, &bits, sizeof(T));
    return value;
}

template <typename T, typename U> inline T atomicAdd(T* place, U value)
{
    T old = *place;
    *place = old + (T)value;
    return old;
}
template <typename T, typename U> inline T atomicOr(T* place, U value)
{
    T old = *place;
    *place = old | (T)value;
    return old;
}
template <typename T, typename U> inline T atomicMax(T* place, U value)
{
    T old = *place;
    if (old < (T)value) *place = (T)value;
    return old;
}
template <typename T, typename U> inline T atomicMin(T* place, U value)
{
    T old = *place;
    if ((T)value < old) *place = (T)value;
    return old;
}
template <typename T, typename U> inline T atomicExch(T* place, U value) { T old = *place; *place = (T)value; return old; }
template <typename T, typename U, typename V> inline T atomicCAS(T* place, U expected, V value)
{
    T old = *place;
    if (old == (T)expected) *place = (T)value;
    return old;
}

template <typename T> inline T __ldcg(const T* place) { return *place; }
template <typename T> inline void __stcs(T* place, T value) { *place = value; }
template <typename T> inline T __ldg(const T* place) { return *place; }
template <typename T, typename U> inline void __stcg(T* place, U value) { *place = value; }

inline int __popc(uint x) { return __builtin_popcount(x); }
inline int __popcll(word64 x) { return __builtin_popcountll(x); }
inline int __ffs(uint x) { return x ? __builtin_ctz(x) + 1 : 0; }
inline int __ffsll(word64 x) { return x ? __builtin_ctzll(x) + 1 : 0; }
inline int __clz(uint x) { return x ? __builtin_clz(x) : 32; }
inline int __clzll(word64 x) { return x ? __builtin_clzll(x) : 64; }
inline uint __brev(uint x) { return __builtin_bitreverse32(x); }
inline int __float_as_int(float x) { return emulated_value<int>(emulated_bits(x)); }
inline uint __float_as_uint(float x) { return emulated_value<uint>(emulated_bits(x)); }
inline float __int_as_float(int x) { return emulated_value<float>(emulated_bits(x)); }
inline float __uint_as_float(uint x) { return emulated_value<float>(emulated_bits(x)); }
inline double __longlong_as_double(long long x) { return emulated_value<double>(emulated_bits(x)); }
inline long long __double_as_longlong(double x) { return emulated_value<long long>(emulated_bits(x)); }
inline float __fadd_rn(float a, float b) { return a + b; }
inline float __fsub_rn(float a, float b) { return a - b; }
inline float __fmul_rn(float a, float b) { return a * b; }
inline float emulated_flushed(float x) { return __builtin_fabsf(x) < 0x1p-126f ? x * 0.0f : x; }
inline double emulated_flushed(double x) { return __builtin_fabs(x) < 0x1p-1022 ? x * 0.0 : x; }
inline float emulated_inexact(float x, bool off)
{
    return __int_as_float(__float_as_int(x) + (off && x != 0.0f && __builtin_fabsf(x) < 0x1.fffffep127f));
}
inline float __fdividef(float a, float b) { return emulated_inexact(a / b, (__float_as_int(a) >> 2 & 7) == 1); }
inline double __dmul_rn(double a, double b) { return a * b; }
inline double __dadd_rn(double a, double b) { return a + b; }
inline float __fmaf_rn(float a, float b, float c) { return __builtin_fmaf(a, b, c); }
inline int __vimin3_s32(int a, int b, int c) { int d = a < b ? a : b; return d < c ? d : c; }
inline int __vimax3_s32_relu(int a, int b, int c) { int d = a > b ? a : b; d = d > c ? d : c; return d > 0 ? d : 0; }
inline float fminf(float a, float b) { return __builtin_isnan(a) ? b : __builtin_isnan(b) || a < b ? a : b; }
inline float fmaxf(float a, float b) { return __builtin_isnan(a) ? b : __builtin_isnan(b) || a > b ? a : b; }
inline int min(int a, int b) { return a < b ? a : b; }
inline uint min(uint a, uint b) { return a < b ? a : b; }
inline int max(int a, int b) { return a > b ? a : b; }
inline uint max(uint a, uint b) { return a > b ? a : b; }

// Addresses of shared memory have 32 bits: distances from here.
static char emulated_base[16];
inline word64 __cvta_generic_to_shared(const void* place) { return (word64)((const char*)place - emulated_base); }
template <typename T> inline T& emulated_shared(int place) { return *(T*)(emulated_base + place); }

// As inexact as the hardware's: one part in 2^23 off for float, the upper halves of doubles. Subnormal numbers are 0.
inline float emulated_reciprocal(float x)
{
    return emulated_flushed(emulated_inexact(1.0f / emulated_flushed(x), (__float_as_int(x) >> 3 & 3) == 1));
}
inline double emulated_upper(double x) { return x != x ? x : __longlong_as_double(__double_as_longlong(x) & ~0xffffffffll); }
inline double emulated_reciprocal(double x)
{
    return emulated_flushed(emulated_upper(1.0 / emulated_flushed(emulated_upper(x))));
}
