"""The parameters of the visibility buffer and of its irregular z-buffers. None of them changes an answer."""

from __future__ import annotations

from dataclasses import dataclass

from ..streams.settings import Streams


@dataclass(frozen=True)
class Build(Streams):
    """How triangles are rasterised.

    cells          texels along each side of a face of a light's map, a multiple of 8; 0 chooses in each frame: about the
                   square root of the number of pixels where one face holds all hit points, or where triangles are more
                   than half as many as pixels; else half of that
    inline_pixels  a triangle whose box on the image holds at most this many pixels is rasterised by one thread; a larger
                   one is divided into tiles of 8 x 8 pixels
    inline_cells   a triangle whose box on a face of a light's map holds at most this many texels is rasterised there by
                   one thread; a larger one is divided into tiles of 8 x 8 texels
    inline_rays    most hit points of a light that one thread tests; where the lists of a small box are longer, the box is
                   divided into tiles too
    beside         lights whose passes run at the same time on the GPU, each with queues and lists of its own
    shares         parts of the triangles that are rasterised at the same time on the GPU, each with queues of its own
    item_capacity  initial capacity, entries, of the queues of larger triangles and of groups of 32 of their tiles; 0
                   chooses; grows when a frame needs more
    part_capacity  initial capacity, entries, of the queue of tiles; 0 chooses; grows when a frame needs more
    doubt_capacity  initial capacity, entries, of the queue of (triangle, pixel) pairs that float64 decides; 0 chooses;
                   grows when a frame needs more
    """

    inline_rays: int = 64

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.inline_rays < 0:
            raise ValueError("must not be negative")
