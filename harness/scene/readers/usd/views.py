"""The cameras and lights of a stage, at the time of its first frame."""

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from pxr import Gf, UsdGeom, UsdLux

from ....arrays import F64
from ...light_paths import vector
from ...scene import Camera, Light, Spot
from .prims import Node

_LIGHTS = (UsdLux.DistantLight, UsdLux.SphereLight, UsdLux.RectLight, UsdLux.DiskLight, UsdLux.CylinderLight)
"""What can be a point, an area or a direction; a light with an extent stands at its centre."""

_AREAS = {  # the shape of a light's area, and which attributes give its size along x, y and z, times a factor
    UsdLux.RectLight: ("rectangle", 1.0, ("inputs:width", "inputs:height")),
    UsdLux.DiskLight: ("disc", 2.0, ("inputs:radius",) * 2),
    UsdLux.SphereLight: ("sphere", 2.0, ("inputs:radius",) * 3),
}

_LARGEST = float(np.finfo(np.float32).max)


def cameras(nodes: Sequence[Node], time: float, notes: list[str]) -> dict[str, Camera]:
    """The cameras by name, or by path where another has the same name. The nodes are at this time."""
    made = [(node, _camera(node, time)) for node in nodes if node.prim.IsA(UsdGeom.Camera)]
    _note_lost(notes, "cameras", made)
    moving = sum(node.changes for node, _ in made)
    if moving:
        notes.append(f"moving cameras read at the first frame: {moving}")
    return _named(made)


def lights(nodes: Sequence[Node], time: float, notes: list[str]) -> dict[str, Light]:
    """The visible lights by name, or by path where another has the same name. The nodes are at this time."""
    shown = [node for node in nodes if node.prim.HasAPI(UsdLux.LightAPI) and node.drawn and node.visible]
    made = [(node, _light(node, time)) for node in shown]
    _note_lost(notes, "lights", made)
    near = [(node.prim, light) for node, light in made if light is not None and not light.directional]
    areas = sum(bool(light.shape) for _, light in near)
    points = sum(not light.shape and not _is_point(prim, time) for prim, light in near)
    if areas:
        notes.append(f"lights with an area: {areas}; each shines from its middle unless it is given more targets")
    if points:
        notes.append(f"lights with an extent read as points: {points}")
    return _named(made)


def _camera(node: Node, time: float) -> Camera | None:
    """A camera, which looks along its -z; None where its transform or lens has no meaning."""
    lens, matrix = UsdGeom.Camera(node.prim).GetCamera(time), node.matrix
    eye, up, back = matrix[3, :3], _unit(matrix[1, :3]), _unit(matrix[2, :3])
    fov = lens.GetFieldOfView(Gf.Camera.FOVVertical)
    height = lens.verticalAperture * Gf.Camera.APERTURE_UNIT
    if up is None or back is None or abs(float(up @ back)) > 1 - 1e-9 or not np.isfinite(eye).all():
        return None
    if not 0.0 < fov < 180.0 or not 0.0 < height < math.inf:
        return None
    distance = lens.focusDistance if 0.0 < lens.focusDistance < math.inf else 1.0
    flat = lens.projection == Gf.Camera.Orthographic
    return Camera(vector(eye), vector(eye - back * distance), vector(up), fov, height if flat else None)


def _light(node: Node, time: float) -> Light | None:
    """A light, which shines along its -z; None for one that is no point or direction."""
    prim, matrix = node.prim, node.matrix
    back, place = _unit(matrix[2, :3]), matrix[3, :3]
    distant = prim.IsA(UsdLux.DistantLight)
    if not any(map(prim.IsA, _LIGHTS)) or back is None or not np.isfinite(place).all():
        return None
    own = UsdLux.LightAPI(prim)
    color = np.array(own.GetColorAttr().Get(time), dtype=np.float64)
    strength = own.GetIntensityAttr().Get(time) * 2.0 ** own.GetExposureAttr().Get(time)
    if not (np.isfinite(color).all() and (color >= 0.0).all() and 0.0 <= strength < math.inf):
        return None
    if distant:
        return Light(vector(back), True, vector(color), float(strength), directional=True)
    spot = None
    if prim.HasAPI(UsdLux.ShapingAPI):
        shaping = UsdLux.ShapingAPI(prim)
        angle = float(shaping.GetShapingConeAngleAttr().Get(time))
        if 0.0 < angle < 90.0:
            spot = Spot(vector(-back), angle, falloff=max(0.0, float(shaping.GetShapingFocusAttr().Get(time))))
    light = Light(vector(place), True, vector(color), float(strength), spot)
    return light if _is_point(prim, time) else _with_extent(light, prim, matrix, back, time)


def _is_point(prim: Any, time: float) -> bool:
    """Whether a light has no extent, by what its prim says."""
    return prim.IsA(UsdLux.SphereLight) and bool(UsdLux.SphereLight(prim).GetTreatAsPointAttr().Get(time))


def _with_extent(light: Light, prim: Any, matrix: F64, back: F64, time: float) -> Light:
    """The light with the area of its prim; a point where it has none, or where a disc or a sphere is stretched."""
    known = next((kind for kind in _AREAS if prim.IsA(kind)), None)
    if known is None:
        return light
    shape, factor, names = _AREAS[known]
    with np.errstate(over="ignore", invalid="ignore"):
        scale = np.linalg.norm(matrix[:3, :3], axis=1)[: len(names)]
        size = scale * [factor * prim.GetAttribute(name).Get(time) for name in names]
    flat, across = shape == "rectangle", _unit(matrix[0, :3])
    even = flat or np.allclose(size, size[0])
    if (flat and across is None) or not 0.0 < size.min() <= size.max() < _LARGEST or not even:
        return light
    return replace(
        light, shape=shape, size=(float(size[0]), float(size[1])) if flat else float(size[0]),
        towards=None if shape == "sphere" else vector(-back),
        across=vector(across) if flat and across is not None else None,
    )  # fmt: skip


def _named(made: Sequence[tuple[Node, Any]]) -> dict[str, Any]:
    """What was made, by the name of its prim, or by its path where another has the same name."""
    there = [(node.prim, value) for node, value in made if value is not None]
    uses = Counter(prim.GetName() for prim, _ in there)
    return {prim.GetName() if uses[prim.GetName()] == 1 else str(prim.GetPath()): value for prim, value in there}


def _note_lost(notes: list[str], what: str, made: Sequence[tuple[Node, Any]]) -> None:
    kinds = [str(node.prim.GetTypeName()) for node, value in made if value is None]
    if kinds:
        notes.append(f"{what} not offered: {len(kinds)} ({', '.join(sorted(set(kinds)))})")


def _unit(way: F64) -> F64 | None:
    """The vector at length 1; None where that cannot be."""
    with np.errstate(over="ignore", invalid="ignore"):
        length = float(np.linalg.norm(way))
    return way / length if 0.0 < length < math.inf else None
