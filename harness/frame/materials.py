"""What surfaces and lights look like: a reflectance for each triangle, and a row of numbers for each light."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..scene.names import scene_names
from ..scene.prepared import Prepared
from ..scene.scene import Light

HUES = np.array(
    [
        [0.74, 0.66, 0.54],  # limestone
        [0.56, 0.64, 0.70],  # slate
        [0.74, 0.63, 0.50],  # sand
        [0.58, 0.68, 0.50],  # lichen
        [0.72, 0.60, 0.54],  # brick dust
        [0.66, 0.61, 0.66],  # heather
    ]
)
"""Linear reflectances. A scene, or a mesh, always gets the same one; its separate pieces vary around it."""


def reflectances(prepared: Prepared) -> NDArray[np.float32]:
    """Linear reflectance of each triangle, float32 [triangle_count, 3]."""
    # A scene declared in a file is one by its mesh: two declarations of it can be compared.
    known = prepared.scene.name in scene_names()
    identity = prepared.scene.name.encode() if known else np.sort(prepared.faces, axis=1).tobytes()
    digest = hashlib.sha256(identity).digest()
    base = HUES[digest[0] % len(HUES)]
    piece = pieces(prepared)
    # A multiplicative hash spreads neighbouring piece numbers; two of its bytes vary value and warmth.
    mixed = (piece.astype(np.uint64) * np.uint64(0x9E3779B97F4A7C15)) >> np.uint64(40)
    value = (mixed & np.uint64(255)).astype(np.float64) / 255 - 0.5
    warmth = ((mixed >> np.uint64(8)) & np.uint64(255)).astype(np.float64) / 255 - 0.5
    warm = np.array([1.0, 0.0, -1.0])
    tint = base * (1 + 0.26 * value[:, None] + 0.16 * warmth[:, None] * warm)
    return np.clip(tint, 0.05, 0.95).astype(np.float32)


def pieces(prepared: Prepared) -> NDArray[np.int64]:
    """For each triangle the lowest vertex of the connected piece that it belongs to, int64 [triangle_count].

    Connected means sharing a vertex of the welded mesh. Lowest labels are handed across triangles, with
    pointer jumping, until nothing changes.
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


LAMP = 5
"""Numbers of a light's look: red, green and blue, fall-off, and whether its shadow bits count."""


def lamp_rows(lights: Sequence[Light], shadows: Sequence[bool]) -> NDArray[np.float64]:
    """The look of each light, float64 [light_count, 5]; all lights together, seen face on, make 1.

    ``shadows``: whether the bits of each count.
    """
    strength = sum(light.intensity * max(light.color) for light in lights) or 1.0
    rows = np.zeros((len(lights), LAMP))
    for i, light in enumerate(lights):
        rows[i, :3] = np.asarray(light.color) * (light.intensity / strength)
        rows[i, 3] = light.spot.falloff if light.spot is not None else 0.0
        rows[i, 4] = float(shadows[i])
    return rows
