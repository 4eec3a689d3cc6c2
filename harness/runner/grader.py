"""After timing: answers scored against truth, kept where they must be, and drawn. Never part of anything timed.

One process grades for every method, so that truth and referee of a moment are made once, and so that they cost no
method's process any memory. Where truth is not to be had a frame stays unscored with the reason, and its raw answers
are kept, so that ``shadowbench score DIR`` fills the score in elsewhere.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ..files import write_arrays
from ..scene.effects import Effects
from ..scene.moment import Moment
from ..scene.prepared import Prepared
from .machine_lock import MACHINE
from .measure import Answers, hashes


def hand_over(path: Path, answers: Answers) -> None:
    """Write a frame's answers for the grader: plain .npz, atomically."""
    write_arrays(path, answers, compressed=False)


def answer_path(folder: Path, key: str, frame: int) -> Path:
    """Where the raw answers of a point's frame are kept."""
    return folder / "answers" / f"{key}-{frame}.npz"


def handed_path(folder: Path, key: str, frame: int) -> Path:
    """Where a method's worker puts the answers that the grader takes."""
    return folder / "journal" / f"{key}-{frame}.npz"


class Grader:
    """Grades the answers of every method to the moments of one scene. ``scene_argument``: as a person typed it."""

    def __init__(
        self, prepared: Prepared, moments: dict[int, Moment], scene_argument: str, folder: Path, device: str
    ):
        self.prepared, self.moments, self.scene_argument = prepared, moments, scene_argument
        self.folder, self.device = folder, device
        self.effects = Effects.of(prepared.scene)
        self._judges: dict[int, Any] = {}
        self._scores: dict[tuple[Any, ...], Any] = {}

    def grade(
        self, key: str, save_answers: bool, score: bool, picture: Path, shows: str, wrong_maps: bool = False
    ) -> list[dict[str, Any]]:
        """For every frame its score, or the reason why there is none.

        The middle one is drawn as ``picture``, unless a picture is there that was made from what ``shows`` names.
        ``wrong_maps``: where the last frame is wrong, and how different it looks, are kept too.
        """
        from ..report.picture import shown_in

        frames = []
        last = list(self.moments)[-1]
        # Frames beyond the point's budget were left out.
        drawn = shown_in(picture) == shows
        there = [frame for frame in self.moments if handed_path(self.folder, key, frame).exists()]
        for frame in there:
            MACHINE.give_way()
            handed = handed_path(self.folder, key, frame)
            with np.load(handed) as stored:
                answers = {name: stored[name] for name in stored.files}
            unscored = "not asked for; shadowbench score DIR fills it in"
            graded: dict[str, Any] = {"frame": frame, "score": None, "unscored": unscored}
            graded["shadow_rays"] = shadow_rays(answers, self.effects)
            if score:
                graded.update(self._score(key, frame, answers, wrong_maps and frame == last))
            if save_answers or graded["score"] is None:
                self._keep(key, frame, answers)
            if not drawn and frame == there[len(there) // 2]:
                draw_picture(self.prepared, self.moments[frame], answers, picture, shows)
            handed.unlink()
            frames.append(graded)
        return frames

    def _score(self, key: str, frame: int, answers: Answers, wrong_map: bool) -> dict[str, Any]:
        try:
            from ..judge.context import Judge
            from ..judge.score import score_answers
            from ..report.flip import keep_wrong
            from ..results.settle import keep_disputes
        except ImportError as error:
            missing = error.name or str(error)
            reason = f"no truth here, {missing} is not installed; shadowbench score fills it in where it is"
            return {"score": None, "unscored": reason}
        if frame not in self._judges:
            truth = self.folder / "truth"
            self._judges[frame] = Judge.of(
                self.prepared, self.moments[frame], self.effects, truth, self.device
            )
        judge = self._judges[frame]
        looks: dict[str, Any] = {}
        if wrong_map:
            scored, looks = keep_wrong(self.folder, key, frame, judge, answers)
        else:
            # Methods that are exact answer bit for bit the same: what was judged once is not judged again.
            known = (frame, tuple(hashes(answers).items()))
            if known not in self._scores:
                self._scores[known] = score_answers(judge, answers)
            scored = self._scores[known]
        keep_disputes(self.folder, key, frame, scored.disputes)
        return {"score": scored.score.to_json(), "unscored": None, **looks}

    def _keep(self, key: str, frame: int, answers: Answers) -> None:
        try:
            from ..judge.answer_files import save_raw
        except ImportError:
            # Without truth's packages the raw format cannot be made either; the arrays themselves are kept.
            hand_over(answer_path(self.folder, key, frame), answers)
            return
        path = answer_path(self.folder, key, frame)
        extra = {"key": key, "frame": frame}
        save_raw(path, self.prepared, self.moments[frame], answers, self.scene_argument, self.effects, extra)


def shadow_rays(answers: Answers, effects: Effects) -> int:
    """Shadow rays of a frame: one a light that asks for shadows and a pixel whose ray, or mirrored ray, hits something."""
    hits = int(np.count_nonzero(answers["triangle"] >= 0))
    if "bounce_triangle" in answers:
        hits += int(np.count_nonzero(answers["bounce_triangle"] >= 0))
    return hits * sum(effects.shadows)


def draw_picture(prepared: Prepared, moment: Moment, answers: Answers, path: Path, shows: str) -> None:
    """The frame as a picture with its shadows and a caption that says if the scene is a stand-in."""
    from ..report.gallery import scene_picture

    path.parent.mkdir(parents=True, exist_ok=True)
    scene_picture(prepared, moment, answers, prepared.lights(moment.index), path, shows)
