"""The objects of a glTF file's JSON part: values of the type that they must have, or a line that names the entry.

An extension that is not understood may move, add or hide triangles. It is refused where the file requires it, and where it
stands at something that is read. One of a material, a texture or an image only changes how a surface looks.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ....errors import UserError
from ..checks import broken

_LARGEST = 1 << 40  # whole numbers are smaller: they count and index bytes of a file

DRACO = "KHR_draco_mesh_compression"
MESHOPT = ("EXT_meshopt_compression", "KHR_meshopt_compression")

_UNDERSTOOD = {DRACO, *MESHOPT} | set(
    """
    EXT_mesh_gpu_instancing KHR_animation_pointer KHR_lights_punctual KHR_mesh_quantization KHR_node_visibility
    """.split()
)
_LOOKS = re.compile(r"[A-Z0-9]+_(materials|texture|textures|lights|image)_.+")
"""Extensions of how surfaces look and are lit."""

_NOT_DRAWN = set(
    """
    AGI_articulations AGI_stk_metadata CESIUM_primitive_outline EXT_feature_metadata EXT_instance_features EXT_mesh_features
    EXT_mesh_manifold EXT_structural_metadata FB_geometry_metadata FB_ngon_encoding GODOT_single_root KHR_audio
    KHR_audio_emitter KHR_collision_shapes KHR_implicit_shapes KHR_interactivity KHR_node_hoverability
    KHR_node_selectability KHR_physics_rigid_bodies KHR_xmp KHR_xmp_json_ld MOZ_hubs_components MSFT_audio_emitter MSFT_lod
    MSFT_packing_normalRoughnessMetallic MSFT_packing_occlusionRoughnessMetallic OMI_collider OMI_physics_body
    OMI_physics_joint OMI_physics_shape VRM VRMC_node_constraint VRMC_springBone VRMC_vrm VRMC_vrm_animation
    """.split()
)
"""Extensions that describe a file, or what may happen after it is first drawn. Of MSFT_lod the finest meshes are drawn."""


class Entry:
    """An object of the JSON part. Every wrong value is a :class:`UserError` that names the file and the entry.

    name    what it is called in messages: "node 3"
    values  as they stand in the file
    """

    __slots__ = ("name", "path", "values")

    def __init__(self, path: Path, name: str, values: dict[str, Any]) -> None:
        self.path, self.name, self.values = path, name, values

    def __contains__(self, key: str) -> bool:
        return key in self.values

    def get(self, key: str, default: Any = None) -> Any:
        return self.values.get(key, default)

    def error(self, problem: str, way_out: str = "export the file again") -> UserError:
        """The error for what is wrong with it: "has ...", ": its ..."."""
        return broken(self.path, f"{self.name}{'' if problem[0] == ':' else ' '}{problem}", way_out)

    def whole(self, key: str, default: int | None = None) -> int:
        """A whole number that is not negative."""
        value = self.get(key, default)
        if type(value) is not int or not 0 <= value < _LARGEST:
            raise self.error(f": {key} is {value!r}, not a whole number")
        return value

    def items(self, key: str) -> list[Any]:
        """A list; empty where it is absent."""
        value = self.get(key, [])
        if not isinstance(value, list):
            raise self.error(f": {key} is not a list")
        return value

    def entries(self, key: str, one: str) -> list[Entry]:
        """A list of objects, which are called as this one is. ``one``: what is said of one that is none."""
        for value in self.items(key):
            if not isinstance(value, dict):
                raise self.error(f": {one} is not an object")
        return [Entry(self.path, self.name, value) for value in self.items(key)]

    def object(self, key: str, name: str = "") -> Entry:
        """An object within it; empty where it is absent. ``name``: what it is called, else as this one."""
        value = self.get(key, {})
        if not isinstance(value, dict):
            raise Entry(self.path, name or self.name, {}).error(f": {key} is not an object")
        return Entry(self.path, name or self.name, value)

    def numbers(self, key: str, default: Sequence[float]) -> list[float]:
        """As many finite numbers as the default has."""
        value = self.get(key)
        if value is None:
            return list(default)
        good = isinstance(value, list) and len(value) == len(default)
        if not good or not all(type(x) in (int, float) and abs(x) < 1e300 for x in value):
            raise self.error(f": {key} is not {len(default)} finite numbers")
        return [float(x) for x in value]

    def number(self, key: str, default: float) -> float:
        """A finite number."""
        return Entry(self.path, self.name, {key: [self.get(key, default)]}).numbers(key, (default,))[0]

    def extension(self, name: str) -> Entry | None:
        """What an extension says about it; None where it says nothing."""
        said = self.object("extensions") if "extensions" in self else None
        return said.object(name) if said and name in said else None

    def refuse_unknown(self) -> None:
        """Raise :class:`UserError` if an extension of it may change what is drawn: for what is read."""
        for name in filter(_unknown, self.object("extensions").values if "extensions" in self else ()):
            problem = f"has the extension {name}, which may change its triangles and cannot be read"
            raise self.error(problem, "export it without")

    def named(self, what: str, index: Any, items: Sequence[Any]) -> Entry:
        """The object among ``items`` that it names by an index."""
        if type(index) is not int or not 0 <= index < len(items) or not isinstance(items[index], dict):
            raise self.error(f"names {what} {index!r}, but there are {len(items)}")
        return Entry(self.path, f"{what} {index}", items[index])

    def title(self) -> str:
        """What it is and its own name, on one line; its index where it has none."""
        name = self.get("name")
        name = " ".join(name.split())[:60] if isinstance(name, str) else ""
        return f"{self.name.rpartition(' ')[0]} {name!r}" if name else self.name


def counted(count: int, one: str, many: str | None = None) -> str:
    """A number of things: "1 skin", "2 skins"."""
    return f"{count} {one if count == 1 else many or one + 's'}"


def _unknown(name: object) -> bool:
    """Whether an extension may change the triangles and is not understood."""
    return not isinstance(name, str) or not (name in _UNDERSTOOD | _NOT_DRAWN or _LOOKS.fullmatch(name))


def refuse_required(head: Entry) -> None:
    """Raise :class:`UserError` if the file requires an extension that is not understood, or one of its root is not."""
    for name in filter(_unknown, head.items("extensionsRequired")):
        raise broken(head.path, f"needs the extension {name}", "export it without")
    head.refuse_unknown()
