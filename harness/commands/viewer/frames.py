"""Frames on demand: the camera and the light as placed on the page; only what changed is traced again."""

import io
import re
import time
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray
from PIL import Image

from ...arrays import U8
from ...errors import CapacityRejected, UserError, one_line
from ...files import array_hash
from ...frame.devices import placed_method
from ...frame.registry import about, method_names
from ...frame.schedule.passes import run_passes
from ...frame.session import Session
from ...runner.machine.lock import MACHINE
from ...scene.chosen_view import ChosenView
from ...scene.moment import Moment
from ...scene.prepared import Prepared, finite_bounds, under
from ...scene.scene import FARTHEST, Camera, Light, Vector
from ...scene.targets import with_area
from ..listing import place_text

JUDGED = 2000  # largest number of disputed pixels of a frame that the exact referee decides
LARGEST = 1 << 22  # pixels of a frame on the page

COLOURS = ("shaded", "tests")


@dataclass(frozen=True)
class Wish:
    """The requested frame, as the page sends it in JSON. Raises ValueError for an invalid request.

    method  name                      beside  name of the method whose frame is shown beside it, or ""
    frame   of an animation           size    pixels, width and height
    camera  eye and target, or None: the scene's
    light   place of the first light (of a directional one the way to it), or None: the scene's, which may move
    area    size of every light and number of its targets, or None: as the scene has them
    show    "shaded", or "tests": tests of each primary ray as a heat map
    judge   whether the answers are compared with the reference
    again   whether every pass runs, although nothing has changed
    """

    method: str
    size: tuple[int, int]
    beside: str = ""
    frame: int = 0
    camera: tuple[Vector, Vector] | None = None
    light: Vector | None = None
    area: tuple[float, int] | None = None
    show: str = "shaded"
    judge: bool = False
    again: bool = False

    def __post_init__(self) -> None:
        if self.show not in COLOURS:
            raise ValueError(f"show is one of {', '.join(COLOURS)}")
        if len(self.size) != 2 or min(self.size) < 1 or self.size[0] * self.size[1] > LARGEST:
            raise ValueError(f"size {'x'.join(map(str, self.size))}: width and height, 1 to {LARGEST:,} pixels")
        for place in (*(self.camera or ()), *([self.light] if self.light is not None else ())):
            if len(place) != 3 or not all(abs(value) <= FARTHEST for value in place):
                raise ValueError(f"no place: {place}")
        if self.camera is not None and len(self.camera) != 2:
            raise ValueError("camera: give its eye and its target")
        if self.area is not None and (len(self.area) != 2 or not isinstance(self.area[1], int)):
            raise ValueError("area: give its size and a whole number of targets")


class TimedSession(Session):
    """A session that notes how long each pass took when it ran last: the clock around it, milliseconds.

    For display only: each pass is waited for before the next one begins, so nothing runs concurrently.

    took  milliseconds by pass      runs  how often each pass has run: the first time its kernels are loaded
    ran   passes of the last frame
    """

    def __init__(self, *given: Any):
        super().__init__(*given)
        self.took: dict[str, float] = {}
        self.runs: Counter[str] = Counter()
        self.ran: set[str] = set()

    def run(self) -> None:
        with wp.ScopedDevice(self.device):
            for work in self.passes:
                start = time.perf_counter()
                run_passes([work])
                wp.synchronize_device(self.device)
                self.took[work.name] = (time.perf_counter() - start) * 1e3
                self.ran.add(work.name)
        self.runs.update({work.name for work in self.passes})

    def stages(self) -> list[dict[str, Any]]:
        """Every pass of a complete frame: its name, its column, the time of its last run, whether it ran in this frame,
        and whether that time is of its first run. Passes of the targets of areas are taken together.
        """
        areas = any(light.shape for light in self.frame.prepared.scene.lights)
        rows: dict[str, dict[str, Any]] = {}
        parts = (
            part for work in self.all_passes for part in (work, *work.apart) if part is work or self.runs[part.name]
        )
        for work in parts:
            name = re.sub(r"^light \d+", "targets", work.name) if areas else work.name
            took, first = self.took.get(work.name), self.runs[work.name] < 2
            row = rows.setdefault(name, {"name": name, "part": work.part, "ms": None, "ran": False, "first": False})
            if took is not None:
                row["ms"] = (row["ms"] or 0.0) + took
            row["ran"] |= work.name in self.ran
            row["first"] |= first
        return list(rows.values())


