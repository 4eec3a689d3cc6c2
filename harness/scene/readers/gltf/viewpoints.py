"""The cameras and lights of a glTF scene (KHR_lights_punctual), where they are in the first frame.

Both look along -z of their node. Intensities in candela and lux become shares: pictures know no distance.
"""

import math

import numpy as np

from ....arrays import F64
from ...scene import Camera, Light, Spot, Vector
from .animation import aimed
from .document import Document, Entry
from .nodes import Matrices, Tree

_LIGHTS = "KHR_lights_punctual"
_BRIGHTEST = 1e12


def cameras(document: Document, tree: Tree, world: Matrices) -> dict[str, Camera]:
    """The cameras of the scene by the names of their nodes. One that has no view, such as one of zero size, is left out."""
    found: dict[str, Camera] = {}
    for i, node in enumerate(tree.nodes):
        entry = tree.entry(i)
        if "camera" not in entry:
            continue
        own = document.get("cameras", entry["camera"], f"node {node}")
        camera = _camera(own, world[i])
        if camera is not None:
            found[_name(found, "camera", entry, own)] = camera
    return found


def lights(document: Document, tree: Tree, world: Matrices) -> dict[str, Light]:
    """The lights of the scene's visible nodes by the names of these. One that shines nowhere is left out."""
    found: dict[str, Light] = {}
    known = document.items(document.extension(document.head, _LIGHTS, "the file") or {}, "lights", _LIGHTS)
    for i, node in enumerate(tree.nodes):
        said = document.extension(tree.entry(i), _LIGHTS, f"node {node}")
        if said is None or not tree.shown[i]:
            continue
        index = said.get("light")
        if type(index) is not int or not 0 <= index < len(known) or not isinstance(known[index], dict):
            raise document.error(f"node {node} names light {index!r}, but there are {len(known)}")
        light = _light(document, known[index], world[i], f"light {index}")
        if light is not None:
            found[_name(found, "light", tree.entry(i), known[index])] = light
    return found


def moving(document: Document, tree: Tree) -> list[str]:
    """A note if the first animation moves cameras and lights."""
    aims = aimed(document, document.all("animations")[:1])
    places = {tree.place[node] for node, path in aims if path != "weights" and node in tree.place}
    below = [int(place) for level in tree.moved(places) for place in level]
    count = sum("camera" in tree.entry(i) or _LIGHTS in tree.entry(i).get("extensions", {}) for i in below)
    return [f"moving cameras and lights read at the first frame: {count}"] if count else []


def _camera(entry: Entry, matrix: F64) -> Camera | None:
    parallel = entry.get("type") == "orthographic"
    lens = entry.get("orthographic" if parallel else "perspective")
    size = lens.get("ymag" if parallel else "yfov") if isinstance(lens, dict) else None
    if not isinstance(size, int | float) or not 0.0 < size < 1e30:
        return None
    forward, up, place = _unit(-matrix[:3, 2]), _unit(matrix[:3, 1]), matrix[:3, 3]
    if forward is None or up is None or not np.isfinite(place).all() or not (parallel or size < math.pi):
        return None
    # So far away that rounding leaves the direction as it is.
    eye, target = _vector(place), _vector(place + forward * max(1.0, np.abs(place).max()))
    if parallel:
        return Camera(eye, target, _vector(up), height=2.0 * size)
    return Camera(eye, target, _vector(up), math.degrees(size))


def _light(document: Document, entry: Entry, matrix: F64, where: str) -> Light | None:
    kind = entry.get("type")
    r, g, b = (min(max(x, 0.0), _BRIGHTEST) for x in document.numbers(entry, "color", where, (1.0, 1.0, 1.0)))
    strength = min(max(document.number(entry, "intensity", where, 1.0), 0.0), _BRIGHTEST)
    forward = _unit(-matrix[:3, 2])
    if kind == "directional":
        return None if forward is None else Light(_vector(-forward), True, (r, g, b), strength, None, True)
    if not np.isfinite(matrix[:3, 3]).all():
        return None
    place = _vector(matrix[:3, 3])
    if kind == "point":
        return Light(place, True, (r, g, b), strength)
    cone = document.object(entry, "spot", where)
    angle = math.degrees(document.number(cone, "outerConeAngle", where, math.pi / 4))
    if kind != "spot" or forward is None or not 0.0 < angle <= 180.0:
        return None
    return Light(place, True, (r, g, b), strength, Spot(_vector(forward), angle))


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


def _name(taken: dict[str, Camera] | dict[str, Light], what: str, *entries: Entry) -> str:
    """The first name among some entries; with a number where it is taken."""
    names = [" ".join(str(entry["name"]).split()) for entry in entries if isinstance(entry.get("name"), str)]
    name = next((name for name in names if name), what)
    unused = name
    number = 1
    while unused in taken:
        number += 1
        unused = f"{name} {number}"
    return unused
