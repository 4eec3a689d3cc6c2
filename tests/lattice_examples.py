"""Examples for property tests and fuzzing, decoded from bytes: a mesh, a camera, lights and settings of every method.

Coordinates are integers below 2^15 times a power of two, and coarse more often than not: rays of the pixels then
meet vertices, edges and cell boundaries exactly, again and again. Shorter bytes and smaller bytes give simpler
examples, so that a failure shrinks; bytes beyond the end read as 0.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from shadowbench.harness.alpha import perforated
from shadowbench.harness.errors import CapacityRejected
from shadowbench.harness.hardcases.case import Counts, HardCase, Trial
from shadowbench.harness.hardcases.judge import ERRORS, Judged, same_bits
from shadowbench.harness.method import Method
from shadowbench.harness.moment import Prepared
from shadowbench.harness.registry import make_method
from shadowbench.harness.scene import Camera, Geometry, Light, Scene
from shadowbench.harness.session import Session

LENGTH = 400
"""Bytes that an example reads at most."""

UNIT = 2.0**-12

CHOICES: dict[str, dict[str, tuple[str, ...]]] = {
    "perspective_spherical": {
        "tile": ("8", "1", "3", "5"),
        "slices": ("16", "1", "3"),
        "light_tiles": ("16", "1", "7", "64"),
        "light_slices": ("16", "1", "3"),
        "depth_lists": ("spans", "nearest"),
        "light_map": ("azimuth-elevation", "two-angle", "cube"),
        "aimed": ("true", "false"),
        "clamp": ("hits", "view", "none", "scene"),
        "skip_empty": ("true", "false"),
        "k": ("2", "1", "3"),
        "r": ("64", "1", "5"),
        "balancing": ("direct", "algorithm-1"),
        "sort": ("counting", "radix"),
        "precision": ("float64", "float32", "float32-centred"),
        "triangle_chunk": (*("0",) * 14, "1", "3"),  # the chunked kernels take ten times as long
    },
    "uniform_grid": {"density": ("4.0", "0.1", "40.0", "700.0"), "swizzle": ("true", "false")},
    "ray_grids": {
        "queue": ("never", "always"),
        "cells": ("0", "8", "16", "64"),
        "inline_cells": ("64", "0", "4"),
        "inline_rays": ("48", "0", "3"),
        "shares": ("1", "2", "3"),
        "beside": ("1", "2"),
    },
    "bvh": {"leaf_size": ("0", "2", "8"), "swizzle": ("true", "false")},
}
"""Settings that must change no answer: the first of each is the plainest."""

ALWAYS = {"bvh": {"update": "bvh_rebuild"}}
"""What makes a method exact."""

METHODS = tuple(CHOICES)


class Bytes:
    """Reads numbers from bytes; zeros beyond the end."""

    def __init__(self, data: bytes):
        self.data, self.place = data, 0

    def take(self, count: int) -> NDArray[np.int64]:
        part = self.data[self.place : self.place + count]
        self.place += count
        return np.frombuffer(part.ljust(count, b"\0"), dtype=np.uint8).astype(np.int64)

    def below(self, limit: int) -> int:
        return int(self.take(1)[0]) % limit

    def choice(self, values: Sequence[Any]) -> Any:
        return values[self.below(len(values))]

    def coordinates(self, count: int) -> NDArray[np.int64]:
        """Lattice points [count, 3], |k| < 2^15: multiples of a coarse step, with a finer part now and then."""
        step, fine = self.choice((2048, 4096, 1024, 512, 8192, 256)), self.below(8)
        coarse = (self.take(3 * count) + 128) % 256 - 128  # 0 stays 0
        points = coarse.reshape(count, 3) * step
        if fine == 7:
            points += self.take(3 * count).reshape(count, 3) - 128
        return (points + 2**15 - 1) % (2**16 - 1) - (2**15 - 1)


@dataclass(frozen=True)
class Calls:
    """What the scene calls for. ``every``: so many-th triangle has ``holes`` along a side; 0: none has."""

    facing: bool = False
    directional: bool = False
    every: int = 0
    holes: int = 1


@dataclass(frozen=True, eq=False)
class Example:
    """``points`` float64 [n, 3], exact in float32; ``lights`` [m, 3]; ``settings`` of each method."""

    points: NDArray[np.float64]
    faces: NDArray[np.int32]
    camera: Camera
    lights: NDArray[np.float64]
    size: tuple[int, int]
    settings: dict[str, dict[str, str]]
    calls: Calls = Calls()

    def trial(self) -> Trial:
        points, faces, calls = self.points, self.faces, self.calls
        lights = tuple(
            Light((x, y, z), directional=calls.directional and (x, y, z) != (0, 0, 0))
            for x, y, z in self.lights.tolist()
        )
        scene = Scene("lattice", "Lattice", lambda: Geometry.static(points, faces), self.camera, lights)
        if calls.every:
            scene = replace(scene, alpha=lambda geometry: perforated(geometry, calls.every, calls.holes))
        prepared = Prepared(replace(scene, facing=calls.facing))
        return Trial(prepared, prepared.moment(0, *self.size), Counts(), watertight=not calls.every)

    def with_geometry(self, points: NDArray, faces: NDArray) -> Example:
        return replace(self, points=np.asarray(points, dtype=np.float64), faces=np.asarray(faces, np.int32))

    def frozen(self) -> dict[str, Any]:
        """As JSON holds it: floats in hexadecimal."""
        camera = self.camera
        return {
            "points": hexes(self.points),
            "faces": self.faces.tolist(),
            "camera": {
                "eye": hexes(camera.eye),
                "target": hexes(camera.target),
                "up": hexes(camera.up),
                "fov": camera.fov.hex(),
            },
            "lights": hexes(self.lights),
            "size": list(self.size),
            "settings": self.settings,
            "calls": asdict(self.calls),
        }

    @staticmethod
    def thawed(facts: dict[str, Any]) -> Example:
        camera = facts["camera"]
        eye, target, up = (tuple(floats(camera[name]).tolist()) for name in ("eye", "target", "up"))
        return Example(
            floats(facts["points"]).reshape(-1, 3),
            np.array(facts["faces"], dtype=np.int32).reshape(-1, 3),
            Camera(eye, target, up, float.fromhex(camera["fov"])),
            floats(facts["lights"]).reshape(-1, 3),
            (facts["size"][0], facts["size"][1]),
            facts["settings"],
            Calls(**facts.get("calls", {})),
        )


def hexes(values: Any) -> list[str]:
    return [float(x).hex() for x in np.asarray(values, dtype=np.float64).ravel()]


def floats(texts: Sequence[str]) -> NDArray[np.float64]:
    return np.array([float.fromhex(text) for text in texts], dtype=np.float64)


# --- decoding --------------------------------------------------------------------------------------------------


def decode(data: bytes, effects: bool = False) -> Example:
    """An example from bytes; every string of bytes is one. ``effects``: half of them call for some."""
    source = Bytes(data)
    axis, sign = source.below(3), 1.0 - 2.0 * source.below(2)
    half = source.choice((1.0, 0.5, 2.0, 0.25))
    size = source.choice(((8, 8), (8, 8), (8, 8), (16, 8), (8, 16), (9, 9), (11, 7), (13, 10)))
    settings = {name: _settings(source, name) for name in METHODS}
    exponent = source.choice((0, 0, 0, 20, -20, 6, -6, 13))
    eye = (source.coordinates(1)[0] // 8).astype(np.float64)
    points, faces = _mesh(source, eye, axis, sign, half, size)
    lights = _lights(source, points, faces)
    scale = UNIT * 2.0**exponent
    forward = np.zeros(3)
    forward[axis] = sign * scale
    up = np.zeros(3)
    up[(axis + 1) % 3] = 1.0
    eye = eye * scale
    camera = Camera(
        tuple(eye.tolist()), tuple((eye + forward * 4096).tolist()), tuple(up.tolist()),
        float(np.degrees(2 * np.arctan(half))),
    )  # fmt: skip
    calls = _calls(source) if effects else Calls()
    return Example(points * scale, faces, camera, lights * scale, size, settings, calls)


def _calls(source: Bytes) -> Calls:
    kind = source.below(16)
    if kind < 8:
        return Calls()
    every, holes = source.choice((0, 1, 2, 3)), source.choice((2, 1, 4, 8))
    return Calls(bool(kind & 1), bool(kind & 2), every, holes)


def _settings(source: Bytes, name: str) -> dict[str, str]:
    drawn = {key: source.choice(values) for key, values in CHOICES[name].items()}
    if drawn.get("precision") == "float32-centred" and drawn["aimed"] == "false":
        drawn["precision"] = "float32"  # nothing is centred but an aimed frame
    return {**ALWAYS.get(name, {}), **drawn}


def _mesh(
    source: Bytes, eye: NDArray, axis: int, sign: float, half: float, size: tuple[int, int]
) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    kind = source.below(8)
    if kind in (0, 1):
        points, faces = _ahead(source, *_soup(source), eye, axis, sign)
    elif kind in (2, 3, 4):
        points, faces = _sheet(source, eye, axis, sign, half, size)
    elif kind == 5:
        points, faces = _ahead(source, *_boxes(source), eye, axis, sign)
    else:
        one = _ahead(source, *_soup(source), eye, axis, sign)
        two = _sheet(source, eye, axis, sign, half, size)
        points = np.concatenate([one[0], two[0]])
        faces = np.concatenate([one[1], two[1] + len(one[0])])
    twist = source.below(8)
    if twist == 1:  # duplicates, in another vertex order
        faces = np.concatenate([faces, faces[:, [1, 2, 0]]])
    elif twist == 2:  # every triangle has vertices of its own
        points, faces = points[faces].reshape(-1, 3), np.arange(3 * len(faces)).reshape(-1, 3)
    elif twist == 3:  # points and lines among them
        faces = np.concatenate([faces[:, [0, 0, 1]], faces, faces[:, [2, 2, 2]]])
    elif twist == 4:  # slivers: all but flattened along one axis
        points = points.copy()
        points[:, source.below(3)] /= 4096.0
    elif twist == 5:
        faces = faces[::-1]
    return points.astype(np.float64), np.ascontiguousarray(faces, dtype=np.int32)


def _soup(source: Bytes) -> tuple[NDArray, NDArray]:
    """A few lattice vertices, and triangles among them: they share vertices and edges, and cross."""
    vertices = 3 + source.below(14)
    points = source.coordinates(vertices).astype(np.float64)
    faces = source.take(3 * (1 + source.below(20))).reshape(-1, 3)
    return points, (faces + [0, 1, 2]) % vertices


def _ahead(
    source: Bytes, points: NDArray, faces: NDArray, eye: NDArray, axis: int, sign: float
) -> tuple[NDArray, NDArray]:
    """Most meshes are folded to lie before the eye, where it sees more of them; the others may surround it."""
    if source.below(4):
        points = points.copy()
        points[:, axis] = eye[axis] + sign * np.abs(points[:, axis] - eye[axis])
    return points, faces


def _sheet(
    source: Bytes, eye: NDArray, axis: int, sign: float, half: float, size: tuple[int, int]
) -> tuple[NDArray, NDArray]:
    """A grid whose vertices lie on rays of pixels, at mixed depths: seen from the eye it has no holes."""
    every, across, along = 1 + source.below(4), 2 + source.below(4), 2 + source.below(4)
    width, height = size
    start = source.below(max(1, width // 2)), source.below(max(1, height // 2))
    pixel = half / height
    x = (2 * (start[0] + every * np.arange(across)) + 1 - width) * pixel
    y = (2 * (start[1] + every * np.arange(along)) + 1 - height) * pixel
    depth = 4096.0 * (1 + source.take(across * along).reshape(along, across) % 8)
    up = np.zeros(3)
    up[(axis + 1) % 3] = 1.0
    forward = np.zeros(3)
    forward[axis] = sign
    right = np.cross(forward, up)
    rays = forward + x[None, :, None] * right - y[:, None, None] * up
    points = (eye + rays * depth[..., None]).reshape(-1, 3)
    index = np.arange(across * along).reshape(along, across)
    a, b, c, d = index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]
    faces = np.concatenate([np.stack(f, axis=-1).reshape(-1, 3) for f in ((a, b, c), (a, c, d))])
    return points.astype(np.float32).astype(np.float64), faces


def _boxes(source: Bytes) -> tuple[NDArray, NDArray]:
    """One or two closed boxes on the lattice, which may touch or cross."""
    corners = np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)])
    sides = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    one = np.array([t for a, b, c, d in sides for t in ((a, b, c), (a, c, d))])
    points, faces = [], []
    for i in range(1 + source.below(2)):
        low, high = source.coordinates(2)
        points.append(low + corners * (high - low))
        faces.append(one + 8 * i)
    return np.concatenate(points).astype(np.float64), np.concatenate(faces)


def _lights(source: Bytes, points: NDArray, faces: NDArray) -> NDArray[np.float64]:
    """One or two lights: on the lattice, on a vertex, in a triangle's or an edge's middle, near or far."""
    lights = []
    for _ in range(1 + source.below(4) // 3):
        kind = source.below(8)
        corners = points[faces[source.below(len(faces))]]
        if kind == 1:
            light = corners[0]
        elif kind == 2:
            light = (corners[0] + corners[1]) / 2
        elif kind == 3:
            light = (corners[0] + corners[1] + 2 * corners[2]) / 4
        else:
            light = source.coordinates(1)[0].astype(np.float64)
            if kind == 4:
                light = light * 2.0 ** source.below(24)
            elif kind == 5:
                light = corners[0] + light * 2.0**-12
        lights.append(light)
    return np.array(lights, dtype=np.float32).astype(np.float64)


# --- trying ----------------------------------------------------------------------------------------------------


def answers_of(
    example: Example, name: str, trial: Trial | None = None, device: str = "cpu"
) -> dict[str, NDArray]:
    """What a method answers under the example's settings. Raises CapacityRejected where it needs too much."""
    trial = trial or example.trial()
    method = fresh_method(name, tuple(example.settings[name].items()))
    return Session(method, trial.prepared, *example.size, device).answers(trial.moment)


@functools.cache
def _model(name: str, settings: tuple[tuple[str, str], ...]) -> Method:
    return make_method(name, dict(settings))


def fresh_method(name: str, settings: tuple[tuple[str, str], ...]) -> Method:
    """As :func:`make_method`, but the text of settings is read once."""
    model = _model(name, settings)
    return type(model)(model.build, model.trace)  # type: ignore[attr-defined]


def true_errors(example: Example, names: Sequence[str] = METHODS, device: str = "cpu") -> dict[str, str]:
    """What each method gets wrong on an example, by its name; nothing where all is right."""
    trial = example.trial()
    judged = Judged(HardCase("example", "", "", lambda: trial), trial)
    exact, found = judged.exact, {}
    for name in names:
        try:
            answers = answers_of(example, name, trial, device)
        except CapacityRejected:
            continue
        except Exception as error:
            found[name] = f"{type(error).__name__}: {error}"
            continue
        if all(same_bits(answers[key], exact[key]) for key in ("triangle", "t", "visibility")):
            continue
        classes, examples = judged.judge(answers)
        wrong = {key: n for key, n in classes.items() if key in ERRORS}
        if wrong:
            found[name] = f"{wrong} {examples[:1]}"
    return found
