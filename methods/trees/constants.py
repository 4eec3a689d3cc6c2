"""Constants that the speed of trees depends on, and no answer.

In brackets: where other values were measured, in whole frames on an H200, results/notebook-methods.md ("tried" and "small")
or results/notebook.md ("pairs", "exact"). Without: the value was taken from the source named in the code, or never varied.
"""

MANY_TRIANGLES = 70_000  # from which on H-PLOC makes the tree, below LBVH, and blocks are sorted [small]
KEY_BITS = 24  # of the Morton keys that leaves are sorted by [tried]
RADIUS = 2  # places on either side, where H-PLOC looks for a cluster to merge [tried]
SHARED_AREA = 1.25  # ratio of a common box to both boxes, up to which a leaf is shared [pairs]
BLOCK = 128  # threads of a block that builds or traces, a power of two [tried]
REGISTERS = 48  # of a thread of the kernels that trace [tried, exact]
EYE_REGISTERS = 56  # ... of rays from the eye, with their hit points in float64 [exact]
RESOLVE_REGISTERS = 96  # of a thread of the kernel of the hit points of listed rays [tried]
RECORD_REGISTERS = 64  # of a thread of the kernels that make records, which memory limits
SHARES = 2  # parts of the pixels that a GPU traces at once [tried, exact]
TOGETHER = True  # whether rays to a single light and the eye's are traced at once [small]
PACKETS = 4  # pixels for a triangle, above which primary rays in float32 are packets [small]
EXACT_PACKETS = 14  # ... exact ones [small]
MOST_KEPT = 14  # undecided triangles that a ray keeps before it enters them in a list
UNDECIDED = 262_144  # pairs that there is room for at first, or half the pixels
SORT_THREADS = 256  # of a block that sorts
MANY_KEYS = 400_000  # from which on a thread sorts 16 of them, below 8
TILES_AT_ONCE = 4  # whose counts a thread reads at once when it looks back [tried]

MOST_TRIANGLES = 2**24
"""A tree over fewer fits the stacks."""


def first_capacity(pixels: int) -> int:
    """:data:`UNDECIDED` of so many pixels."""
    return max(UNDECIDED, pixels // 2)