class Frames:
    """The frames of one scene. Not for several threads at once.

    settings  parameters of each method that has some, as texts
    """

    def __init__(self, prepared: Prepared, device: str, settings: Mapping[str, dict[str, str]] | None = None):
        self.prepared = prepared
        self.device = device
        self.settings = settings or {}
        self._sessions: dict[str, TimedSession] = {}
        self._lit: dict[int, Prepared] = {}

    def box(self) -> tuple[list[float], list[float]]:
        """The lowest and the highest corner of the first frame, in scene coordinates."""
        low, high = finite_bounds(self.prepared.points(0)[0].astype(np.float64))
        return (low + self.prepared.centre).tolist(), (high + self.prepared.centre).tolist()

    def methods(self) -> list[dict[str, Any]]:
        """Every method, with the reason if it cannot trace the scene here, and whether it counts its tests."""
        rows = []
        for name in method_names():
            try:
                made, _, reason = placed_method(name, self.settings.get(name), self.prepared.scene, self.device)
                counts = hasattr(made, "tests_per_pixel")
                rows.append({"name": name, "title": about(name), "reason": reason or "", "counts": counts})
            except Exception as error:  # one broken method must not hide the others
                reason = one_line(error)
                rows.append({"name": name, "title": name, "reason": reason, "counts": False})
        return rows

    def session(self, wish: Wish) -> TimedSession:
        """The session of a method at a size. Raises :class:`UserError` if it cannot trace the scene."""
        shown, prepared = (wish.method, wish.beside), self.lit(wish)
        # The memory of what is not shown any more is free before more is taken.
        self._sessions = {
            name: one
            for name, one in self._sessions.items()
            if name in shown and (one.frame.width, one.frame.height) == wish.size and one.frame.prepared is prepared
        }
        if wish.method not in self._sessions:
            settings = self.settings.get(wish.method)
            made, place, reason = placed_method(wish.method, settings, self.prepared.scene, self.device)
            if reason:
                raise UserError(f"{wish.method}: {reason}")
            self._sessions[wish.method] = TimedSession(made, prepared, *wish.size, place)
        return self._sessions[wish.method]

    def camera(self, wish: Wish) -> Camera:
        """The scene's camera, or one like it at the wished place, as ``--camera`` has it."""
        return ChosenView(camera=wish.camera).applied(self.prepared.scene).camera

    def lights(self, wish: Wish, frame: int) -> tuple[Light, ...]:
        """The lights of a frame, the first one at the wished place, with the wished area."""
        lights = self.prepared.lights(frame)
        if lights and wish.light:
            lights = (lights[0].moved(wish.light), *lights[1:])
        return tuple(with_area(light, None, *(wish.area or (None, None))) for light in lights)

    def lit(self, wish: Wish) -> Prepared:
        """The scene with as many targets as are wished: one for each number, as what is cached for it belongs to it."""
        if wish.area is None:
            return self.prepared
        if wish.area[1] not in self._lit:
            scene = replace(self.prepared.scene, lights=self.lights(wish, 0), light_path=None)
            self._lit[wish.area[1]] = under(self.prepared, scene)
        return self._lit[wish.area[1]]

    def show(self, wish: Wish) -> tuple[dict[str, Any], bytes]:
        """The facts of a frame and its picture as lossless WebP. Raises :class:`UserError` if the method cannot make it."""
        from ...report.picture import shade

        MACHINE.share_beside(self.device)
        try:
            session = self.session(wish)
            frame = wish.frame % self.prepared.frame_count
            camera, lights = self.camera(wish), self.lights(wish, frame)
            prepared = self.lit(wish)
            moment = prepared.moment(frame, *wish.size, camera, lights)
            if wish.again:
                session.made = None
            session.ran.clear()
            try:
                changed = session.advance(moment)
            except CapacityRejected as error:
                raise UserError(f"{wish.method}: rejected: {error}") from error
            answers = session.frame.answers.to_host()
            facts: dict[str, Any] = {
                "method": wish.method, "frame": frame, "size": list(wish.size), "changed": sorted(changed),
                "stages": session.stages(), "answers": array_hash(answers["triangle"], answers["shadowed"]),
                "eye": list(camera.eye), "target": list(camera.target), "up": list(camera.up),
                "light": list(lights[0].position) if lights else None,
                "directional": bool(lights) and lights[0].directional, "options": options(wish, camera, lights),
                "missed": int((answers["triangle"] < 0).sum()), "counts": hasattr(session.method, "tests_per_pixel"),
            }  # fmt: skip
            picture = shade(prepared, moment, answers, lights)
            if wish.show == "tests" and facts["counts"]:
                picture, facts["tests"] = heat(session.method, moment)
            if wish.judge:
                facts["wrong"] = mark_wrong(prepared, moment, answers, picture)
        finally:
            MACHINE.release()
        return facts, webp(picture)


