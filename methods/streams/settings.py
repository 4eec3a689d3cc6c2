"""The parameters of the ray grids. None of them changes an answer."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Self

from ...harness.frame.schedule.threads import check_threads

QUEUES = ("auto", "always", "never")

OCCLUDERS = ("none", "last")

REGIONS = ("auto", "triangles", "rays")

GROUPS = ("auto", "stream", "split")

STREAMED = ("auto", "beside", "after")

SPACINGS = ("auto", "even", "rays")

MOST_PART = 256
"""Most pixels of a part: a warp keeps those that are undecided (:data:`..gpu.warps.KEPT`)."""

CHOOSE = -1
"""For a parameter: chosen from the number of triangles and of lights."""

FEW_TRIANGLES = 65536
"""With fewer, a GPU has room for more threads than there are triangles. What the thread of a triangle leaves to a queue,
many threads do at the same time: so a triangle tests fewer pixels itself the fewer there are. Measured on an H200, as are
the numbers below (``results/notebook.md``)."""

ONE_SHARE_BELOW = 16384
"""Of fewer triangles the passes of two shares would take the time of their launches, each."""

SPLIT_FROM = 200_000
"""From so many triangles on, a pass of its own puts rows into groups: a warp of the stream would wait for the one of its
triangles that is larger."""

STREAM_BESIDE_BELOW = 90_000
"""Fewer triangles are streamed beside the passes that sort the rays: more take the room of these passes."""

MANY_TRIANGLES = 1_200_000
"""From so many on they fill the GPU, as several lights do: more is tested in line."""

INLINE_PIXELS, INLINE_RAYS, PIXELS_OF_FEW = 32, 24, 8
"""What :data:`CHOOSE` stands for with one light, and the least number of pixels where triangles are few."""

PART, PART_OF_FEW = 224, 192
"""What :data:`CHOOSE` stands for with one light: with smaller parts the slowest warp of a pass ends sooner. With several
lights, whose passes run at the same time, it is :data:`MOST_PART`."""

CELL_WORK, SPACED_WORK = 256.0, 512.0
"""Triangles times pixels, over the third power of the cells along a face: a single face of 1024x1024 cells where a million
rays meet 262 thousand triangles. The second where cells are narrower where rays are dense."""

FINE_FACES = 4
"""On a GPU: most faces with rays that have as many cells as a single one. Face 0 counts even without rays."""

REGION_PIXELS = 2
"""With more pixels per triangle, what a light's rays cover is found from the triangles; else that takes longer than the pass
over the pixels that it saves."""

RAYS_OF_MANY, BESIDE, MANY_LIGHTS = 48, 4, 8
"""From ``BESIDE`` lights on the passes of so many of them, or of ``MANY_LIGHTS``, fill the GPU: more is tested in line, and
triangles have one share."""


@dataclass(frozen=True)
class Streams:
    """Parameters of every stream of triangles over cells of rays: its cells, the work of a single thread, and its
    queues."""

    least: ClassVar[int] = 0
    """Least value of ``inline_pixels`` and ``inline_rays``; if :data:`CHOOSE`, also a value of ``beside`` and ``shares``."""

    cells: int = 0
    inline_pixels: int = 40
    inline_cells: int = 64
    beside: int = 2
    shares: int = 2
    item_capacity: int = 0
    part_capacity: int = 0
    doubt_capacity: int = 0

    def __post_init__(self) -> None:
        if not 0 <= self.cells <= 8192 or self.cells % 8:
            raise ValueError("cells must be a multiple of 8 in 0..8192")
        room = (self.item_capacity, self.part_capacity, self.doubt_capacity)
        if self.inline_pixels < self.least or min(self.inline_cells, *room) < 0:
            raise ValueError("must not be negative")
        chosen = (CHOOSE,) if self.least == CHOOSE else ()
        if any(number not in (*chosen, *range(1, 17)) for number in (self.beside, self.shares)):
            raise ValueError("beside and shares must be in 1..16")
        if max(room) > 2**28:
            raise ValueError("must be at most 2^28")

    def chosen(self, triangles: int, queued: bool, lights: int = 1, pixels: int = 0) -> Self:
        """The same with the values that are chosen for numbers of triangles, of lights with shadows, and of pixels."""
        return self

    def cells_along(self, triangles: int, pixels: int, cuda: bool) -> tuple[int, int, int]:
        """Cells along a face of a light's cube where rays lie on many faces, and where they lie on few; how many are few."""
        side = math.sqrt(pixels)
        return self._whole(side if 2 * triangles > pixels else side / 2, side, 1)

    def _whole(self, many: float, few: float, faces: int) -> tuple[int, int, int]:
        """Numbers of cells along a face as a frame has them, or ``cells`` for both."""
        if self.cells:
            return self.cells, self.cells, 1
        along = [min(4096, max(64, 8 * round(x / 8))) for x in (many, few)]
        return along[0], along[1], faces


