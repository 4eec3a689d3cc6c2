"""The GPU's side of kernels on a CPU: native snippets as a GPU compiles them, on Warp's fibers for blocks.

    python tests/emulated check ray_grids --device cpu          any command of shadowbench
    python tests/emulated tests/tools/fuzz.py --seconds 60      or a program

Kernels take other ways on a GPU than on a CPU: queues, and lanes of a warp that exchange values. Where no GPU is at hand,
this runs those ways and finds wrong answers, lanes that wait for others that never come, and exchanges whose masks do not
agree. As CUDA defines it, lanes that have returned are not waited for. With ``--replace OLD NEW`` it runs them with another
text in every snippet: a test that they are tested. With EMULATED_SEED=1, 2, ... in the environment the lanes of
``__activemask`` are divided at random, and lanes begin and exchange in other orders.

Shared memory begins as other kernels may have left it, and copies into it (``cp.async``) arrive when they are waited for.

It is no GPU: blocks run one after the other, atomics and memory are in order, products are fused with sums where the CPU's
compiler does it, and nothing is said about time. The graphs that a GPU captures are launched pass by pass.
"""
