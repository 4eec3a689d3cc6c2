"""Score answers against the reference after timing, save them if required, and draw them. Nothing here is timed.

Separate processes do this for all methods, so that reference and referee of a frame are computed once and do not use the
memory of a method's process. If the reference is not available, the frame has no score but a reason, and its answers are
saved, so that ``shadowbench score DIR`` can score them on another machine.
"""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...files import write_arrays
from ...scene.effects import Effects
from ...scene.moment import Moment
from ...scene.prepared import Prepared
from ..machine.lock import MACHINE
from ..measuring.measured_point import Answers, hashes

NOT_REQUESTED = "not requested; shadowbench score DIR adds it"


def hand_over(path: Path, answers: Answers) -> None:
    """Write the answers of a frame for the grader: an .npz file, written atomically."""
    write_arrays(path, answers, compressed=False)


def handed_path(folder: Path, key: str, frame: int) -> Path:
    """The file in which a method's worker hands answers to the grader."""
    return folder / "journal" / f"{key}-{frame}.npz"


class Grader:
    """Scores the answers of every method to the frames of one scene with one lighting.

    scene_argument  as on the command line
    referees        by frame, from other lightings of the scene; they are used again where the mesh is the same. A mesh
                    that does not move has that of frame 0
    """

    def __init__(
        self, prepared: Prepared, moments: dict[int, Moment], scene_argument: str, folder: Path, device: str,
        referees: dict[int, Any],
    ):  # fmt: skip
        self.prepared, self.moments, self.scene_argument = prepared, moments, scene_argument
        self.folder, self.device, self.referees = folder, device, referees
        self.effects = Effects.of(prepared.scene)
        self._judges: dict[int, Any] = {}
        self._scores: dict[tuple[Any, ...], Any] = {}

    def grade(
        self, key: str, save_answers: bool, score: bool, picture: str, shows: str, wrong_maps: bool = False
    ) -> list[dict[str, Any]]:
        """The score of every frame, or the reason why there is none. The middle frame is drawn as ``picture``, unless
        there is a picture made from the same data (``shows``). ``wrong_maps``: also save a map of the wrong pixels of
        the last frame, and its FLIP difference.
        """
        from ...report.picture import scene_picture, shown_in

        frames, drawing, last = [], Path(picture), max(self.moments)
        drawn = shown_in(drawing) == shows
        handed = {frame: handed_path(self.folder, key, frame) for frame in self.moments}
        # Frames beyond the point's time budget were not measured.
        handed = {frame: path for frame, path in handed.items() if path.exists()}
        middle = [*handed][len(handed) // 2] if handed else None
        for frame, path in handed.items():
            MACHINE.give_way()
            with np.load(path) as stored:
                answers = dict(stored)
            graded: dict[str, Any] = {"frame": frame, "score": None, "unscored": NOT_REQUESTED}
            graded["hits"] = hits(answers["triangle"])
            graded["shadow_rays"] = shadow_rays(answers, self.effects)
            if score:
                graded.update(self._score(key, frame, answers, wrong_maps and frame == last))
            if save_answers or graded["score"] is None:
                self._save_answers(key, frame, answers)
            if not drawn and frame == middle:
                drawing.parent.mkdir(parents=True, exist_ok=True)
                lights = self.prepared.lights(frame)
                scene_picture(self.prepared, self.moments[frame], answers, lights, drawing, shows)
            frames.append(graded)
        # Not before: should this process be killed, another one has all frames to score.
        for path in handed.values():
            path.unlink()
        return frames

    def _score(self, key: str, frame: int, answers: Answers, wrong_map: bool) -> dict[str, Any]:
        try:
            from ...judge.context import Judge
            from ...judge.score import score_answers
            from ...report.picture import keep_wrong
            from ...results.disputes import write_disputes
        except ImportError as error:
            missing = f"no reference: {error.name or error} is not installed"
            return {"score": None, "unscored": f"{missing}; shadowbench score adds it on a machine that has it"}
        if frame not in self._judges:
            mesh = frame if self.prepared.moves else 0
            given = self.effects, self.folder / "truth", self.device, self.referees.get(mesh)
            self._judges[frame] = Judge.of(self.prepared, self.moments[frame], *given)
            self.referees[mesh] = self._judges[frame].referee
        judge = self._judges[frame]
        looks: dict[str, Any] = {}
        if wrong_map:
            scored, looks = keep_wrong(self.folder, key, frame, judge, answers)
        else:
            # Exact methods give answers with the same bits; equal answers are scored once.
            known = (frame, tuple(hashes(answers).items()))
            if known not in self._scores:
                self._scores[known] = score_answers(judge, answers)
            scored = self._scores[known]
        write_disputes(self.folder, key, frame, scored.disputes)
        return {"score": scored.score.to_json(), "unscored": None, **looks}

    def _save_answers(self, key: str, frame: int, answers: Answers) -> None:
        path = self.folder / "answers" / f"{key}-{frame}.npz"
        try:
            from ...judge.answer_files import save_raw
        except ImportError:
            # Without the packages of the reference the format of saved answers is not available: save plain arrays.
            hand_over(path, answers)
            return
        about = self.scene_argument, self.effects, {"key": key, "frame": frame}
        save_raw(path, self.prepared, self.moments[frame], answers, *about)


def hits(triangles: NDArray) -> int:
    return int(np.count_nonzero(triangles >= 0))


def shadow_rays(answers: Answers, effects: Effects) -> int:
    """Number of shadow rays of a frame: one per light with shadows and per hit of a primary or mirrored ray."""
    found = (hits(answers[name]) for name in ("triangle", "bounce_triangle") if name in answers)
    return sum(found) * sum(effects.shadows)
