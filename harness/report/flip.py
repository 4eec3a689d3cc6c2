"""Where a frame is wrong and how much one sees of it: a map of classes beside the records, and FLIP.

FLIP (Andersson et al. 2020) is how different two pictures look to an eye that flips between them. Ten wrong pixels
in a million are nothing to it, which is why it stands beside the counts and never in their place.
"""

from __future__ import annotations

import importlib.util
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from ..judge.classify import RIGHT
from ..judge.score import Judge
from ..judge.shared_errors import Disputes
from ..results.pixel_maps import read_map, write_map
from .picture import shade

FLIP_MISSING = "flip-evaluator is not installed; pip install shadowbench[flip]"
OFFSET = 1
"""Added to classes in a map, whose numbers must not be negative: an unjudged pixel is 0."""


def wrong_path(folder: Path, key: str, frame: int) -> Path:
    """Where the classes of a point's frame are kept."""
    return folder / "maps" / f"{key}-{frame}-wrong.png"


def reference_path(folder: Path, scene: str, frame: int) -> Path:
    """Where the reference's picture of a scene's frame is kept, to draw errors on."""
    return folder / "images" / f"{scene}-{frame}-reference.png"


def read_wrong(path: Path) -> NDArray[np.int64]:
    """Classes of :class:`.judge.referee.Verdict` [height, width]; -1: left unjudged."""
    return read_map(path) - OFFSET


def mark_wrong(path: Path, pixels: NDArray[np.integer], classes: NDArray[np.int8]) -> None:
    """Set pixels of a map of classes that were counted as right; nothing where there is no map or nothing changes."""
    if not (len(pixels) and path.exists()):
        return
    known = read_wrong(path)
    marked = known.ravel().copy()
    rows = np.isin(marked[pixels], RIGHT)
    marked[pixels[rows][::-1]] = classes[rows][::-1]  # the first one of a pixel counts
    if (marked != known.ravel()).any():
        write_map(path, marked.reshape(known.shape) + OFFSET)


def keep_wrong(
    folder: Path,
    key: str,
    frame: int,
    judge: Judge,
    answers: dict[str, NDArray],
    disputes: list[Disputes] | None = None,
) -> tuple[dict[str, Any], dict[str, Any]]:
    """The score of a frame's answers, its map of classes written; and its FLIP, or the reason why there is none.

    ``disputes`` as in :func:`.judge.score.score_answers`.
    """
    moment = judge.moment
    classes = np.zeros(moment.width * moment.height, dtype=np.int8)
    score = judge.score(answers, classes=classes, disputes=disputes)
    shape = (moment.height, moment.width)
    write_map(wrong_path(folder, key, frame), classes.reshape(shape).astype(np.int64) + OFFSET)
    right, given = (picture(judge, one) for one in (judge.reference.answers(), answers))
    path = reference_path(folder, judge.prepared.scene.name, frame)
    if not path.exists():
        path.parent.mkdir(parents=True, exist_ok=True)
        Image.fromarray(right).save(path)
    return score, flip(right, given)


def picture(judge: Judge, answers: dict[str, NDArray]) -> NDArray[np.uint8]:
    """Answers as a picture, uint8 [height, width, 3]."""
    return shade(judge.prepared, judge.moment, answers, judge.prepared.lights(judge.moment.index))


def flip(reference: NDArray[np.uint8], given: NDArray[np.uint8]) -> dict[str, Any]:
    """Mean FLIP of a picture against the reference's, 0 (same) to 1; None with the reason where it is absent."""
    if importlib.util.find_spec("flip_evaluator") is None:
        return {"flip": None, "flip_missing": FLIP_MISSING}
    import flip_evaluator

    pair = [np.ascontiguousarray(one.astype(np.float32) / 255) for one in (reference, given)]
    _, mean, _ = flip_evaluator.evaluate(*pair, "LDR", applyMagma=False)
    return {"flip": float(mean), "flip_missing": ""}
