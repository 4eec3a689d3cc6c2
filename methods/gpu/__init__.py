"""What Warp lacks on a GPU: lanes of a warp, accesses of 16 bytes, prefetch to shared memory, places in lists, division."""
