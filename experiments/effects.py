"""Only what a scene calls for: the cost of each effect, alone and together, and of a frame by what moved."""

from __future__ import annotations

from pathlib import Path

from ..harness.runner.experiment import Entry, Experiment, Preset
from ..harness.scene.overrides import MOVED, Lighting
from ._paper import METHOD

METHODS = (
    Entry(METHOD, {}, "perspective + spherical"),
    Entry(METHOD, {"clamp": "scene"}, "the same, clamped to the scene"),
    Entry("ray_grids"),
    Entry("uniform_grid"),
    Entry("bvh"),
    Entry("bvh", {"update": "bvh_rebuild"}, "BVH rebuilt in place, exact"),
    Entry("embree"),
)

BASE = "one light"
SPOT = 20.0

EFFECTS = (
    Lighting("no shadows", count=1, shadows=False),
    Lighting(BASE, count=1),
    Lighting("two lights", count=2),
    Lighting("a spot", count=1, spot=SPOT),
    Lighting("facing only", count=1, facing=True),
    Lighting("directional", count=1, directional=True),
    Lighting("alpha", count=1, alpha=4),
    Lighting("mirror", count=1, bounces=1),
    Lighting("shaded", count=1, color=True),
    Lighting("spot, facing, two", count=2, spot=SPOT, facing=True),
)
"""Each effect alone against one point light with shadows, then together."""

PLAIN = 6
"""So many of them ask for nothing but lights; the others are measured last, since their truth takes longest."""

CHANGES = tuple(Lighting(f"moved {what}", count=1, moved=what) for what in MOVED)
LIGHTINGS = (*EFFECTS[:PLAIN], *CHANGES, *EFFECTS[PLAIN:])


def draw(folder: Path, quiet: bool = False) -> list[Path]:
    """Two drawings and CSV."""
    from ._figures import effects

    return effects.draw(folder, quiet, BASE, [lighting.label for lighting in (*EFFECTS, *CHANGES)])


EXPERIMENT = Experiment(
    name="effects",
    title="Effects: what each costs, and a frame by what moved",
    presets={
        "quick": Preset(
            128, 128, ("cloth",), METHODS, frames=1, samples=3, most=3, stage_samples=1, rounds=1, budget_s=3.0,
            lightings=LIGHTINGS,
        ),
        "paper": Preset(
            1024, 1024, ("fairy", "conference"), METHODS, frames=2, samples=10, most=20, deviation=0.005,
            stage_samples=3, rounds=2, budget_s=4.0, timeout_s=600.0, lightings=LIGHTINGS,
        ),
    },
    draw=draw,
)  # fmt: skip
