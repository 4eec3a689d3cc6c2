// Shared memory as a block finds it, and copies into it that arrive when they are waited for.
#pragma once

static word64 emulated_blocks;  // that have begun

// What the hardware leaves undefined: what other kernels have left there.
static inline void emulated_spoil(void* place, word64 bytes) { __builtin_memset(place, 0xa5, bytes); }

// At a shared variable, by each thread that comes by. ``of_block``: the block that has had it last.
static inline void emulated_begin_shared(word64& of_block, void* place, word64 bytes)
{
    if (of_block != emulated_blocks) emulated_spoil(place, bytes);
    of_block = emulated_blocks;
}

// Copies of 16 bytes that a thread has begun, each with the number of its group; ``groups``: those that have ended.
struct emulated_copy { const void* from; void* to; word64 group; };
struct emulated_copies { word64 groups; int number; emulated_copy copies[64]; };
static emulated_copies emulated_under_way[1024];

// Copy from there, or zeros (``from`` null). Until it is waited for, the place holds neither what it held nor what it will.
static inline void emulated_begin_copy(void* to, const void* from)
{
    emulated_copies& mine = emulated_under_way[emulated_thread()];
    if (mine.number == 64) {
        printf("emulated: a thread has more than 64 copies under way\n");
        abort();
    }
    mine.copies[mine.number++] = {from, to, mine.groups};
    emulated_spoil(to, 16);
}

static inline void emulated_end_group() { emulated_under_way[emulated_thread()].groups++; }

// All groups that have ended, but the last ``but``, have arrived.
static inline void emulated_arrive(word64 but)
{
    emulated_copies& mine = emulated_under_way[emulated_thread()];
    int left = 0;
    for (int k = 0; k < mine.number; k++) {
        const emulated_copy copy = mine.copies[k];
        if (copy.group + but >= mine.groups) mine.copies[left++] = copy;
        else if (copy.from) __builtin_memcpy(copy.to, copy.from, 16);
        else __builtin_memset(copy.to, 0, 16);
    }
    mine.number = left;
}

static inline void emulated_arrive_all()
{
    emulated_end_group();
    emulated_arrive(0);
}
