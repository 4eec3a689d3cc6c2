"""The cameras and lights of a stage, at the time of its first frame."""

import math
from collections import Counter
from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np
from pxr import Gf, UsdGeom, UsdLux

from ....arrays import F64
from ...scene import Camera, Light, Spot, Vector
from .prims import Node, Prims

_LIGHTS = (UsdLux.DistantLight, UsdLux.SphereLight, UsdLux.RectLight, UsdLux.DiskLight, UsdLux.CylinderLight)
"""What can be a point, an area or a direction; a light with an extent stands at its centre."""

_LARGEST = float(np.finfo(np.float32).max)


def cameras(prims: Prims, time: float, notes: list[str]) -> dict[str, Camera]:
    """The cameras by name, or by path where another has the same name. ``prims`` are at ``time``."""
    found = [(i, node) for i, node in enumerate(prims.nodes) if node.prim.IsA(UsdGeom.Camera)]
    made = [(node, _camera(node.prim, prims.matrix(i), time)) for i, node in found]
    _note_lost(notes, "cameras", (node for node, camera in made if camera is None))
    moving = sum(node.changes for node, _ in made)
    if moving:
        notes.append(f"moving cameras read at the first frame: {moving}")
    return _named([(node, camera) for node, camera in made if camera is not None])


def lights(prims: Prims, time: float, notes: list[str]) -> dict[str, Light]:
    """The visible lights by name, or by path where another has the same name. ``prims`` are at ``time``."""
    found = [
        (i, node)
        for i, node in enumerate(prims.nodes)
        if node.prim.HasAPI(UsdLux.LightAPI) and node.drawn and prims.visible(i)
    ]
    made = [(node, _light(node.prim, prims.matrix(i), time)) for i, node in found]
    _note_lost(notes, "lights", (node for node, light in made if light is None))
    near = [(node.prim, light) for node, light in made if light is not None and not light.directional]
    areas = sum(bool(light.shape) for _, light in near)
    points = sum(not light.shape and not _is_point(prim, time) for prim, light in near)
    if areas:
        notes.append(f"lights with an area: {areas}; each shines from its middle unless it is given more targets")
    if points:
        notes.append(f"lights with an extent read as points: {points}")
    return _named([(node, light) for node, light in made if light is not None])


def _camera(prim: Any, matrix: F64, time: float) -> Camera | None:
    """A camera, which looks along its -z; None where its transform or lens has no meaning."""
    lens = UsdGeom.Camera(prim).GetCamera(time)
    eye, up, back = matrix[3, :3], _unit(matrix[1, :3]), _unit(matrix[2, :3])
    fov = lens.GetFieldOfView(Gf.Camera.FOVVertical)
    height = lens.verticalAperture * Gf.Camera.APERTURE_UNIT
    if up is None or back is None or abs(float(up @ back)) > 1 - 1e-9 or not np.isfinite(eye).all():
        return None
    if not 0.0 < fov < 180.0 or not 0.0 < height < math.inf:
        return None
    distance = lens.focusDistance if 0.0 < lens.focusDistance < math.inf else 1.0
    flat = lens.projection == Gf.Camera.Orthographic
    return Camera(_vector(eye), _vector(eye - back * distance), _vector(up), fov, height if flat else None)


def _light(prim: Any, matrix: F64, time: float) -> Light | None:
    """A light, which shines along its -z; None for one that is no point or direction."""
    back, place = _unit(matrix[2, :3]), matrix[3, :3]
    distant = prim.IsA(UsdLux.DistantLight)
    if not any(map(prim.IsA, _LIGHTS)) or back is None or not np.isfinite(place).all():
        return None
    own = UsdLux.LightAPI(prim)
    color = np.array(own.GetColorAttr().Get(time), dtype=np.float64)
    strength = own.GetIntensityAttr().Get(time) * 2.0 ** own.GetExposureAttr().Get(time)
    if not (np.isfinite(color).all() and (color >= 0.0).all() and 0.0 <= strength < math.inf):
        return None
    spot = None
    if prim.HasAPI(UsdLux.ShapingAPI) and not distant:
        shaping = UsdLux.ShapingAPI(prim)
        angle = float(shaping.GetShapingConeAngleAttr().Get(time))
        if 0.0 < angle < 90.0:
            spot = Spot(_vector(-back), angle, falloff=max(0.0, float(shaping.GetShapingFocusAttr().Get(time))))
    if distant:
        return Light(_vector(back), True, _vector(color), float(strength), directional=True)
    light = Light(_vector(place), True, _vector(color), float(strength), spot)
    return light if _is_point(prim, time) else _with_extent(light, prim, matrix, time)


def _is_point(prim: Any, time: float) -> bool:
    """Whether a light has no extent, by what its prim says."""
    return prim.IsA(UsdLux.SphereLight) and bool(UsdLux.SphereLight(prim).GetTreatAsPointAttr().Get(time))


def _with_extent(light: Light, prim: Any, matrix: F64, time: float) -> Light:
    """The light with the area of its prim; a point where it has none, or where a disc or a sphere is stretched."""
    with np.errstate(over="ignore", invalid="ignore"):
        scale = np.linalg.norm(matrix[:3, :3], axis=1)
    shape, sides, axes = "", np.zeros(2), 2
    if prim.IsA(UsdLux.RectLight):
        own = UsdLux.RectLight(prim)
        shape, sides = "rectangle", np.array([own.GetWidthAttr().Get(time), own.GetHeightAttr().Get(time)])
    elif prim.IsA(UsdLux.DiskLight):
        shape, sides = "disc", np.full(2, 2.0 * UsdLux.DiskLight(prim).GetRadiusAttr().Get(time))
    elif prim.IsA(UsdLux.SphereLight):
        shape, sides, axes = "sphere", np.full(3, 2.0 * UsdLux.SphereLight(prim).GetRadiusAttr().Get(time)), 3
    size = sides * scale[:axes]
    flat = shape == "rectangle"
    across, back = _unit(matrix[0, :3]), _unit(matrix[2, :3])
    known = back is not None and (across is not None or not flat)
    if not known or not 0.0 < size.min() <= size.max() < _LARGEST or not (flat or np.allclose(size, size[0])):
        return light
    return replace(
        light, shape=shape, size=(float(size[0]), float(size[1])) if flat else float(size[0]),
        towards=None if shape == "sphere" or back is None else _vector(-back),
        across=_vector(across) if flat and across is not None else None,
    )  # fmt: skip


def _named(made: list[tuple[Node, Any]]) -> dict[str, Any]:
    names = [node.prim.GetName() for node, _ in made]
    uses = Counter(names)
    return {
        name if uses[name] == 1 else str(node.prim.GetPath()): value
        for name, (node, value) in zip(names, made, strict=True)
    }


def _note_lost(notes: list[str], what: str, lost: Iterable[Node]) -> None:
    kinds = [str(node.prim.GetTypeName()) for node in lost]
    if kinds:
        notes.append(f"{what} not offered: {len(kinds)} ({', '.join(sorted(set(kinds)))})")


def _unit(vector: F64) -> F64 | None:
    """The vector at length 1; None where that cannot be."""
    with np.errstate(over="ignore", invalid="ignore"):
        length = float(np.linalg.norm(vector))
    return vector / length if 0.0 < length < math.inf else None


def _vector(values: F64) -> Vector:
    return float(values[0]), float(values[1]), float(values[2])
