// CUDA's functions for the threads of a warp and of a block, on the fibers that Warp has for blocks on a CPU. One thread runs
// at a time, and another takes its turn only within one of these functions; blocks run one after the other.
// A thread that waits lets those that lag behind run: wp_cpu_tile_sync does that, and returns when all have come as far.
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

extern "C" int printf(const char*, ...);
extern "C" char* getenv(const char*);
extern "C" void abort();

#if WP_TILE_BLOCK_DIM > 1
inline int emulated_thread() { return wp_cpu_get_thread_idx(); }
inline void emulated_turn() { wp_cpu_tile_sync(); }
inline int emulated_active() { return wp_cpu_get_active_count(); }
#else
inline int emulated_thread() { return 0; }
inline void emulated_turn() {}
inline int emulated_active() { return 1; }
#endif
static inline int emulated_lane() { return emulated_thread() & 31; }

struct emulated_index { struct { operator uint() const { return emulated_thread(); } } x; };
static emulated_index threadIdx;
static struct { uint x; } blockIdx, gridDim;  // set as each thread begins

#define __shared__ static
#define __CUDA_ARCH__ 900

// Random numbers of the seed in the environment; 0 without one.
static inline uint emulated_random()
{
    static bool known;
    static uint state;
    if (!known) {
        known = true;
        if (const char* seed = getenv("EMULATED_SEED")) while (*seed) state = state * 10u + (*seed++ - '0');
    }
    return state ? (state = state * 1664525u + 1013904223u) >> 16 : 0;
}

// A thread that waits for others that never come: what the hardware leaves undefined, or waits for without end.
static inline void emulated_wait(int& turns, const char* what)
{
    emulated_turn();
    if (++turns > 1000000) {
        printf("emulated: thread %d waits without end at %s\n", emulated_thread(), what);
        abort();
    }
}

// What the lanes of a mask exchange. Lanes of different masks may exchange at the same time, and a lane may exchange with some
// while others wait for it.
struct emulated_exchange { const char* what; uint mask, arrived; word64 values[32]; };
struct emulated_warp { emulated_exchange exchanges[32]; bool waits[32]; word64 seen[32][32]; };
static emulated_warp emulated_warps[32];

static inline const word64* emulated_all(uint mask, word64 value, const char* what)
{
    for (uint turns = emulated_random() & 3; turns > 1; turns--) emulated_turn();  // another order
    const int thread = emulated_thread(), lane = thread & 31;
    emulated_warp& warp = emulated_warps[thread >> 5];
    emulated_exchange* found = nullptr;
    for (emulated_exchange& other : warp.exchanges) {
        if (other.arrived && other.mask == mask) { found = &other; break; }
        if (!other.arrived && !found) found = &other;
    }
    if (!(mask >> lane & 1) || !found) {
        printf("emulated: lane %d is not in its mask %08x at %s\n", lane, mask, what);
        abort();
    }
    if (found->arrived && found->what != what) {
        printf("emulated: lane %d with mask %08x at %s meets lanes at %s\n", lane, mask, what, found->what);
        abort();
    }
    emulated_exchange& e = *found;
    e.what = what, e.mask = mask, e.values[lane] = value, e.arrived |= 1u << lane;
    warp.waits[lane] = true;
    if (e.arrived == mask) {
        e.arrived = 0;
        for (uint rest = mask; rest; rest &= rest - 1) {
            const int other = __builtin_ctz(rest);
            for (int k = 0; k < 32; k++) warp.seen[other][k] = e.values[k];
            warp.waits[other] = false;
        }
    }
    for (int turns = 0; warp.waits[lane];) emulated_wait(turns, what);
    return warp.seen[lane];
}

static inline uint emulated_ballot(uint mask, bool value, const char* what)
{
    const word64* all = emulated_all(mask, value, what);
    uint bits = 0;
    for (int k = 0; k < 32; k++) if (mask >> k & 1) bits |= (uint)all[k] << k;
    return bits;
}

template <typename T> inline word64 emulated_bits(T value) { word64 bits = 0; __builtin_memcpy(&bits, &value, sizeof(T)); return bits; }
template <typename T> inline T emulated_value(word64 bits) { T value; __builtin_memcpy(&value, &bits, sizeof(T)); return value; }

template <typename T> inline T emulated_of(uint mask, T value, int lane, const char* what)
{
    const word64* all = emulated_all(mask, emulated_bits(value), what);
    if (lane < 0 || lane > 31) return value;
    if (!(mask >> lane & 1)) return emulated_value<T>(0xa5a5a5a5a5a5a5a5ull);  // the hardware leaves it undefined
    return emulated_value<T>(all[lane]);
}

template <typename T> inline T __shfl_sync(uint mask, T value, int lane) { return emulated_of(mask, value, lane & 31, "shfl"); }
template <typename T> inline T __shfl_up_sync(uint mask, T value, int by) { return emulated_of(mask, value, emulated_lane() - by, "shfl_up"); }
template <typename T> inline T __shfl_down_sync(uint mask, T value, int by) { return emulated_of(mask, value, emulated_lane() + by, "shfl_down"); }
template <typename T> inline T __shfl_xor_sync(uint mask, T value, int by) { return emulated_of(mask, value, emulated_lane() ^ by, "shfl_xor"); }
inline uint __ballot_sync(uint mask, bool value) { return emulated_ballot(mask, value, "ballot"); }
inline int __any_sync(uint mask, bool value) { return emulated_ballot(mask, value, "any") != 0; }
inline int __all_sync(uint mask, bool value) { return emulated_ballot(mask, value, "all") == mask; }
inline void __syncwarp(uint mask = 0xffffffffu) { emulated_all(mask, 0, "syncwarp"); }

