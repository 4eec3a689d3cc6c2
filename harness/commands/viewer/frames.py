"""Frames on demand: the camera and the light as placed on the page; only what changed is traced again."""

from __future__ import annotations

import io
import time
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray
from PIL import Image

from ...errors import CapacityRejected, UserError
from ...files import array_hash
from ...frame.devices import device_for
from ...frame.registry import make_method, method_class, method_names
from ...frame.schedule.passes import Pass, run_passes
from ...frame.session import Session
from ...runner.machine.lock import MACHINE
from ...scene.light_paths import vector
from ...scene.moment import Moment
from ...scene.prepared import Prepared
from ...scene.scene import Camera, Light
from .orbit import turned

JUDGED = 2000
"""Largest number of disputed pixels of a frame that the exact referee decides."""

COLOURS = ("shaded", "tests")


@dataclass(frozen=True)
class Wish:
    """The requested view. Angles in degrees, relative to the scene's own camera and light.

    method  name                      frame  of an animation
    camera, light  (azimuth, elevation, distance as a factor)
    show    "shaded", or "tests": tests of each primary ray as a heat map
    judge   whether the answers are compared with the exact reference
    """

    method: str
    frame: int = 0
    camera: tuple[float, float, float] = (0.0, 0.0, 1.0)
    light: tuple[float, float, float] = (0.0, 0.0, 1.0)
    show: str = "shaded"
    judge: bool = False

    @staticmethod
    def read(facts: Any) -> Wish:
        """From JSON. Raises ValueError for an invalid request."""
        if not isinstance(facts, dict):
            raise ValueError("not an object")
        wish = Wish(
            str(facts.get("method", "")),
            int(facts.get("frame", 0)),
            _place(facts.get("camera", (0, 0, 1))),
            _place(facts.get("light", (0, 0, 1))),
            str(facts.get("show", "shaded")),
            facts.get("judge") is True,
        )
        if wish.show not in COLOURS:
            raise ValueError(f"show is one of {', '.join(COLOURS)}")
        return wish


def _place(values: Any) -> tuple[float, float, float]:
    azimuth, elevation, scale = (float(value) for value in values)
    if not np.isfinite([azimuth, elevation]).all() or not 1e-3 <= scale <= 1e3:
        raise ValueError(f"no place: {values}")
    return azimuth, elevation, scale


class TimedSession(Session):
    """A session that notes how long each pass of the last frame took: the clock around it, milliseconds.

    For display only: each pass is waited for before the next one begins, so nothing runs concurrently.
    """

    def run(self) -> None:
        self.took: dict[str, float] = {}
        with wp.ScopedDevice(self.device):
            for work in self.passes:
                start = time.perf_counter()
                run_passes([work])
                wp.synchronize_device(self.device)
                self.took[work.name] = (time.perf_counter() - start) * 1e3

    def stages(self) -> list[dict[str, Any]]:
        """Every pass of a complete frame: its name, its column, and its time; None where it did not run again."""

        def row(work: Pass) -> dict[str, Any]:
            return {"name": work.name, "part": work.part, "ms": self.took.get(work.name)}

        return [row(work) for work in self.all_passes]


