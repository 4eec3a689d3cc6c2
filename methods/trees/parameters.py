"""The parameters of the tree. None of them changes an exact answer."""

from __future__ import annotations

from dataclasses import dataclass

from ...harness.frame.schedule.threads import check_threads

BUILDERS = ("hploc", "lbvh")
UPDATES = ("rebuild", "refit", "static")
RADII = (1, 2, 4, 8)
KEY_BITS = (24, 30)
NODE_BYTES = (48, 64)
PRECISIONS = ("exact", "float32")
PRIMARIES = ("packet", "single")

FLOAT32_INEXACT = (
    "float32 triangle tests without a bound; shadow rays end 1e-4 of their length before the hit point"
)


@dataclass(frozen=True)
class Build:
    """How the tree is made and kept up to date.

    update      "rebuild": built in each frame, from the triangles of that frame; "refit": a SAH tree of the animation's
                first frame, its boxes refitted each frame; "static": that tree, for geometry that does not move
    builder     of a rebuilt tree: "lbvh" (Lauterbach et al. 2009, in one pass: Apetrei 2014) or "hploc" (Benthin et
                al. 2024)
    radius      of "hploc": how many neighbours on either side are candidates for a merge with a cluster
    key_bits    bits of the Morton keys that the triangles are sorted by
    node_bytes  64: both children's boxes as centre and extent in float32; 48: extents rounded up to bfloat16
    pair        of a rebuilt tree: triangles 2 k and 2 k + 1 of the mesh share a leaf where the area of their common box is
                at most this many times the sum of their own boxes' areas; 0: never
    doubt_capacity  initial room for pairs of a triangle and a ray left to float64; 0 chooses; grows as needed
    """

    update: str = "rebuild"
    builder: str = "hploc"
    radius: int = 2
    key_bits: int = 24
    node_bytes: int = 48
    pair: float = 1.25
    doubt_capacity: int = 0

    def __post_init__(self) -> None:
        for name, known in (
            ("update", UPDATES),
            ("builder", BUILDERS),
            ("radius", RADII),
            ("key_bits", KEY_BITS),
            ("node_bytes", NODE_BYTES),
        ):
            if getattr(self, name) not in known:
                raise ValueError(f"{name} must be one of {', '.join(map(str, known))}")
        if not 0 <= self.doubt_capacity <= 2**28:
            raise ValueError("doubt_capacity must be in 0..2^28")
        if not 0.0 <= self.pair <= 1000.0:
            raise ValueError("pair must be in 0..1000")


@dataclass(frozen=True)
class Trace:
    """How rays are traced.

    precision  "exact": float32 tests with a bound on their error, float64 for what they leave in doubt; "float32": the
               same tree as it is usually traced, with its errors. Scenes with holes, rays of an orthographic
               camera and shadow rays of a directional light are traced exactly in either case
    primary    on the GPU: "packet": the rays of 8 x 4 pixels share one stack; "single": each ray has its own
    registers  limit of registers per thread of the kernels that trace on the GPU
    shares     parts of the pixels that the GPU traces at once, each with queues of its own: while the last rays of one
               share end, the rays of another continue
    threads    of a CPU: each traces a share of the pixels; 0: one for each core that this process may use, at most 16
    """

    precision: str = "exact"
    primary: str = "single"
    registers: int = 48
    shares: int = 2
    threads: int = 0

    def __post_init__(self) -> None:
        if self.precision not in PRECISIONS:
            raise ValueError(f"precision must be one of {', '.join(PRECISIONS)}")
        if self.primary not in PRIMARIES:
            raise ValueError(f"primary must be one of {', '.join(PRIMARIES)}")
        if not 32 <= self.registers <= 255:
            raise ValueError("registers must be in 32..255")
        if not 1 <= self.shares <= 16:
            raise ValueError("shares must be in 1..16")
        check_threads(self.threads)