template <typename T> inline uint __match_any_sync(uint mask, T value)
{
    const word64 own = emulated_bits(value), *all = emulated_all(mask, own, "match");
    uint bits = 0;
    for (int k = 0; k < 32; k++) if ((mask >> k & 1) && all[k] == own) bits |= 1u << k;
    return bits;
}

template <typename T, typename F> inline T emulated_reduce(uint mask, T value, F both)
{
    const word64* all = emulated_all(mask, emulated_bits(value), "reduce");
    T sum = value;
    for (int k = 0; k < 32; k++) if ((mask >> k & 1) && k != emulated_lane()) sum = both(sum, emulated_value<T>(all[k]));
    return sum;
}
template <typename T> inline T __reduce_max_sync(uint mask, T value) { return emulated_reduce(mask, value, [](T a, T b) { return a > b ? a : b; }); }
template <typename T> inline T __reduce_min_sync(uint mask, T value) { return emulated_reduce(mask, value, [](T a, T b) { return a < b ? a : b; }); }
template <typename T> inline T __reduce_or_sync(uint mask, T value) { return emulated_reduce(mask, value, [](T a, T b) { return a | b; }); }
template <typename T> inline T __reduce_add_sync(uint mask, T value) { return emulated_reduce(mask, value, [](T a, T b) { return a + b; }); }

// The lanes that come to the same place during one turn. The hardware may give fewer: with a seed they are divided at random.
struct emulated_site { const void* place; uint arrived, masks[32]; };
static emulated_site emulated_sites[32][64];
// A place of the machine code: functions are inlined, as for the GPU, so two calls of one function differ.
static __attribute__((noinline)) uint emulated_activemask()
{
    const int lane = emulated_lane();
    const void* place = __builtin_return_address(0);
    emulated_site* found = emulated_sites[emulated_thread() >> 5];
    while (found->place && found->place != place) found++;
    emulated_site& site = *found;
    site.place = place;
    site.masks[lane] = 0;
    site.arrived |= 1u << lane;
    emulated_turn();
    if (!site.masks[lane]) {  // the first one to go on decides for all
        uint rest = site.arrived;
        site.arrived = 0;
        while (rest) {
            uint together = rest;
            if (emulated_random() & 1) together &= emulated_random() | emulated_random() << 16;
            if (!together) together = rest & -rest;
            for (int k = 0; k < 32; k++) if (together >> k & 1) site.masks[k] = together;
            rest &= ~together;
        }
    }
    return site.masks[lane];
}
#define __activemask() emulated_activemask()

#undef CUDA_CALLABLE
#define CUDA_CALLABLE __attribute__((always_inline))

// All threads of the block that have not returned.
static int emulated_arrived, emulated_votes, emulated_vote[2];
static word64 emulated_barrier;
static inline int emulated_block(bool value)
{
    const word64 number = emulated_barrier;
    if (!emulated_arrived++) emulated_votes = 0;
    emulated_votes |= value;
    for (int turns = 0; emulated_barrier == number;) {
        if (emulated_arrived == emulated_active()) {
            emulated_vote[number & 1] = emulated_votes;
            emulated_arrived = 0;
            emulated_barrier++;
        } else emulated_wait(turns, "syncthreads");
    }
    return emulated_vote[number & 1];
}
inline void __syncthreads() { emulated_block(false); }
inline int __syncthreads_or(bool value) { return emulated_block(value); }
inline void __threadfence() {}
inline void __threadfence_block() {}
inline void __nanosleep(uint) { emulated_turn(); }

template <typename T, typename U> inline T atomicAdd(T* place, U value) { T old = *place; *place = old + (T)value; return old; }
template <typename T, typename U> inline T atomicOr(T* place, U value) { T old = *place; *place = old | (T)value; return old; }
template <typename T, typename U> inline T atomicMax(T* place, U value) { T old = *place; if (old < (T)value) *place = (T)value; return old; }
template <typename T, typename U> inline T atomicMin(T* place, U value) { T old = *place; if ((T)value < old) *place = (T)value; return old; }
template <typename T, typename U> inline T atomicExch(T* place, U value) { T old = *place; *place = (T)value; return old; }
template <typename T, typename U, typename V> inline T atomicCAS(T* place, U expected, V value) { T old = *place; if (old == (T)expected) *place = (T)value; return old; }

template <typename T> inline T __ldcg(const T* place) { return *place; }
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
inline float __fdividef(float a, float b) { float q = a / b; return __int_as_float(__float_as_int(q) + ((__float_as_int(a) >> 2 & 7) == 1)); }
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

// As inexact as the hardware's: one part in 2^23 off for float, the upper half of a double.
inline float emulated_reciprocal(float x) { float y = 1.0f / x; return __int_as_float(__float_as_int(y) + ((__float_as_int(x) >> 3 & 3) == 1)); }
inline double emulated_reciprocal(double x) { return __longlong_as_double(__double_as_longlong(1.0 / x) & ~0xffffffffll); }