class Frames:
    """The frames of one scene at one size. Not for several threads at once."""

    def __init__(self, prepared: Prepared, width: int, height: int, device: str):
        self.prepared = prepared
        self.width, self.height = width, height
        self.device = device
        self._method = ""
        self._session: TimedSession | None = None

    def methods(self) -> list[dict[str, str]]:
        """Every method, with the reason if it cannot trace the scene here."""
        rows = []
        for name in method_names():
            try:
                kind = method_class(name)
                reason = make_method(name).applies(self.prepared.scene, device_for(kind, self.device))
                rows.append({"name": name, "title": kind.title, "reason": reason or ""})
            except Exception as error:  # one broken method must not hide the others
                rows.append({"name": name, "title": name, "reason": " ".join(str(error).split())})
        return rows

    def session(self, method: str) -> TimedSession:
        """The session of a method. Raises :class:`UserError` if it cannot trace the scene."""
        if method != self._method or self._session is None:
            chosen = make_method(method)
            place = device_for(type(chosen), self.device)
            reason = chosen.applies(self.prepared.scene, place)
            if reason:
                raise UserError(f"{method}: {reason}")
            self._session = None  # the memory of the last method is free before the next one takes its own
            self._session = TimedSession(chosen, self.prepared, self.width, self.height, place)
            self._method = method
        return self._session

    def camera(self, wish: Wish) -> Camera:
        """The scene's camera, turned about its target."""
        known = self.prepared.scene.camera
        return replace(known, eye=turned(known.eye, known.target, known.up, *wish.camera))

    def lights(self, wish: Wish, frame: int) -> tuple[Light, ...]:
        """The lights of a frame, the first one turned about the scene's middle; a directional one's way to it."""
        lights = self.prepared.lights(frame)
        if not lights:
            return lights
        first, up = lights[0], self.prepared.scene.camera.up
        middle = vector(self.prepared.middle + self.prepared.centre)
        centre = (0.0, 0.0, 0.0) if first.directional else middle
        return (first.moved(turned(first.position, centre, up, *wish.light)), *lights[1:])

    def show(self, wish: Wish) -> tuple[dict[str, Any], bytes]:
        """The facts of a frame and its picture as lossless WebP. Raises :class:`UserError` if the method cannot make it."""
        from ...report.picture import shade

        with MACHINE.shared():  # a run that measures has priority
            session = self.session(wish.method)
            frame = wish.frame % self.prepared.frame_count
            camera, lights = self.camera(wish), self.lights(wish, frame)
            moment = self.prepared.moment(frame, self.width, self.height, camera, lights)
            start = time.perf_counter()
            try:
                changed = session.advance(moment)
            except CapacityRejected as error:
                raise UserError(f"{wish.method}: rejected: {error}") from error
            whole = (time.perf_counter() - start) * 1e3
            answers = session.frame.answers.to_host()
            facts: dict[str, Any] = {
                "method": wish.method, "frame": frame, "changed": sorted(changed), "ms": whole,
                "stages": session.stages(), "answers": array_hash(answers["triangle"], answers["shadowed"]),
                "eye": list(camera.eye), "target": list(camera.target),
                "light": list(lights[0].position) if lights else None,
            }  # fmt: skip
            picture = shade(self.prepared, moment, answers, lights)
            if wish.show == "tests":
                heat, facts["tests"] = self._heat(session, moment)
                picture = picture if heat is None else heat
            if wish.judge:
                facts["wrong"] = self._mark_wrong(moment, answers, picture)
        return facts, webp(picture)

    def _heat(
        self, session: TimedSession, moment: Moment
    ) -> tuple[NDArray[np.uint8] | None, dict[str, Any] | None]:
        """The heat map of a method that counts its tests, and its scale; None where it does not count them."""
        import matplotlib

        count = getattr(session.method, "tests_per_pixel", None)
        if count is None:
            return None, None
        counts = np.asarray(count()[0]).reshape(moment.height, moment.width)
        most = int(counts.max(initial=0))
        colours = matplotlib.colormaps["viridis"](counts / max(1, most))[..., :3]
        return (colours * 255).round().astype(np.uint8), {"most": most, "mean": float(counts.mean())}

    def _mark_wrong(
        self, moment: Moment, answers: dict[str, NDArray], picture: NDArray[np.uint8]
    ) -> dict[str, Any]:
        """Mark the wrong pixels of the picture in red, and count them by class."""
        from ...judge.context import Judge
        from ...judge.score import gravest_classes, judge_frame
        from ...judge.verdict import ERRORS, Verdict

        judge = replace(Judge.of(self.prepared, moment), limit=JUDGED)
        classes = gravest_classes(judge_frame(judge, answers)).reshape(moment.height, moment.width)
        picture[np.isin(classes, ERRORS)] = (235, 0, 40)
        counts = {kind.label: int((classes == kind).sum()) for kind in Verdict if kind in ERRORS}
        return {
            "classes": {name: count for name, count in counts.items() if count},
            "unjudged": int((classes == -1).sum()),
            "pixels": int(classes.size),
        }


def webp(picture: NDArray[np.uint8]) -> bytes:
    """The picture, uint8 [height, width, 3], as lossless WebP: what is on the page has the bits of the frame."""
    buffer = io.BytesIO()
    Image.fromarray(np.ascontiguousarray(picture)).save(buffer, "WEBP", lossless=True, quality=20, method=0)
    return buffer.getvalue()
