"""Work counters of a frame, read back after it: pairs, tiles, lists, chunks, lanes, tests."""

import numpy as np
from numpy.typing import NDArray

from .camera.grid import CameraGrid
from .light.grid import LightGrid
from .lists.binning import TileBins


def work(
    camera: CameraGrid, lights: list[LightGrid], primary: NDArray[np.int32], shadow: NDArray[np.int32]
) -> dict[str, int]:
    """Counts of the last frame. ``primary``, ``shadow``: triangle tests of each pixel.

    Of each grid: pairs, occupied tiles and cells, and the lengths of the occupied tiles' lists (mean, p99, max).
    Of each light: shadow rays, tiles with rays, most rays in a tile, chunks C_total, and lanes C_total * r; the lane fill
    is rays / lanes. Tests per ray, in hundredths.
    """
    tested, rays = int(primary.sum(dtype=np.int64)), 0
    result = {
        "primary tests": tested,
        "primary tests a hundred rays": round(100 * tested / max(1, len(primary))),
        "primary tests, most": int(primary.max(initial=0)),
        **_lists("camera", camera.bins),
    }
    for light in lights:
        name, traced = f"light {light.index}", light.traced()
        lengths = light.sorted.lengths() * traced
        chunks = int(light.chunks.of_rays.total.numpy()[0]) * traced
        result |= {
            **_lists(name, light.bins, traced),
            f"{name} rays": int(lengths.sum()),
            f"{name} tiles with rays": int((lengths > 0).sum()),
            f"{name} most rays in a tile": int(lengths.max()),
            f"{name} chunks": chunks,
            f"{name} lanes": chunks * light.chunks.r,
        }
        rays += int(lengths.sum())
    if lights:
        tested = int(shadow.sum(dtype=np.int64))
        result |= {"shadow tests": tested, "shadow tests a hundred rays": round(100 * tested / rays) if rays else 0}
    return result


def _lists(name: str, bins: TileBins, made: bool = True) -> dict[str, int]:
    lengths = bins.lengths() * made
    lengths = lengths[lengths > 0]
    keys = bins.lists.keys.numpy()[: int(lengths.sum())]
    return {
        f"{name} pairs": len(keys),
        f"{name} occupied tiles": len(lengths),
        f"{name} occupied cells": 0 if not len(keys) else 1 + int(np.count_nonzero(np.diff(keys))),
        f"{name} list, mean": round(lengths.mean()) if len(lengths) else 0,
        f"{name} list, p99": int(np.percentile(lengths, 99)) if len(lengths) else 0,
        f"{name} list, longest": int(lengths.max(initial=0)),
    }
