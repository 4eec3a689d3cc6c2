"""A scene as the tools take it in one word: ``NAME[@SIDE][:CHANGE=VALUE,...][#FRAME]``.

Changes are those of :class:`shadowbench.harness.scene.overrides.Lighting`, with values as in JSON:
``fairy@512:spot=20,facing=true``.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, fields
from typing import Any

from shadowbench.harness import api
from shadowbench.harness.scene.overrides import Lighting
from shadowbench.harness.scene.prepared import Prepared


@dataclass(frozen=True)
class AskedScene:
    """A scene's name, the side of its image in pixels, its changes, and the frame (None: not given)."""

    name: str
    side: int
    lighting: Lighting
    frame: int | None

    @classmethod
    def read(cls, text: str, side: int) -> AskedScene:
        """``side``: where the text gives none. ValueError for a change that there is not."""
        rest, _, frame = text.partition("#")
        rest, _, changes = rest.partition(":")
        name, _, given_side = rest.partition("@")
        kinds = {field.name: type(field.default) for field in fields(Lighting)}
        given: dict[str, Any] = {}
        for change in filter(None, changes.split(",")):
            key, _, value = change.partition("=")
            if key not in kinds:
                raise ValueError(f"{key!r} is no change of a scene: {', '.join(sorted(kinds))}")
            given[key] = kinds[key](json.loads(value))
        lighting = Lighting("changed", **given) if given else Lighting()
        return cls(name, int(given_side or side), lighting, int(frame) if frame else None)

    def prepared(self) -> Prepared:
        return self.lighting.applied(api.prepare(self.lighting.longer(api.resolve(self.name))))
