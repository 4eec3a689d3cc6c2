"""``shadowbench render``: a picture of a scene, shaded from the hits and shadow bits of one method."""

from __future__ import annotations

from pathlib import Path

from ..errors import CapacityRejected, UserError
from ..frame.devices import device_for, find_device
from ..frame.registry import make_method
from ..frame.session import Session
from ..runner.experiment import parse_size
from ..runner.machine_lock import MACHINE
from ..scene.catalogue import resolve
from ..scene.prepared import prepare
from .options import seen_as


@MACHINE.restored()
def render(
    scene: str,
    method: str,
    out: Path,
    size: str = "512x512",
    frame: int = 0,
    device: str | None = None,
    scene_dir: Path | None = None,
    settings: dict[str, str] | None = None,
    camera: tuple[str, str] | None = None,
    fov: float | None = None,
    lights: list[str] | None = None,
) -> Path:
    """Draw one frame into a PNG file, with a caption if the scene is a stand-in.

    Raises :class:`UserError` for wrong arguments, and if the method cannot trace the scene.
    """
    from ..report.gallery import captioned
    from ..report.picture import save_png, shade

    if out.suffix.lower() != ".png":
        raise UserError(f"--out {out}: pictures are PNG files; give a name ending in .png")
    width, height = parse_size(size)
    place = find_device(device)
    chosen = make_method(method, settings)
    place = device_for(type(chosen), place)
    described = seen_as(resolve(scene, scene_dir), camera, fov, lights)
    reason = chosen.applies(described, place)
    if reason:
        raise UserError(f"{method} cannot trace {scene}: {reason}; choose another --method")
    MACHINE.share()
    prepared = prepare(described)
    if not 0 <= frame < prepared.frame_count:
        raise UserError(f"--frame {frame}: {scene} has frames 0 to {prepared.frame_count - 1}")
    moment = prepared.moment(frame, width, height)
    try:
        answers = Session(chosen, prepared, width, height, place).answers(moment)
    except CapacityRejected as error:
        raise UserError(
            f"{method} on {scene}: rejected: {error}; choose a smaller --size or another --method"
        ) from error
    picture = shade(prepared, moment, answers, prepared.lights(frame))
    if described.stand_in:
        facts = f"{prepared.triangle_count:,} triangles"
        picture = captioned(picture, described.title, facts, described.stand_in)
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        save_png(picture, out)
    except OSError as error:
        raise UserError(f"{out}: cannot write ({error.strerror}); choose another --out") from error
    return out
