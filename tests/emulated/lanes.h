// CUDA's functions for the threads of a warp and of a block, on the fibers that Warp has for blocks on a CPU.
// One thread runs at a time, and another takes its turn only within one of these functions; blocks run one after the other.
// A thread that waits lets those that lag behind run: wp_cpu_tile_sync does that, and returns when all have come as far.
#pragma once

#include "numbers.h"

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
static struct { uint x = WP_TILE_BLOCK_DIM, y = 1, z = 1; } blockDim;
static const int warpSize = 32;

#define __CUDA_ARCH__ 900

#include "memory.h"

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

// With a seed, others may take their turns first. Not where Warp's own functions for blocks are called, which count turns:
// there all threads take as many.
static inline void emulated_reorder()
{
#ifndef EMULATED_IN_ORDER
    for (uint turns = emulated_random() & 3; turns > 1; turns--) emulated_turn();
#endif
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

// What the lanes of a mask exchange. Lanes of different masks may exchange at the same time, and a lane may exchange with
// some while others wait for it.
struct emulated_exchange { const char* what; uint mask, arrived; word64 begun, values[32]; };
struct emulated_warp {
    emulated_exchange exchanges[32];
    bool waits[32];
    uint ended, present[32];  // lanes that have returned; lanes that took part in a lane's last exchange
    word64 arrivals, last[32], seen[32][32];
};
static emulated_warp emulated_warps[32];

// An exchange ends when all lanes of its mask that have not returned have arrived.
static inline void emulated_complete(emulated_warp& warp, emulated_exchange& e)
{
    if (e.arrived != (e.mask & ~warp.ended)) return;
    const uint present = e.arrived;
    e.arrived = 0;
    for (uint rest = present; rest; rest &= rest - 1) {
        const int other = __builtin_ctz(rest);
        for (int k = 0; k < 32; k++) warp.seen[other][k] = e.values[k];
        warp.present[other] = present;
        warp.waits[other] = false;
    }
}

// As a thread of a block begins. Threads that the block lacks have returned, as on a GPU.
static inline void emulated_begin(int thread, word64 threads)
{
    if (thread == 0) {
        emulated_blocks++;
        for (int w = 0; w < 32; w++) {
            const word64 here = threads > w * 32 ? threads - w * 32 : 0;
            emulated_warps[w].ended = here < 32 ? ~0u << here : 0;
        }
    }
    emulated_reorder();
}

// As it returns. Its copies arrive. Lanes that wait for it do so no longer; but one that made another exchange meanwhile has passed them by.
static inline void emulated_end(int thread)
{
    emulated_arrive_all();
    const int lane = thread & 31;
    emulated_warp& warp = emulated_warps[thread >> 5];
    for (emulated_exchange& e : warp.exchanges) {
        if (e.arrived && (e.mask >> lane & 1) && warp.last[lane] > e.begun) {
            printf("emulated: lane %d returns, and lanes %08x wait for it at %s\n", lane, e.arrived, e.what);
            abort();
        }
    }
    warp.ended |= 1u << lane;
    for (emulated_exchange& e : warp.exchanges) if (e.arrived) emulated_complete(warp, e);
}

static inline const word64* emulated_all(uint mask, word64 value, const char* what)
{
    emulated_reorder();
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
    warp.last[lane] = ++warp.arrivals;
    if (!e.arrived) e.begun = warp.arrivals;
    e.what = what, e.mask = mask, e.values[lane] = value, e.arrived |= 1u << lane;
    warp.waits[lane] = true;
    emulated_complete(warp, e);
    for (int turns = 0; warp.waits[lane];) emulated_wait(turns, what);
    return warp.seen[lane];
}

// Of the lanes of its mask, those that took part in this lane's last exchange.
static inline uint emulated_present() { return emulated_warps[emulated_thread() >> 5].present[emulated_lane()]; }

// Of them, those that gave ``value``.
static inline uint emulated_equal(const word64* all, word64 value)
{
    const uint present = emulated_present();
    uint bits = 0;
    for (int k = 0; k < 32; k++) if ((present >> k & 1) && all[k] == value) bits |= 1u << k;
    return bits;
}

static inline uint emulated_ballot(uint mask, bool value, const char* what)
{
    return emulated_equal(emulated_all(mask, value, what), true);
}

static const char emulated_up[] = "shfl_up";

// Lanes are divided into parts of ``width``; a lane that would read beyond its part gets its own value.
template <typename T> inline T emulated_of(uint mask, T value, int lane, int width, const char* what)
{
    static_assert(sizeof(T) <= 8, "lanes exchange values of 8 bytes at most");
    const word64* all = emulated_all(mask, emulated_bits(value), what);
    const int first = emulated_lane() & -width;
    if (lane < first && what == emulated_up || lane >= first + width) return value;
    // The hardware leaves undefined what is not there.
    if (!(emulated_present() >> lane & 1)) return emulated_value<T>(0xa5a5a5a5a5a5a5a5ull);
    return emulated_value<T>(all[lane]);
}

template <typename T> inline T __shfl_sync(uint mask, T value, int lane, int width = 32)
{
    return emulated_of(mask, value, (emulated_lane() & -width) + (lane & (width - 1)), width, "shfl");
}
template <typename T> inline T __shfl_up_sync(uint mask, T value, uint by, int width = 32)
{
    return emulated_of(mask, value, emulated_lane() - (int)(by & 31), width, emulated_up);
}
template <typename T> inline T __shfl_down_sync(uint mask, T value, uint by, int width = 32)
{
    return emulated_of(mask, value, emulated_lane() + (int)(by & 31), width, "shfl_down");
}
template <typename T> inline T __shfl_xor_sync(uint mask, T value, int by, int width = 32)
{
    return emulated_of(mask, value, emulated_lane() ^ (by & 31), width, "shfl_xor");
}
inline uint __ballot_sync(uint mask, bool value) { return emulated_ballot(mask, value, "ballot"); }
inline int __any_sync(uint mask, bool value) { return emulated_ballot(mask, value, "any") != 0; }
inline int __all_sync(uint mask, bool value) { return emulated_ballot(mask, value, "all") == emulated_present(); }
inline void __syncwarp(uint mask = 0xffffffffu) { emulated_all(mask, 0, "syncwarp"); }

template <typename T> inline uint __match_any_sync(uint mask, T value)
{
    const word64 own = emulated_bits(value);
    return emulated_equal(emulated_all(mask, own, "match"), own);
}

template <typename T, typename F> inline T emulated_reduce(uint mask, T value, F both)
{
    const word64* all = emulated_all(mask, emulated_bits(value), "reduce");
    const uint present = emulated_present();
    T sum = value;
    for (int k = 0; k < 32; k++) if ((present >> k & 1) && k != emulated_lane()) sum = both(sum, emulated_value<T>(all[k]));
    return sum;
}
template <typename T> inline T __reduce_max_sync(uint mask, T value)
{
    return emulated_reduce(mask, value, [](T a, T b) { return a > b ? a : b; });
}
template <typename T> inline T __reduce_min_sync(uint mask, T value)
{
    return emulated_reduce(mask, value, [](T a, T b) { return a < b ? a : b; });
}
template <typename T> inline T __reduce_or_sync(uint mask, T value)
{
    return emulated_reduce(mask, value, [](T a, T b) { return a | b; });
}
template <typename T> inline T __reduce_and_sync(uint mask, T value)
{
    return emulated_reduce(mask, value, [](T a, T b) { return a & b; });
}
template <typename T> inline T __reduce_xor_sync(uint mask, T value)
{
    return emulated_reduce(mask, value, [](T a, T b) { return a ^ b; });
}
template <typename T> inline T __reduce_add_sync(uint mask, T value)
{
    return emulated_reduce(mask, value, [](T a, T b) { return a + b; });
}

// The lanes that come to the same place during one turn. The hardware may give fewer, so with a seed they are
// divided at random.
struct emulated_site { const void* place; uint arrived, masks[32]; };
static const int EMULATED_SITES = 256;
static emulated_site emulated_sites[32][EMULATED_SITES];
// A place of the machine code: functions are inlined, as for the GPU, so two calls of one function differ.
static __attribute__((noinline)) uint emulated_activemask()
{
    const int lane = emulated_lane();
    const void* place = __builtin_return_address(0);
    emulated_site* found = emulated_sites[emulated_thread() >> 5];
    for (int k = 0; found->place && found->place != place; found++) {
        if (++k < EMULATED_SITES) continue;
        printf("emulated: a module has more than %d places of __activemask\n", EMULATED_SITES);
        abort();
    }
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
