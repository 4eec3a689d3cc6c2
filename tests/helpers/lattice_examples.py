"""Examples for property tests and fuzzing, decoded from bytes: a mesh, a camera, lights and settings of every method.

Meshes are drawn by :mod:`lattice_meshes`. Coordinates are integers below 2^15 times a power of two, and coarse more
often than not: rays of the pixels then meet vertices, edges and cell boundaries exactly, again and again. Shorter
bytes and smaller bytes give simpler examples, so that a failure shrinks; bytes beyond the end read as 0.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from helpers.lattice_meshes import Bytes, draw_mesh, is_outside
from numpy.typing import NDArray
from shadowbench.harness.errors import CapacityRejected
from shadowbench.harness.frame.method import Method
from shadowbench.harness.frame.registry import make_method
from shadowbench.harness.frame.session import Session
from shadowbench.harness.hardcases.case import Counts, HardCase, Trial
from shadowbench.harness.hardcases.judge import ERROR_NAMES, Judged, same_bits
from shadowbench.harness.scene.overrides import perforated
from shadowbench.harness.scene.prepared import prepare
from shadowbench.harness.scene.scene import Camera, Geometry, Light, Scene

LENGTH = 400
"""Bytes that an example reads at most."""

UNIT = 2.0**-12

BEYOND = 2.0**17
"""A step from anywhere on the lattice that leads out of every mesh."""

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
    "uniform_grid": {"density": ("4.0", "0.1", "40.0", "700.0")},
    "ray_grids": {
        "trial": tuple(
            f"cells={cells}+inline_cells={most}+region={region}+spacing={spacing}"
            for cells in (64, 8, 16)
            for most in (64, 0, 4)
            for region in ("rays", "triangles")
            for spacing in ("even", "rays")
        ),
        "threads": ("1", "2", "3"),
    },
    "warp_bvh": {"leaf_size": ("0", "2", "8")},
}
"""Settings that must change no answer: the first of each is the plainest."""

ALWAYS = {"warp_bvh": {"update": "bvh_rebuild"}}
"""What makes a method exact."""

CULLING = ("off", "primary", "primary+light")
"""Drawn apart, where it is legal: it may answer a tie by the other triangle."""

METHODS = tuple(CHOICES)


@dataclass(frozen=True)
class Calls:
    """What the scene calls for. ``every``: so many-th triangle has ``holes`` along a side; 0: none has."""

    facing: bool = False
    directional: bool = False
    every: int = 0
    holes: int = 1


@dataclass(frozen=True, eq=False)
class Example:
    """``points`` float64 [n, 3], exact in float32; ``lights`` [m, 3]; ``settings`` of each method.

    ``bodies``: of a mesh of closed convex bodies, the body of each triangle, see :class:`lattice_meshes.Mesh`.
    """

    points: NDArray[np.float64]
    faces: NDArray[np.int32]
    camera: Camera
    lights: NDArray[np.float64]
    size: tuple[int, int]
    settings: dict[str, dict[str, str]]
    calls: Calls = Calls()
    bodies: NDArray[np.int32] | None = None

    def trial(self) -> Trial:
        points, faces, calls = self.points, self.faces, self.calls
        lights = tuple(
            Light((x, y, z), directional=calls.directional and (x, y, z) != (0, 0, 0))
            for x, y, z in self.lights.tolist()
        )
        scene = Scene("lattice", "Lattice", lambda: Geometry.static(points, faces), self.camera, lights)
        if calls.every:
            scene = replace(scene, alpha=lambda geometry: perforated(geometry, calls.every, calls.holes))
        prepared = prepare(replace(scene, facing=calls.facing, closed=self.bodies is not None))
        return Trial(prepared, prepared.moment(0, *self.size), Counts(), watertight=not calls.every)

    def with_geometry(self, points: NDArray, faces: NDArray) -> Example:
        points = np.asarray(points, dtype=np.float64)
        return replace(self, points=points, faces=np.asarray(faces, np.int32), bodies=None)

    def with_settings(self, name: str, **changes: str) -> Example:
        """With other settings of one method."""
        return replace(self, settings={**self.settings, name: {**self.settings[name], **changes}})

    def culls(self) -> bool:
        """Whether back faces are left out."""
        return self.settings.get("perspective_spherical", {}).get("cull", "off") != "off"

    def seen_from_outside(self) -> tuple[bool, bool]:
        """Whether a mesh of closed bodies is seen from outside, and whether it is lit from outside as well."""
        if self.bodies is None or self.calls.every:
            return False, False
        moment = self.trial().moment
        places = [moment.eye, *moment.lights]
        outside = [is_outside(moment.points, self.faces, self.bodies, at) for at in places]
        return outside[0], all(outside)

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
            "bodies": None if self.bodies is None else self.bodies.tolist(),
        }

    @staticmethod
    def thawed(facts: dict[str, Any]) -> Example:
        camera = facts["camera"]
        eye, target, up = (tuple(floats(camera[name]).tolist()) for name in ("eye", "target", "up"))
        bodies = facts.get("bodies")
        return Example(
            floats(facts["points"]).reshape(-1, 3),
            np.array(facts["faces"], dtype=np.int32).reshape(-1, 3),
            Camera(eye, target, up, float.fromhex(camera["fov"])),
            floats(facts["lights"]).reshape(-1, 3),
            (facts["size"][0], facts["size"][1]),
            facts["settings"],
            Calls(**facts.get("calls", {})),
            None if bodies is None else np.array(bodies, dtype=np.int32),
        )


def hexes(values: Any) -> list[str]:
    return [float(x).hex() for x in np.asarray(values, dtype=np.float64).ravel()]


def floats(texts: Sequence[str]) -> NDArray[np.float64]:
    return np.array([float.fromhex(text) for text in texts], dtype=np.float64)


# --- decoding --------------------------------------------------------------------------------------------------


def decode(data: bytes, effects: bool = False, culled: bool = False, closed: bool = False) -> Example:
    """An example from bytes; every string of bytes is one.

    ``effects``: half of them call for some. ``culled``: where it is legal, back faces are culled. ``closed``: a mesh of
    closed bodies, with eye and lights outside.
    """
    source = Bytes(data)
    axis, sign = source.below(3), 1.0 - 2.0 * source.below(2)
    half = source.choice((1.0, 0.5, 2.0, 0.25))
    size = source.choice(((8, 8), (8, 8), (8, 8), (16, 8), (8, 16), (9, 9), (11, 7), (13, 10)))
    settings = {name: _settings(source, name) for name in METHODS}
    exponent = source.choice((0, 0, 0, 20, -20, 6, -6, 13))
    eye = (source.coordinates(1)[0] // 8).astype(np.float64)
    mesh = draw_mesh(source, eye, axis, sign, half, size, closed)
    lights = _lights(source, mesh.points, mesh.faces)
    if closed:
        assert mesh.bodies is not None
        eye[axis] -= 0.0 if is_outside(mesh.points, mesh.faces, mesh.bodies, eye) else sign * BEYOND
        for light in lights:
            light[axis] -= 0.0 if is_outside(mesh.points, mesh.faces, mesh.bodies, light) else sign * BEYOND
        lights = lights.astype(np.float32).astype(np.float64)
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
    lights = lights * scale
    example = Example(mesh.points * scale, mesh.faces, camera, lights, size, settings, calls, mesh.bodies)
    return _culled(source, example) if culled else example


def _culled(source: Bytes, example: Example) -> Example:
    """With back faces culled, from the eye or from lights too, where nothing but ties may change by it."""
    legal = CULLING[: 1 + sum(example.seen_from_outside())]
    return example.with_settings("perspective_spherical", cull=legal[source.below(3) % len(legal)])


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


def answers_of(example: Example, name: str, trial: Trial | None = None, device: str = "cpu") -> dict[str, NDArray]:
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
        if fresh_method(name, tuple(example.settings[name].items())).applies(trial.prepared.scene, device):
            continue
        try:
            answers = answers_of(example, name, trial, device)
        except CapacityRejected:
            continue
        except Exception as error:
            found[name] = f"{type(error).__name__}: {error}"
            continue
        if all(same_bits(answers[key], exact[key]) for key in ("triangle", "t", "shadowed")):
            continue
        classes, examples, _ = judged.count(answers)
        wrong = {key: n for key, n in classes.items() if key in ERROR_NAMES}
        if wrong:
            found[name] = f"{wrong} {examples[:1]}"
    return found
