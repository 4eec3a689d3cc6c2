"""The pictures of soft shadows, and their errors against the picture of very many targets."""

import itertools
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..harness.errors import CapacityRejected, UserError
from ..harness.frame.devices import placed_method
from ..harness.frame.registry import make_method
from ..harness.frame.session import Session
from ..harness.judge.receivers import facing
from ..harness.report.flip import flip
from ..harness.report.picture import captioned, shade
from ..harness.runner.machine.lock import MACHINE
from ..harness.runner.measuring.measured_point import spread_frames
from ..harness.runner.planning.experiment import Entry
from ..harness.runner.planning.run_options import Options
from ..harness.scene.overrides import Lighting
from ..harness.scene.prepared import Prepared, prepare
from ..harness.texts import numbered

SIZE = 0.08  # diameter of the light in radii of the scene: half a metre in a room six metres across

REFERENCE = 256
EXACT = "every exact method"
JUDGES = (Entry("bvh2"), Entry("two_level_grid"))
"""What the pictures of the exact methods and of the reference are made with, the first that has room for all targets;
records say whether a method answers as they do."""

Made = tuple[dict[str, NDArray], NDArray[np.uint8]]  # answers, and their picture


def targets(*counts: int) -> tuple[Lighting, ...]:
    """The first light as a sphere with the given numbers of targets."""
    return tuple(Lighting(numbered(n, "target"), count=1, size=SIZE, samples=n) for n in counts)


class Pictures:
    """Answers and pictures of one scene with a number of targets."""

    def __init__(self, prepared: Prepared, options: Options):
        self.prepared, self.device = prepared, options.device
        self.size = options.preset.width, options.preset.height
        self.frame = spread_frames(prepared.frame_count, 1)[0]

    def made(self, entry: Entry, lighting: Lighting) -> Made | None:
        """The answers and the picture; None where the method cannot trace the scene or has no room for the targets."""
        MACHINE.give_way()
        lit = lighting.applied(self.prepared)
        method, place, cannot = placed_method(entry.method, dict(entry.settings), lit.scene, self.device)
        if cannot:
            return None
        moment = lit.moment(self.frame, *self.size)
        try:
            answers = Session(method, lit, *self.size, place).answers(moment)
        except CapacityRejected:
            return None
        return answers, shade(lit, moment, answers, lit.lights(self.frame))

    def exact(self, lighting: Lighting) -> Made:
        """The exact answers and their picture."""
        for entry in JUDGES:
            if found := self.made(entry, lighting):
                return found
        raise UserError(
            f"{self.prepared.scene.name}: no exact method has room for {lighting.label}; choose a smaller --size"
        )

    def facing(self, triangle: NDArray[np.int32]) -> NDArray[np.bool_]:
        """Which pixels hit a surface that faces the middle of the light: the others get no light, whatever their bits."""
        moment = targets(1)[0].applied(self.prepared).moment(self.frame, *self.size)
        corners = moment.points[self.prepared.faces[np.maximum(triangle, 0)]]
        return (triangle >= 0) & facing(moment, corners, 0)


def share_of_light(answers: dict[str, NDArray]) -> NDArray[np.float64]:
    """The share of a light's targets that each pixel sees, float64 [pixels]."""
    lit: NDArray[np.float64] = 1.0 - answers["shadowed"].mean(axis=0)
    return lit


def errors(options: Options, name: str, found: list[tuple[str, NDArray[np.uint8]]]) -> Iterator[dict[str, Any]]:
    """A row for each number of targets and each picture: of the exact methods, and of each other method of its own.

    found  receives pictures to show side by side, with captions
    """
    pictures, lightings = Pictures(prepare(options.described(name)), options), options.preset.lightings
    reference = pictures.exact(targets(REFERENCE)[0])
    right, counted = share_of_light(reference[0]), pictures.facing(reference[0]["triangle"])
    shown = {lightings[0], lightings[len(lightings) // 2], lightings[-1]}
    ways: dict[str, Callable[[Lighting], Made | None]] = {EXACT: pictures.exact}
    for entry in options.preset.methods:
        if getattr(make_method(entry.method, dict(entry.settings)), "known_inexact", None):
            ways[entry.label] = partial(pictures.made, entry)
    for (label, make), lighting in itertools.product(ways.items(), lightings):
        if (made := make(lighting)) is None:
            continue
        off = np.abs(share_of_light(made[0]) - right)[counted]
        yield {
            "scene": pictures.prepared.scene.name, "picture": label, "targets": lighting.samples,
            "rmse": float(np.sqrt(np.mean(off**2))) if len(off) else 0.0, "largest": float(off.max(initial=0.0)),
            "flip_error": flip(reference[1], made[1])["flip"],
        }  # fmt: skip
        if lighting in shown and (label == EXACT or lighting == lightings[-1]):
            found.append((f"{label}, {lighting.label}", made[1]))
    found.append((f"reference, {REFERENCE} targets", reference[1]))


TILE = 320  # largest height of a picture in a sheet, pixels: sheets are kept with the results


def side_by_side(found: list[tuple[str, NDArray[np.uint8]]]) -> NDArray[np.uint8]:
    """Pictures with captions in one sheet, three across; large ones are shown smaller, small ones enlarged."""
    from PIL import Image

    high, wide = found[0][1].shape[:2]
    times = max(1, 256 // high)
    size = (wide * TILE // high, TILE) if high > TILE else (wide * times, high * times)
    tiles = [
        captioned(np.asarray(Image.fromarray(picture).resize(size, Image.Resampling.BOX)), "", text)
        for text, picture in found
    ]
    high = max(len(tile) for tile in tiles)
    tiles = [np.pad(tile, ((0, high - len(tile)), (0, 4), (0, 0)), constant_values=250) for tile in tiles]
    tiles += [np.full_like(tiles[0], 250)] * (-len(tiles) % 3)
    return np.vstack([np.hstack(tiles[i : i + 3]) for i in range(0, len(tiles), 3)])
