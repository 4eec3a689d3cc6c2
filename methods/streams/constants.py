"""The constants of speed, in one table. None of them changes an answer; :func:`.settings.chosen` chooses by them.

What belongs to one kernel (registers, sizes in shared memory) stands beside the kernel.
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class Constants:
    """Measured on an NVIDIA H100 or H200, whole frames at 1024x1024 pixels; a letter names the section of the notebook
    (``results/notebook.md``):

    A "Pixels without a hit, and few triangles"                  D "Concurrent passes"
    B "Triangles rejected sooner, rows grouped by the stream"    E "Triangles streamed beside the sorting of rays"
    C "Cells by triangles and pixels"                            F "Cells that are narrower where rays are dense"
    G "A shorter chain of launches"

    name                 unit          meaning, and where it was measured

    few_triangles        triangles     with fewer, a GPU has room for more threads than there are triangles: what the thread
                                       of one leaves to a queue, many threads do at the same time (A)
    many_triangles       triangles     from so many on they fill the GPU, as several lights do (B)
    inline_pixels        pixels        that a triangle tests in its own thread (B)
    least_inline_pixels  pixels        the least number of them where triangles are few; it grows with these (B)
    inline_cells         cells         of a light in which a triangle counts the rays (C)
    inline_rays          rays          that a triangle tests in its own thread (B)
    more_inline_rays     rays          the same where the GPU is full (B)
    chunk                elements      of a queued group that one warp tests: with smaller chunks the slowest warp of a pass
                                       ends sooner (C)
    chunk_of_few         elements      the same where triangles are few (C)
    most_chunk           elements      the same with several lights, whose passes run at the same time. A warp keeps what is
                                       undecided of a chunk (:data:`..gpu.warps.KEPT`) (D)
    split_from           triangles     from so many on, a pass of its own puts rows into groups: a warp of the stream would
                                       wait for the one of its triangles that is larger (B)
    shares               shares        of the triangles, streamed at the same time (D)
    one_share_below      triangles     of fewer, the passes of two shares would take the time of their launches, each (C)
    overlap_below        triangles     fewer are streamed while the rays are sorted: more take the room of these passes (E)
    lights_at_once       lights        whose passes run at the same time. From so many on they fill the GPU: more is tested
                                       in line, and triangles have one share (D)
    most_lights_at_once  lights        the same, from so many on (D)
    cell_work            triangles *   over the third power of the cells along a face: 1024 cells where a million rays meet
                         pixels        262 thousand triangles (C)
    spaced_work          triangles *   the same where cells are narrower where rays are dense (F)
                         pixels
    most_cells           root of       most cells along a face (C)
                         pixels
    many_faces           share         of the cells along a face, where rays lie on many faces (C)
    most_of_many_faces   root of       at most, there; more where triangles are more than half as many as pixels (C)
                         pixels
    fine_faces           faces         on a GPU: most faces with rays that have as many cells as a single one. Face 0 counts
                                       even without rays (C)
    region_pixels        pixels per    with more, what a light's rays cover is found from the triangles; else that takes
                         triangle      longer than the pass over the pixels that it saves (G)
    items                entries       at least, of the queues of work items and of large triangles before the first frame
    chunks               entries       of the queue of further chunks, likewise
    undecided            entries       at least, of the queue of pairs that float64 decides, likewise
    """

    few_triangles: int = 65_536
    many_triangles: int = 1_200_000
    inline_pixels: int = 32
    least_inline_pixels: int = 8
    inline_cells: int = 64
    inline_rays: int = 24
    more_inline_rays: int = 48
    chunk: int = 224
    chunk_of_few: int = 192
    most_chunk: int = 256
    split_from: int = 200_000
    shares: int = 2
    one_share_below: int = 16_384
    overlap_below: int = 90_000
    lights_at_once: int = 4
    most_lights_at_once: int = 8
    cell_work: float = 256.0
    spaced_work: float = 512.0
    most_cells: float = 1.5
    many_faces: float = 0.6
    most_of_many_faces: float = 7.0 / 16.0
    fine_faces: int = 4
    region_pixels: int = 2
    items: int = 262_144
    chunks: int = 65_536
    undecided: int = 262_144


CONSTANTS = Constants()
