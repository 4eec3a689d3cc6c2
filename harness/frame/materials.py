"""Appearance of surfaces and lights: a reflectance per triangle and a row of numbers per light."""

import hashlib
import weakref
from collections.abc import Sequence

import numpy as np

from ..arrays import F32, F64, I64
from ..scene.names import scene_names
from ..scene.prepared import Prepared
from ..scene.scene import Light

HUES = np.array(  # Linear reflectances. Each scene or mesh has one of them; its connected pieces vary around it.
    [
        [0.74, 0.66, 0.54],  # limestone
        [0.56, 0.64, 0.70],  # slate
        [0.74, 0.63, 0.50],  # sand
        [0.58, 0.68, 0.50],  # lichen
        [0.72, 0.60, 0.54],  # brick dust
        [0.66, 0.61, 0.66],  # heather
    ]
)


_KNOWN: weakref.WeakKeyDictionary[Prepared, F32] = weakref.WeakKeyDictionary()
"""The reflectances of prepared scenes in use. Finding the connected pieces takes longer than a frame."""


def reflectances(prepared: Prepared) -> F32:
    """Linear reflectance of each triangle, float32 [triangle_count, 3]. Not to be written to."""
    if prepared not in _KNOWN:
        _KNOWN[prepared] = _reflectances(prepared)
        _KNOWN[prepared].flags.writeable = False
    return _KNOWN[prepared]


def _reflectances(prepared: Prepared) -> F32:
    # A declared scene gets the reflectance of its mesh, so that two declarations of one mesh look alike.
    known = prepared.scene.name in scene_names()
    identity = prepared.scene.name.encode() if known else np.sort(prepared.faces, axis=1).tobytes()
    digest = hashlib.sha256(identity).digest()
    base = HUES[digest[0] % len(HUES)]
    # A multiplicative hash of the piece number; two of its bytes vary the brightness and the warmth.
    mixed = (pieces(prepared).astype(np.uint64) * np.uint64(0x9E3779B97F4A7C15)) >> np.uint64(40)
    value, warmth = ((mixed >> np.uint64(shift) & np.uint64(255))[:, None] / 255 - 0.5 for shift in (0, 8))
    tint = base * (1 + 0.26 * value + 0.16 * warmth * np.array([1.0, 0.0, -1.0]))
    return np.clip(tint, 0.05, 0.95).astype(np.float32)


def pieces(prepared: Prepared) -> I64:
    """For each triangle the lowest vertex of the connected piece that it belongs to, int64 [triangle_count]. Two
    triangles are connected if they share a vertex of the welded mesh. The lowest label spreads over connected
    triangles, with pointer jumping, until no label changes.
    """
    corners = prepared.weld[prepared.faces].astype(np.int64)
    label = np.arange(prepared.vertex_count, dtype=np.int64)
    while len(corners):
        lowest = label[corners].min(axis=1)
        before = label.copy()
        for i in range(3):
            np.minimum.at(label, corners[:, i], lowest)
            np.minimum.at(label, before[corners[:, i]], lowest)
        label = label[label]
        if np.array_equal(label, before):
            break
    return label[corners[:, 0]]


LAMP = 5  # numbers per light: red, green, blue, fall-off, and whether its shadow bits count


def lamp_rows(lights: Sequence[Light], shadows: Sequence[bool]) -> F64:
    """Colour, fall-off and shadow flag of each light, float64 [light_count, 5]. The lights are scaled so that a surface
    that faces all of them receives 1. ``shadows``: whether the shadow bits of each light count.
    """
    strength = sum(light.intensity * max(light.color) for light in lights) or 1.0
    rows = np.zeros((len(lights), LAMP))
    for i, light in enumerate(lights):
        rows[i, :3] = np.asarray(light.color) * (light.intensity / strength)
        rows[i, 3] = light.spot.falloff if light.spot is not None else 0.0
        rows[i, 4] = float(shadows[i])
    return rows
