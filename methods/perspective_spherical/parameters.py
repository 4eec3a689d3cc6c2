"""The parameters of the paper's method. The defaults are the fastest on an H200 at 1024x1024; PAPER is the paper's
configuration.
"""

from dataclasses import dataclass

from ..common.parameters import check_choices, check_ranges

DEPTH_LISTS = ("spans", "nearest")
TRIANGLE_TESTS = ("exact", "edge_planes", "moller_trumbore")
CULLING = ("off", "primary", "primary+light")
LIGHT_MAPS = ("azimuth-elevation", "two-angle", "cube")
CLAMPS = ("hits", "view", "none", "scene")
PRECISIONS = ("float64", "float32", "float32-centred")
LIGHT_BOUNDS = ("exact", "seam", "vertices")
STAGING = ("none", "shared")
BALANCING = ("direct", "algorithm-1")
SORTS = ("counting", "radix")


@dataclass(frozen=True)
class Build:
    """Grid parameters. ``light_bounds`` may lose shadows, ``triangle_test`` may lose hits at edges and vertices, ``cull``
    may answer a tie by the other triangle; no other changes an answer.

    tile          side of a square sorting tile of the image, pixels
    slices        slices of depth in the perspective grid, linear between nearest and farthest triangle; 1: none
    light_tiles   tiles along each side of a light rectangle (of each of six with ``light_map`` "cube")
    light_slices  slices of distance in a light grid, linear between nearest and farthest shadow ray
    depth_lists   "spans": a triangle is listed in every slice it spans (the paper); "nearest": only in its first
    light_map     "azimuth-elevation"; "two-angle": alpha = atan2(right, forward), beta = atan2(up, forward), as
                  section 4.1 words it; "cube": six faces (Hunt & Mark 2008), which the paper argues against
    aimed         the light's frame looks at the middle of the hit points, or along its spot; otherwise along +x, y up
    precision     number format of the rays' light-space coordinates. "float32" widens triangles by its rounding:
                  never wrong, but far lights need more and more pairs (status ``rejected`` where they do not fit).
                  "float32-centred": relative to the middle of the hit points, which lies on the axis of an aimed
                  frame; what is rounded is then small where the light is far (distances stay in float64)
    light_bounds  box of a triangle in azimuth and elevation. "exact": of its great arcs, and of a pole inside it.
                  "seam": of its vertices, azimuths unwrapped. "vertices": of its vertices as they are, which the paper's
                  wording suggests. The last two lose shadows; they exist to show how many
    clamp         rectangle of a light grid: "hits" of the hit points; "view" of the camera's frustum (Figure 5);
                  "none": all directions, or the whole spot; "scene": of a sphere around the scene, seen from the
                  light. The first three depend on what the camera sees, so that the grid is rebuilt where only the
                  camera moves; the last does not (``skip_empty`` is then off: it looks at the rays)
    skip_empty    no pair where no shadow ray lies in the tile, or where none reaches the slice
    triangle_test "exact": float32 rejects only what is certain, float64 decides. "edge_planes": float32 planes
                  through the origin and each edge, in difference form and weld order. "moller_trumbore": float32,
                  determinant not zero, as the paper uses it. See :mod:`.camera.ray_tests` for what the last two may lose
    cull          back faces left out: "off", "primary" (from the eye's grid), "primary+light" (from the lights'
                  too). Refused unless the scene is declared closed, eye (and lights) are outside in every frame, and
                  the triangle test is exact: rays that slip between front faces of the others are lost behind.
                  Section 3 names "primary" for the perspective grid alone
    sort          of pairs by cell and of shadow rays by tile: "radix" (the paper's), or "counting", with a count of
                  each cell (radix where cells are more than 4 million)
    pair_capacity initial room for (triangle, cell) pairs; 0 chooses; grows as needed
    row_capacity  initial room for (large triangle, tile row) items; 0 chooses; grows as needed
    """

    tile: int = 8
    slices: int = 64
    light_tiles: int = 128
    light_slices: int = 64
    depth_lists: str = "nearest"
    light_map: str = "azimuth-elevation"
    aimed: bool = True
    precision: str = "float64"
    light_bounds: str = "exact"
    clamp: str = "hits"
    skip_empty: bool = True
    triangle_test: str = "exact"
    cull: str = "off"
    sort: str = "counting"
    pair_capacity: int = 0
    row_capacity: int = 0

    def __post_init__(self) -> None:
        check_ranges(self, tile=(1, 1024), slices=(1, 4096), light_tiles=(1, 4096), light_slices=(1, 4096))
        check_ranges(self, pair_capacity=(0, 2**30), row_capacity=(0, 2**28))
        if self.light_tile_count * self.light_slices >= 2**30:
            raise ValueError("tiles * light_slices of a light grid must stay below 2^30 cells")
        check_choices(
            self, depth_lists=DEPTH_LISTS, light_map=LIGHT_MAPS, precision=PRECISIONS, cull=CULLING, sort=SORTS
        )
        check_choices(self, light_bounds=LIGHT_BOUNDS, clamp=CLAMPS, triangle_test=TRIANGLE_TESTS)
        if self.precision == "float32-centred" and not self.aimed:
            raise ValueError("precision float32-centred needs aimed=true: the middle must lie on the frame's axis")
        if self.light_bounds != "exact" and self.light_map != "azimuth-elevation":
            raise ValueError("light_bounds other than exact needs light_map=azimuth-elevation")

    @property
    def light_faces(self) -> int:
        """Rectangles of a light grid."""
        return 6 if self.light_map == "cube" else 1

    @property
    def light_tile_count(self) -> int:
        return self.light_faces * self.light_tiles**2


