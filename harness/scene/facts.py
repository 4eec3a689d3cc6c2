"""Facts of a scene for records: hashes and numbers."""

import hashlib
from dataclasses import asdict, dataclass
from typing import Any

from ..files import array_hash, plain
from ..texts import numbered
from .alpha import arrays_of
from .effects import Effects
from .moment import Moment
from .prepared import Prepared
from .scene import Light

FEW = 0.01  # share of the rays that must hit something for a check to mean much


def scene_facts(prepared: Prepared, moments: dict[int, Moment]) -> dict[str, Any]:
    """The facts of a scene for a record: its source, size, and hashes of the arrays that all methods receive."""
    scene = prepared.scene
    arrays = hashlib.sha256()
    views = hashlib.sha256()
    for frame, moment in moments.items():
        arrays.update(prepared.sha256(frame).encode())
        for table in (moment.valid, moment.eye, moment.column, moment.row, moment.lights):
            views.update(table.tobytes())
    path = scene.light_path
    return {
        **{name: getattr(scene, name) for name in ("name", "title", "stand_in", "closed", "notes")},
        "source": asdict(scene.source),
        "triangles": prepared.triangle_count,
        "invalid_triangles": int(sum((m.valid == 0).sum() for m in list(moments.values())[:1])),
        "vertices": prepared.vertex_count,
        "frame_count": prepared.frame_count,
        "rate": scene.rate,
        "frames": list(moments),
        "arrays_sha256": arrays.hexdigest(),
        "moments_sha256": views.hexdigest(),
        "centre": [float(x) for x in prepared.centre],
        "radius": prepared.radius,
        "camera": plain(asdict(scene.camera)),
        "lights": [light_facts(light) for light in scene.lights],
        "effects": plain(asdict(Effects.of(scene))),
        **surface_facts(prepared),
        "light_path": None if path is None else {"kind": type(path).__name__, **plain(asdict(path))},  # type: ignore[call-overload]
    }


def light_facts(light: Light) -> dict[str, Any]:
    """A light for a record; without the fields of an area where it is a point."""
    area = () if light.shape else ("shape", "size", "samples", "towards", "across")
    return {name: plain(value) for name, value in asdict(light).items() if name not in area}


def contents(facts: dict[str, Any]) -> list[str | None]:
    """The facts (:func:`scene_facts`) in which scenes of one name may differ: hashes of the arrays of methods."""
    return [facts.get(name) for name in ("arrays_sha256", "moments_sha256", "surfaces_sha256")]


def surface_facts(prepared: Prepared) -> dict[str, str]:
    """A hash of which triangles are mirrors and of the mask of holes; {} where a scene has neither. A rule may choose
    them, and the rule's input need not be among the arrays that all methods receive.
    """
    mirror = [prepared.mirror] if prepared.scene.mirror is not None else []
    chosen = [*mirror, *arrays_of(prepared.alpha).values()]
    return {"surfaces_sha256": array_hash(*chosen)} if chosen else {}


def triangles(count: int) -> str:
    """A number of triangles as text: "1 triangle", "12,200 triangles"."""
    return numbered(count, "triangle")


@dataclass(frozen=True)
class Notice:
    """What a reader must know of what the rays of a scene can hit, or do hit.

    fact    in a clause
    means   of a warning: what it says of a check; "" for a fact that is no warning
    advice  what to do about it, or ""
    """

    fact: str
    means: str = ""
    advice: str = ""

    @property
    def warns(self) -> bool:
        return bool(self.means)

    @property
    def text(self) -> str:
        """On one line: "3 of 4,096 rays ...: this checked ...; choose ..."."""
        return self.fact + f": {self.means}" * self.warns + f"; {self.advice}" * bool(self.advice)

    def __str__(self) -> str:
        return "warning: " * self.warns + self.text


def never_hit(count: int, valid: int) -> Notice | None:
    """If triangles cannot be hit, so that misses are the right answers: a warning where all are such."""
    if valid == count:
        return None
    why = "no area, or a corner that is not a finite number"
    if valid:
        return Notice(f"{count - valid:,} of {triangles(count)} can never be hit ({why})")
    return Notice(f"none of {triangles(count)} can ever be hit ({why})", "this checked misses, and nothing else")


def few_hits(hits: int, rays: int) -> Notice | None:
    """A warning if fewer than :data:`FEW` of the primary rays hit anything, so that a check says little."""
    if hits >= FEW * rays:
        return None
    fact = f"{hits:,} of {rays:,} rays hit anything, fewer than {FEW:.0%}"
    return Notice(fact, "this checked misses, and little else", "choose another --camera")


def input_hashes(prepared: Prepared, moment: Moment) -> dict[str, str]:
    """Hashes of everything that an answer depends on: mesh, rays, lights, and the alpha mask if there is one."""
    hashes = {
        "mesh": array_hash(moment.points, prepared.faces, moment.valid),
        "rays": array_hash(moment.eye, moment.column, moment.row, *([moment.axes] if moment.orthographic else [])),
        "lights": array_hash(moment.lights),
    }
    if prepared.alpha is not None:
        hashes["surfaces"] = array_hash(*arrays_of(prepared.alpha).values())
    return hashes