def mark_wrong(prepared: Prepared, moment: Moment, answers: dict[str, NDArray], picture: U8) -> dict[str, Any]:
    """Mark the wrong pixels of the picture in red, and count them by class."""
    from ...judge.context import Judge
    from ...judge.score import gravest_classes, judge_frame
    from ...judge.verdict import ERRORS, Verdict

    judge = replace(Judge.of(prepared, moment), limit=JUDGED)
    classes = gravest_classes(judge_frame(judge, answers)).reshape(moment.height, moment.width)
    picture[np.isin(classes, ERRORS)] = (235, 0, 40)
    counts = {kind.label: int((classes == kind).sum()) for kind in Verdict if kind in ERRORS}
    return {
        "classes": {name: count for name, count in counts.items() if count},
        "unjudged": int((classes == -1).sum()),
        "pixels": int(classes.size),
    }


def options(wish: Wish, camera: Camera, lights: tuple[Light, ...]) -> str:
    """The options that give a command the camera of a frame, and its lights where ``--light`` gives the same, or one was
    moved. ``--light`` gives point lights: a directional light or a spotlight has no such option.
    """
    words = [f"--camera {place_text(camera.eye, exact=True)} {place_text(camera.target, exact=True)}"]
    points = tuple(replace(light, shape="", size=0.0, samples=1) for light in lights) if wish.area else lights
    same = all(light == Light(light.position) for light in points)
    if same or (wish.light and not any(light.directional or light.spot for light in lights)):
        words += [f"--light {place_text(light.position, exact=True)}" for light in lights]
    if wish.area:
        words.append(f"--light-size {wish.area[0]!r} --light-samples {wish.area[1]}")
    return " ".join(words)


def heat(method: Any, moment: Moment) -> tuple[U8, dict[str, Any]]:
    """The tests of each primary ray of a method that counts them as a picture, and its scale: a logarithm, since the most
    is many times what is usual. ``half``: the tests of the colour in the middle.
    """
    import matplotlib

    counts = np.asarray(method.tests_per_pixel()[0]).reshape(moment.height, moment.width)
    most = int(counts.max(initial=0))
    colours = matplotlib.colormaps["viridis"](np.log1p(counts) / max(1.0, np.log1p(most)))[..., :3]
    half = float(np.expm1(np.log1p(most) / 2))
    return (colours * 255).round().astype(np.uint8), {"most": most, "half": half, "mean": float(counts.mean())}


def webp(picture: U8) -> bytes:
    """The picture, uint8 [height, width, 3], as lossless WebP: what is on the page has the bits of the frame."""
    buffer = io.BytesIO()
    Image.fromarray(np.ascontiguousarray(picture)).save(buffer, "WEBP", lossless=True, quality=20, method=0)
    return buffer.getvalue()
