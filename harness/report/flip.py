"""Where a frame is wrong and how visible that is: a map of classes beside the records, and FLIP.

FLIP (Andersson et al. 2020) measures how different two pictures look when one flips between them. Ten wrong pixels in a
million hardly change it, so it is shown beside the counts and never instead of them.
"""

import importlib.util
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from ..arrays import U8
from ..judge.context import Judge
from ..judge.score import Scored, score_answers
from ..results.pixel_maps import OFFSET, write_map, wrong_path
from .picture import shade

FLIP_MISSING = "the package flip-evaluator is not installed"


def reference_path(folder: Path, scene: str, frame: int) -> Path:
    """The file of the reference's picture of a scene's frame, on which errors are drawn."""
    return folder / "images" / f"{scene}-{frame}-reference.png"


def answered_path(folder: Path, key: str, frame: int) -> Path:
    """The file of the picture of a point's own answers, if it differs from the reference's."""
    return folder / "images" / f"{key}-{frame}-answered.png"


def keep_wrong(
    folder: Path, key: str, frame: int, judge: Judge, answers: dict[str, NDArray]
) -> tuple[Scored, dict[str, Any]]:
    """The score of a frame's answers, its map of classes written; and its FLIP, or the reason why there is none. The
    picture of the reference is saved, and that of the answers if it differs."""
    scored = score_answers(judge, answers)
    shape = (judge.moment.height, judge.moment.width)
    write_map(wrong_path(folder, key, frame), scored.classes.reshape(shape).astype(np.int64) + OFFSET)
    right, given = (picture(judge, one) for one in (judge.reference.answers(), answers))
    path = reference_path(folder, judge.prepared.scene.name, frame)
    if not path.exists():
        path.parent.mkdir(parents=True, exist_ok=True)
        Image.fromarray(right).save(path)
    if (given != right).any():
        Image.fromarray(given).save(answered_path(folder, key, frame))
    return scored, flip(right, given)


def picture(judge: Judge, answers: dict[str, NDArray]) -> U8:
    """Answers as a picture, uint8 [height, width, 3]."""
    return shade(judge.prepared, judge.moment, answers, judge.prepared.lights(judge.moment.index))


def flip(reference: U8, given: U8) -> dict[str, Any]:
    """Mean FLIP of a picture against the reference's, 0 (same) to 1; None with the reason where it is absent."""
    if importlib.util.find_spec("flip_evaluator") is None:
        return {"flip": None, "flip_missing": FLIP_MISSING}
    import flip_evaluator

    pair = [np.ascontiguousarray(one.astype(np.float32) / 255) for one in (reference, given)]
    _, mean, _ = flip_evaluator.evaluate(*pair, "LDR", applyMagma=False)
    return {"flip": float(mean), "flip_missing": ""}