@dataclass(frozen=True)
class Trace:
    """Tracing parameters. None of them changes an answer.

    k               sorting tiles along each side of a tracing tile, which is one thread block: 1 direct mapping,
                    2 the paper's best indirect mapping (section 3)
    r               most shadow rays per chunk, which is one thread block (section 4.3)
    balancing       how rays become chunks: "algorithm-1" word by word, or "direct" from each tile's count
    staging         "shared": the threads of a block bring triangles to shared memory (CUDA; elsewhere the plain
                    kernel runs); "none": each thread reads them itself
    triangle_chunk  lists longer than this are split into chunks of it that are tested in parallel and combined
                    (the paper's future work); 0: never
    """

    k: int = 1
    r: int = 32
    balancing: str = "direct"
    staging: str = "shared"
    triangle_chunk: int = 0

    def __post_init__(self) -> None:
        check_ranges(self, k=(1, 64), r=(1, 65536), triangle_chunk=(0, 2**24))
        check_choices(self, balancing=BALANCING, staging=STAGING)


PAPER = {
    "tile": "8",
    "slices": "16",
    "light_tiles": "128",
    "light_slices": "16",
    "depth_lists": "spans",
    "light_map": "azimuth-elevation",
    "aimed": "false",
    "precision": "float32",
    "clamp": "view",
    "skip_empty": "false",
    "triangle_test": "moller_trumbore",
    "cull": "off",
    "sort": "radix",
    "k": "2",
    "r": "128",
    "balancing": "algorithm-1",
    "staging": "shared",
    "triangle_chunk": "0",
}
"""The paper-faithful configuration at 1024x1024, as text for ``make_method``. ``cull``, which section 3 offers, is off:
it would lose hits with the paper's own triangle test. r is one of the four values of Figure 11, of which the paper
names none as its own.
"""

LOST_BOUNDS = {
    "seam": "triangles bounded by their vertices on the sphere: great arcs bulge, and poles lie inside triangles",
    "vertices": "triangles bounded by their vertices on the sphere, the seam of azimuth not heeded",
}
LOST_TESTS = {
    "edge_planes": "a float32 triangle test by edge planes",
    "moller_trumbore": "a float32 triangle test that is not watertight",
}


def known_inexact(build: Build) -> str | None:
    """Why these settings may be wrong, or None where they are exact."""
    reasons = [LOST_TESTS.get(build.triangle_test), LOST_BOUNDS.get(build.light_bounds)]
    return "; ".join(reason for reason in reasons if reason) or None
