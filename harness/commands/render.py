"""``shadowbench render``: pictures of a scene, shaded from the hits and shadow bits of one method."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ..arrays import U8
from ..errors import CapacityRejected, UserError, say, warn, writing
from ..frame.devices import find_device, placed_method
from ..frame.session import Session
from ..report.picture import beside, captioned, check_animation, save_png, save_webp, shade
from ..runner.machine.lock import MACHINE
from ..runner.planning.experiment import parse_size
from ..scene.chosen_view import ChosenView
from ..scene.facts import never_hit, triangles
from ..scene.light_paths import Orbit, vector
from ..scene.prepared import Prepared, prepare, under
from ..scene.scene import Scene
from .answering import default_method, require_frame, settings_by_method
from .options import ONE_METHOD, command, number_or_frames

SECONDS, MOST_SECONDS = 4.0, 3600.0  # length of an animation whose file does not say its rate, and of any at most
PLACES = 48  # number of places of the light around a scene that does not move, without `--frames`


@dataclass(frozen=True, eq=False)
class Renderer:
    """Pictures of one scene from the answers of one method, at one size. Made by :func:`opened`."""

    scene: str
    method: str
    prepared: Prepared
    session: Session
    size: tuple[int, int]

    def picture(self, frame: int) -> U8:
        """The picture of a frame, uint8 [height, width, 3]; a stand-in gets a caption that names it as one."""
        moment = self.prepared.moment(frame, *self.size)
        try:
            answers = self.session.answers(moment)
        except CapacityRejected as error:
            raise UserError(
                f"{self.method} on {self.scene}: rejected: {error}; choose a smaller --size or another --method"
            ) from error
        unseen = never_hit(len(moment.valid), int(np.count_nonzero(moment.valid)))
        if unseen is not None and unseen.warns:
            warn(f"{self.scene}: {unseen.fact}")
        picture = shade(self.prepared, moment, answers, self.prepared.lights(frame))
        described = self.prepared.scene
        if described.stand_in:
            facts = triangles(self.prepared.triangle_count)
            picture = captioned(picture, described.title, facts, described.stand_in)
        return picture


def opened(
    scene: str, described: Scene, method: str | None, size: tuple[int, int], device: str | None,
    settings: Mapping[str, dict[str, str]] | None = None, turning: int = 0,
) -> Renderer:  # fmt: skip
    """A scene prepared for pictures with a method, by default the :func:`.default_method.default_method`.

    settings  parameters by method
    turning   places of the light where nothing moves; 0: it is still

    Raises :class:`UserError` if the method cannot trace the scene, and for settings of another one.
    """
    place = find_device(device)
    method = method or default_method(described, place)
    if others := set(settings or ()) - {method}:
        raise UserError(
            f"--set {min(others)}: {method} traces the picture; give --method {min(others)}, or leave it out"
        )
    chosen, place, reason = placed_method(method, (settings or {}).get(method), described, place)
    if reason:
        raise UserError(f"{method} cannot trace {scene}: {reason}; choose another --method")
    MACHINE.share_beside(place)
    prepared = with_turning_light(described, turning) if turning else prepare(described)
    try:
        session = Session(chosen, prepared, *size, place)
    except CapacityRejected as error:
        raise UserError(f"{method} on {scene}: rejected: {error}; choose a smaller --size") from error
    return Renderer(scene, method, prepared, session, size)


def with_turning_light(described: Scene, places: int) -> Prepared:
    """The scene prepared. One that does not move becomes an animation: its lights turn once about its middle, evenly.

    They turn about the camera's upward axis; the step after the last frame would be the first frame.
    """
    geometry = described.geometry()
    prepared = prepare(replace(described, geometry=lambda: geometry.lasting(places)))
    if geometry.frame_count > 1:
        return prepared
    middle = vector(prepared.middle + prepared.centre)
    path = Orbit(middle, described.camera.up, (places - 1) / places)
    return under(prepared, replace(prepared.scene, light_path=path))


@command(
    f"""
    Render a picture or an animation of a scene.
    shadowbench render cloth --out cloth.png --size 512x512

    scene                   Name of a scene, or a mesh file. With --animate there may be several, side by side.
    --method NAME           {ONE_METHOD}
    --out PATH              PNG file to write; its folder is created if missing.
    --animate FILE          WebP file to write instead: every frame, or of a still scene a turn of its lights.
    --frames N or A:B:STEP  Number of frames of the animation. Default: all. With colons: of an animated file the first
                            frame, the last and the step, counted from 0.
    --seconds SECONDS       Length of the animation. Default: as the file says, else 4.
    """
)
def render(
    scene: list[str], method: str | None = None, out: Path | None = None, animation: Path | None = None,
    size: str = "512x512", frame: int = 0, frames: str | None = None, seconds: float | None = None,
    setting: list[str] | None = None, device: str | None = None, scene_dir: Path | None = None, *, view: ChosenView,
) -> int:  # fmt: skip
    """Render a scene from the hits and shadow bits that a method finds.

    The picture of a stand-in scene has a caption that says so.
    """
    settings = settings_by_method(setting)
    count, seen = number_or_frames(frames, view)

    def renderer(name: str, turning: int = 0) -> Renderer:
        described = seen.resolved(name, scene_dir)
        return opened(name, described, method, parse_size(size), device, settings, turning)

    if (out is None) == (animation is None):
        raise UserError("render: give --out FILE.png for a picture, or --animate FILE.webp for an animation")
    if animation is not None:
        picture = animated(scene, renderer, animation, parse_size(size), count, seconds)
    else:
        assert out is not None
        if len(scene) > 1:
            raise UserError(f"render {' '.join(scene)}: --out shows one scene; --animate shows several")
        if out.suffix.lower() != ".png":
            raise UserError(f"--out {out}: pictures are PNG files; give a name ending in .png")
        out = out.absolute()  # a method may go to another folder
        shown = renderer(scene[0])
        require_frame(shown.prepared, frame, scene[0])
        with writing(out, "choose another --out"):
            picture = save_png(shown.picture(frame), out)
    say(f"written: {picture}")
    return 0


def animated(
    scenes: list[str], renderer: Callable[[str, int], Renderer], out: Path, size: tuple[int, int], frames: int | None,
    seconds: float | None,
) -> Path:  # fmt: skip
    """Draw the frames of scenes into one looping WebP file; several scenes stand side by side.

    Of a scene that does not move, the lights turn once about its middle. ``frames``: so many, evenly spread over an
    animation; default: every frame of the longest, or :data:`PLACES` where nothing moves.
    """
    if out.suffix.lower() != ".webp":
        raise UserError(f"--animate {out}: animations are WebP files; give a name ending in .webp")
    if frames is not None and frames < 2:
        raise UserError(f"--frames {frames}: an animation has at least 2")
    if seconds is not None and not 0.0 < seconds < MOST_SECONDS:
        raise UserError(f"--seconds {seconds:g}: give a number between 0 and 3600")
    out = out.absolute()
    width, height = size
    check_animation(width * len(scenes), height, frames or 2)
    shown = [renderer(name, frames or PLACES) for name in scenes]
    count = frames or max(one.prepared.frame_count for one in shown)
    check_animation(width * len(shown), height, count)
    pictures = [
        beside([one.picture(frame) for one, frame in zip(shown, places, strict=True)])
        for places in zip(*(spread(one.prepared.frame_count, count) for one in shown), strict=True)
    ]
    with writing(out, "choose another --animate"):
        return save_webp(pictures, out, seconds or playing_time(shown[0].prepared))


def playing_time(prepared: Prepared) -> float:
    """Seconds of an animation: as its file says, else :data:`SECONDS`."""
    rate = prepared.scene.rate
    return min(prepared.frame_count / rate, MOST_SECONDS) if rate and prepared.frame_count > 1 else SECONDS


def spread(available: int, wanted: int) -> list[int]:
    """``wanted`` frames evenly spread over ``available`` ones, first and last included."""
    return [int(frame) for frame in np.linspace(0, available - 1, wanted).round()]
