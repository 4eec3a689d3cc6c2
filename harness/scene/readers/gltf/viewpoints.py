"""The cameras and lights of a glTF scene (KHR_lights_punctual), where they are in the first frame.

Both look along -z of their node. Intensities in candela and lux become shares: pictures know no distance.
"""

import itertools
import math
from collections.abc import Collection

import numpy as np

from ....arrays import F64
from ...scene import Camera, Light, Spot, Vector
from .animation import aimed
from .container import File
from .entries import Entry
from .nodes import Matrices, Tree

_LIGHTS = "KHR_lights_punctual"
_BRIGHTEST = 1e12


def cameras(file: File, tree: Tree, world: Matrices) -> dict[str, Camera]:
    """The cameras of the scene by the names of their nodes. One that has no view, such as one of zero size, is left out."""
    found: dict[str, Camera] = {}
    for node, matrix in zip(tree.entries, world, strict=True):
        if "camera" in node:
            own = file.named(node, node.get("camera"), "cameras")
            camera = _camera(own, matrix)
            if camera is not None:
                found[_name(found, "camera", node, own)] = camera
    return found


def lights(file: File, tree: Tree, world: Matrices) -> dict[str, Light]:
    """The lights of the scene's visible nodes by the names of these. One that shines nowhere is left out."""
    found: dict[str, Light] = {}
    listed = file.head.extension(_LIGHTS)
    known = [] if listed is None else Entry(file.path, _LIGHTS, listed.values).items("lights")
    for node, matrix, shown in zip(tree.entries, world, tree.shown, strict=True):
        said = node.extension(_LIGHTS)
        if said is not None and shown:
            own = node.named("light", said.get("light"), known)
            light = _light(own, matrix)
            if light is not None:
                found[_name(found, "light", node, own)] = light
    return found


def moving(file: File, tree: Tree) -> list[str]:
    """A note if the first animation moves cameras and lights."""
    aims = aimed(Entry(file.path, "an animation", file.all("animations")[0])) if file.all("animations") else []
    places = {tree.place[node] for node, path in aims if path != "weights" and node in tree.place}
    below = [tree.entries[place] for level in tree.moved(places) for place in level]
    count = sum("camera" in node or _LIGHTS in node.get("extensions", {}) for node in below)
    return [f"moving cameras and lights read at the first frame: {count}"] if count else []


def _camera(entry: Entry, matrix: F64) -> Camera | None:
    parallel = entry.get("type") == "orthographic"
    lens = entry.get("orthographic" if parallel else "perspective")
    size = lens.get("ymag" if parallel else "yfov") if isinstance(lens, dict) else None
    if not isinstance(size, int | float) or not 0.0 < size < (1e30 if parallel else math.pi):
        return None
    forward, up, place = _unit(-matrix[:3, 2]), _unit(matrix[:3, 1]), matrix[:3, 3]
    if forward is None or up is None or not np.isfinite(place).all():
        return None
    # So far away that rounding leaves the direction as it is.
    eye, target = _vector(place), _vector(place + forward * max(1.0, np.abs(place).max()))
    if parallel:
        return Camera(eye, target, _vector(up), height=2.0 * size)
    return Camera(eye, target, _vector(up), math.degrees(size))


def _light(entry: Entry, matrix: F64) -> Light | None:
    kind, place, forward = entry.get("type"), matrix[:3, 3], _unit(-matrix[:3, 2])
    r, g, b = (min(max(x, 0.0), _BRIGHTEST) for x in entry.numbers("color", (1.0, 1.0, 1.0)))
    strength = min(max(entry.number("intensity", 1.0), 0.0), _BRIGHTEST)
    if kind == "directional":
        return None if forward is None else Light(_vector(-forward), True, (r, g, b), strength, None, True)
    if not np.isfinite(place).all():
        return None
    if kind == "point":
        return Light(_vector(place), True, (r, g, b), strength)
    angle = math.degrees(entry.object("spot").number("outerConeAngle", math.pi / 4))
    if kind != "spot" or forward is None or not 0.0 < angle <= 180.0:
        return None
    return Light(_vector(place), True, (r, g, b), strength, Spot(_vector(forward), angle))


def _unit(vector: F64) -> F64 | None:
    """The direction of a vector; None where it has none."""
    largest = np.abs(vector).max()
    if not 0.0 < largest < np.inf:
        return None
    vector = vector / largest
    return vector / np.linalg.norm(vector)


def _vector(values: F64) -> Vector:
    x, y, z = (float(value) + 0.0 for value in values)  # without negative zeros
    return x, y, z


def _name(taken: Collection[str], what: str, *entries: Entry) -> str:
    """The first name among some entries; with a number where it is taken."""
    names = (" ".join(name.split()) for entry in entries if isinstance(name := entry.get("name"), str))
    first = next(filter(None, names), what)
    numbered = (f"{first} {number}" for number in itertools.count(2))
    return next(name for name in itertools.chain([first], numbered) if name not in taken)