@dataclass(frozen=True)
class Build(Streams):
    """How triangles are streamed over the rays.

    cells          cells along each side of a face of the light's cube, a multiple of 8; 0 chooses in each frame: the third
                   root of triangles times pixels / 256 (with ``spacing`` "rays" 512), at most 1.5 times the square root of
                   the pixels; at most 0.6 of that where more than four faces hold rays (on a CPU and for a spot, more
                   than one)
    inline_pixels  a triangle whose box on the image holds at most this many pixels tests them in its own thread; a
                   larger one is queued; -1: with queues one for each 2,048 triangles, at least 8 and at most 32; else 32
    inline_cells   a triangle whose box on a face covers at most this many cells, in at most 16 rows, counts the rays in
                   them; a larger one is queued
    inline_rays    a triangle that has counted at most this many rays, on one face, tests them in its own thread; with
                   more, or on a second face, it is queued; -1: 24, from 4 lights or 1.2 million triangles on 48.
                   With queues and ``groups`` "stream" no triangle tests rays itself, whatever is set
    part           pixels or rays of a queued group of rows, or of a light's four small groups, that one warp tests, at most
                   256; the rest is split into parts; -1: 224, for fewer than 65,536 triangles 192, from 2 lights on 256
    beside         with queues: lights whose passes run at the same time on the GPU, each with queues and rays of its own;
                   -1: 4, from 8 lights on 8
    shares         with queues: parts of the triangles that are streamed at the same time on the GPU, each with queues of
                   its own; -1: 2, but 1 from 4 lights on and for fewer than 16,384 triangles
    queue          whether larger triangles go through queues: "auto" (on the GPU only), "always", "never"
    groups         where the rows of a light's larger triangles are put into groups: "stream": by the thread that finds the
                   triangle; "split": by a pass after it; "auto": by the thread with fewer than 200,000 triangles
    streamed       where ``region`` is "triangles" and ``groups`` "stream": "beside": a light's triangles are streamed beside
                   the passes that sort its rays into cells; "after": after these, and a triangle over few cells is left
                   out if they hold no ray; "auto": beside with fewer than 90,000 triangles
    spacing        cells of a light: "even": all of one size; "rays": narrower where more rays are expected; "auto": by the
                   rays with queues and several lights, else even
    region         where it follows from what a light's rays cover of its cube: "triangles": from those in view, beside the
                   camera's passes, so that rays are counted in their cells where they are placed (not of a spot with
                   ``facing``);
                   "rays": from the rays; "auto": from the triangles on a GPU, for one light and
                   more than two pixels per triangle
    occluders      "last": each shadow ray is tested first against the triangle that shadowed its pixel in the last frame;
                   a ray that it shadows still is not placed in the light's grid. "none": no occluder is kept
    threads        of a CPU: each streams a part of the triangles, places a part of the rays and resolves a band of the
                   image; 0: one for each core that this process may use, at most 16
    item_capacity  initial capacity, entries, of the queues of work items and of large triangles; 0 chooses; grows when a
                   frame needs more
    part_capacity  initial capacity, entries, of the queue of further parts of work items; 0 chooses; grows when a frame
                   needs more
    doubt_capacity  initial capacity, entries, of the queue of (triangle, pixel) pairs that float64 decides; 0 chooses;
                   grows when a frame needs more
    """

    least: ClassVar[int] = CHOOSE

    inline_pixels: int = CHOOSE
    inline_rays: int = CHOOSE
    beside: int = CHOOSE
    shares: int = CHOOSE
    part: int = CHOOSE
    queue: str = "auto"
    groups: str = "auto"
    streamed: str = "auto"
    spacing: str = "auto"
    region: str = "auto"
    occluders: str = "none"
    threads: int = 0

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.inline_rays < self.least:
            raise ValueError("must not be negative")
        if self.part != CHOOSE and not 1 <= self.part <= MOST_PART:
            raise ValueError(f"part must be in 1..{MOST_PART}")
        check_threads(self.threads)
        if self.queue not in QUEUES:
            raise ValueError(f"must be one of {', '.join(QUEUES)}")
        if self.groups not in GROUPS:
            raise ValueError(f"must be one of {', '.join(GROUPS)}")
        if self.streamed not in STREAMED:
            raise ValueError(f"must be one of {', '.join(STREAMED)}")
        if self.spacing not in SPACINGS:
            raise ValueError(f"must be one of {', '.join(SPACINGS)}")
        if self.region not in REGIONS:
            raise ValueError(f"must be one of {', '.join(REGIONS)}")
        if self.occluders not in OCCLUDERS:
            raise ValueError(f"must be one of {', '.join(OCCLUDERS)}")

    def cells_along(self, triangles: int, pixels: int, cuda: bool) -> tuple[int, int, int]:
        # Finer cells take longer to clear and sum; in coarser ones more rays are tested that a triangle does not cover.
        side = math.sqrt(pixels)
        work = SPACED_WORK if self.spacing == "rays" else CELL_WORK
        few = min((triangles * pixels / work) ** (1.0 / 3.0), 1.5 * side)
        many = min(7.0 / 16.0 * side * max(1.0, 2.0 * triangles / pixels) ** 0.25, 0.6 * few)
        return self._whole(many, few, FINE_FACES if cuda else 1)

    def chosen(self, triangles: int, queued: bool, lights: int = 1, pixels: int = 0) -> Self:
        few = queued and triangles < FEW_TRIANGLES
        several = queued and lights >= BESIDE
        groups = self.groups
        if groups == "auto":
            groups = "stream" if queued and triangles < SPLIT_FROM else "split"
        pixels_of_few = max(INLINE_PIXELS * triangles // FEW_TRIANGLES, PIXELS_OF_FEW)
        rays = RAYS_OF_MANY if several or (queued and triangles >= MANY_TRIANGLES) else INLINE_RAYS
        values: dict[str, Any] = {
            "inline_pixels": pixels_of_few if few else INLINE_PIXELS,
            "inline_rays": 0 if queued and groups == "stream" else rays,
            "part": MOST_PART if lights > 1 else PART_OF_FEW if few else PART,
            "beside": MANY_LIGHTS if lights >= MANY_LIGHTS else BESIDE,
            "shares": 1 if several or (queued and triangles < ONE_SHARE_BELOW) else 2,
        }
        chosen = {name: v for name, v in values.items() if getattr(self, name) == CHOOSE}
        chosen["groups"] = groups
        if self.streamed == "auto":
            chosen["streamed"] = "beside" if queued and triangles < STREAM_BESIDE_BELOW else "after"
        if self.spacing == "auto":
            chosen["spacing"] = "rays" if queued and lights > 1 else "even"
        if self.region == "auto":
            pays = queued and lights == 1 and REGION_PIXELS * triangles < pixels
            chosen["region"] = "triangles" if pays else "rays"
        return replace(self, **chosen)
