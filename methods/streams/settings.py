"""The settings of a frame, chosen from its numbers of triangles, pixels and lights. None of them changes an answer."""

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any


@dataclass(frozen=True)
class Constants:
    """The constants of speed, by which :func:`chosen` chooses. What belongs to one kernel stands beside the kernel.

    Measured on an NVIDIA H100 or H200, whole frames at 1024x1024 pixels; a letter names the section of the notebook
    (``results/notebook.md``):

    A "Pixels without a hit, and few triangles"                  D "Concurrent passes"
    B "Triangles rejected sooner, rows grouped by the stream"    E "Triangles streamed beside the sorting of rays"
    C "Cells by triangles and pixels"                            F "Cells that are narrower where rays are dense"
    G "A shorter chain of launches"

    name                 unit          meaning, and where it was measured

    few_triangles        triangles     with fewer, a GPU has room for more threads than there are triangles: what the thread
                                       of one leaves to a queue, many threads do at the same time (A)
    many_triangles       triangles     from so many on they fill the GPU, as several lights do (B)
    inline_pixels        pixels        a triangle whose box on the image holds at most so many tests them in its own thread;
                                       a larger one is queued (B)
    least_inline_pixels  pixels        the least number of them where triangles are few; it grows with these (B)
    inline_cells         cells         a triangle whose box on a face of a light covers at most so many counts their rays (C)
    inline_rays          rays          a triangle that has counted at most so many, on one face, tests them in its thread (B)
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
    spaced_work          the same      where cells are narrower where rays are dense (F)
    most_cells           sqrt(pixels)  most cells along a face (C)
    many_faces           share         of the cells along a face, where rays lie on many faces (C)
    most_of_many_faces   sqrt(pixels)  at most, there; more where triangles are more than half as many as pixels (C)
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


CONSTANTS = C = Constants()


@dataclass(frozen=True)
class Settings:
    """How the triangles of a frame are streamed over its rays. Fields that are not listed here: :class:`Constants`.

    cells          cells along a face of a light's cube: where rays lie on many faces, and where on few; how many are few
    lights_at_once, shares  each of them with queues, and each light with rays, of its own
    groups         where the rows of a light's larger triangles are put into groups: "stream": by the thread that finds the
                   triangle; "split": by a pass after it
    overlaps       where that is "stream", and the region is known: whether a light's triangles are streamed while its
                   rays are sorted. Afterwards, a triangle over few cells is left out if they hold no ray
    region         what a light's rays cover of its cube: "rays": as they are found; "triangles": as those in view cover it
    spacing        cells of a light: "even": all of one size; "rays": narrower where more rays are expected, if that is found
    items, chunks, undecided  initial room of the queues, entries; 0: as :class:`Constants` say
    """

    cells: tuple[int, int, int]
    inline_pixels: int = C.inline_pixels
    inline_cells: int = C.inline_cells
    inline_rays: int = C.inline_rays
    chunk: int = C.chunk
    lights_at_once: int = C.lights_at_once
    shares: int = C.shares
    groups: str = "stream"
    overlaps: bool = False
    spacing: str = "even"
    region: str = "rays"
    items: int = 0
    chunks: int = 0
    undecided: int = 0

    def room(self, triangles: int, pixels: int, shares: int) -> tuple[int, int, int]:
        """The initial capacity of the queues of a share: items, chunks, undecided pairs."""
        return (
            self.items or max(C.items, triangles // shares),
            self.chunks or C.chunks,
            self.undecided or max(C.undecided, pixels // (2 * shares)),
        )


def whole_cells(many: float, few: float, faces: int) -> tuple[int, int, int]:
    """Numbers of cells along a face as a frame has them: multiples of 8."""
    along = [min(4096, max(64, 8 * round(x / 8))) for x in (many, few)]
    return along[0], along[1], faces


def chosen(
    triangles: int, pixels: int, lights: int = 1, cuda: bool = False, trial: Mapping[str, Any] | None = None
) -> Settings:
    """The settings for a number of triangles, of pixels and of lights with shadows, on a GPU (``cuda``) or on a CPU;
    those of a ``trial`` in place of the chosen ones.
    """
    few, several = cuda and triangles < C.few_triangles, cuda and lights >= C.lights_at_once
    full = several or (cuda and triangles >= C.many_triangles)
    more_lights = lights >= C.most_lights_at_once
    by_triangles = cuda and lights == 1 and C.region_pixels * triangles < pixels
    grown = max(C.inline_pixels * triangles // C.few_triangles, C.least_inline_pixels)
    settings = Settings(
        cells=(0, 0, 0),
        inline_pixels=grown if few else C.inline_pixels,
        inline_rays=C.more_inline_rays if full else C.inline_rays,
        chunk=C.most_chunk if lights > 1 else C.chunk_of_few if few else C.chunk,
        lights_at_once=C.most_lights_at_once if more_lights else C.lights_at_once,
        shares=1 if several or (cuda and triangles < C.one_share_below) else C.shares,
        groups="stream" if cuda and triangles < C.split_from else "split",
        overlaps=cuda and triangles < C.overlap_below,
        spacing="rays" if cuda and lights > 1 else "even",
        region="triangles" if by_triangles else "rays",
    )
    settings = replace(settings, **(trial or {}))
    if not any(settings.cells):
        spacing = settings.spacing if settings.region == "rays" else "even"
        settings = replace(settings, cells=_cells(triangles, pixels, cuda, spacing))
    return settings


def _cells(triangles: int, pixels: int, cuda: bool, spacing: str) -> tuple[int, int, int]:
    """Finer cells take longer to clear and sum; in coarser ones more rays are tested that a triangle does not cover."""
    side = math.sqrt(pixels)
    work = C.spaced_work if spacing == "rays" else C.cell_work
    few = min((triangles * pixels / work) ** (1.0 / 3.0), C.most_cells * side)
    most = C.most_of_many_faces * side * max(1.0, 2.0 * triangles / pixels) ** 0.25
    return whole_cells(min(most, C.many_faces * few), few, C.fine_faces if cuda else 1)


@dataclass(frozen=True)
class Trial:
    """A parameter for tests and measurements.

    trial  settings in place of those that are chosen for a frame, as "name=value+name=value" (:class:`.settings.Settings`);
           cells: along every face, a multiple of 8
    """

    trial: str = ""

    def __post_init__(self) -> None:
        self.given()

    def given(self) -> dict[str, Any]:
        """The settings of the trial. Raises ValueError if it has none of that name, or another value."""
        found: dict[str, Any] = {}
        for text in filter(None, self.trial.split("+")):
            name, _, value = text.partition("=")
            if name not in NAMES:
                raise ValueError(f"trial must be NAME=VALUE, joined by +, with names of {', '.join(NAMES)}")
            found[name] = _value(name, value)
        return found


NAMES = tuple(field.name for field in dataclasses.fields(Settings))
CHOICES = {"groups": ("stream", "split"), "spacing": ("even", "rays"), "region": ("rays", "triangles")}
RANGES = {"cells": (8, 8192), "chunk": (1, C.most_chunk), "lights_at_once": (1, 16), "shares": (1, 16)}
"""Of the other numbers: 0 to 2^28."""


def _value(name: str, text: str) -> Any:
    """The value of a setting."""
    if name == "overlaps":
        if text.lower() not in ("true", "false"):
            raise ValueError("trial: overlaps must be true or false")
        return text.lower() == "true"
    if name in CHOICES:
        if text not in CHOICES[name]:
            raise ValueError(f"trial: {name} must be one of {', '.join(CHOICES[name])}")
        return text
    least, most = RANGES.get(name, (0, 2**28))
    if not text.isdecimal() or not least <= int(text) <= most:
        raise ValueError(f"trial: {name} must be in {least}..{most}")
    if name == "cells" and int(text) % 8:
        raise ValueError("trial: cells must be a multiple of 8")
    return (int(text), int(text), 1) if name == "cells" else int(text)


FORMER_NAMES = {
    "beside": "lights_at_once", "doubt_capacity": "undecided", "item_capacity": "items", "part": "chunk",
    "part_capacity": "chunks", "streamed": "overlaps",
}  # fmt: skip
"""Settings that were parameters of their own under other names; the rest of :data:`NAMES` were under the same."""

FORMER_VALUES = {"streamed": {"beside": "true", "after": "false"}}
CHOSEN = ("auto", "-1")
"""Former values that asked for what a frame chooses."""


def present_settings(settings: dict[str, str]) -> dict[str, str]:
    """Settings of the versions in which each was a parameter of its own, as a trial. ``queue``, which has no present name,
    stays where it was more than what is chosen.
    """
    present: dict[str, str] = {}
    trial = [text for text in settings.get("trial", "").split("+") if text]
    for name, value in settings.items():
        now = FORMER_NAMES.get(name, name)
        if value in CHOSEN or (name == "cells" and value == "0"):
            continue
        if now in NAMES:
            trial.append(f"{now}={FORMER_VALUES.get(name, {}).get(value, value)}")
        elif name != "trial":
            present[name] = value
    return {**present, **({"trial": "+".join(trial)} if trial else {})}
