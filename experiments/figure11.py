"""Figure 11 of the paper: time against the light's distance from the model, for several r.

The light moves from inside the model to 1e7 scene radii. The rectangle of the light's grid is unclamped or clamped,
its axes are the world's or aimed at the scene: workload. Light-space coordinates are float64, or, at one r, float32
and (aimed) float32 relative to the middle of the hit points: number format. In exact arithmetic a rectangle clamped to
what is lit has the same tiles at every large distance.
"""

from __future__ import annotations

from pathlib import Path

from ..harness.runner.experiment import Entry, Experiment, Preset
from ..harness.scene.overrides import Lighting
from ._paper import UNBALANCED, faithful

CLAMPS = ("none", "hits")
VALUES = ("32", "64", "128")
LARGE = ("32", "64", "128", "256", "1024")
"""At 1024x1024 a tile may hold thousands of rays: what happens where r hardly cuts them up."""

FORMAT_R = "64"
"""The r at which number formats are compared."""

TRAVERSAL = "shadow rays"


def entries(light_tiles: int, values: tuple[str, ...]) -> tuple[Entry, ...]:
    """Every r, and none, in float64 and one r in each other number format, for each rectangle and axes."""
    made = []
    for clamp in CLAMPS:
        for aimed in ("false", "true"):
            formats = ["float32", "float32-centred"] if aimed == "true" else ["float32"]
            runs = [(r, "float64") for r in values] + [(FORMAT_R, precision) for precision in formats]
            for r, precision in runs:
                label = f"{clamp}, {'aimed' if aimed == 'true' else 'world'}, {precision}, r={r}"
                # The exact test, so that the light's distance costs no answer; the other map is the subject of ablation.
                changes = {
                    "triangle_test": "exact",
                    "light_map": "azimuth-elevation",
                    "light_tiles": str(light_tiles),
                }
                made.append(faithful(label, clamp=clamp, aimed=aimed, precision=precision, r=r, **changes))
    return tuple(made)


def distances(*radii: float) -> tuple[Lighting, ...]:
    """The light at each of these distances."""
    return tuple(Lighting(f"{radius:g} radii", distance=radius) for radius in radii)


def draw(folder: Path, quiet: bool = False) -> list[Path]:
    """Time against distance and against r, tiles that hold rays, CSV, and what is work and what number format."""
    from ._figures import figure11

    apart = [lighting.label for lighting in FORMATS.lightings]
    return figure11.draw(folder, quiet, TRAVERSAL, CLAMPS, int(UNBALANCED), apart)


# Between 1e3 and 1e7 radii only number formats differ: at 1e5 each is measured at one r. One round of few samples: an
# unclamped grid of a far light takes seconds a frame.
FORMATS = Preset(
    1024, 1024, ("cloth",), entries(128, (FORMAT_R,)), frames=1, samples=3, most=10, deviation=0.01, stage_samples=5,
    rounds=1, budget_s=0.2, timeout_s=120.0, lightings=distances(1e5), memory=16 << 30,
)  # fmt: skip

EXPERIMENT = Experiment(
    name="figure11",
    title="Figure 11: time against the distance of the light",
    presets={
        # Few rays, since each is tested against half of all triangles where the rectangle is unclamped and the light far:
        # there they share one tile, so that r has something to do.
        "quick": Preset(
            16, 16, ("cloth",), entries(4, (*VALUES, UNBALANCED)), frames=3, samples=1, most=1, stage_samples=1, rounds=1,
            budget_s=0.8, timeout_s=180.0, lightings=distances(0.1, 1, 10, 1e3, 1e7), memory=256 << 20,
        ),
        "paper": Preset(
            1024, 1024, ("cloth",), entries(128, (*LARGE, UNBALANCED)), frames=1, samples=3, most=10, deviation=0.01,
            stage_samples=5, rounds=1, budget_s=0.2, timeout_s=120.0, lightings=distances(0.1, 1, 10, 1e3, 1e7),
            memory=16 << 30, also=(FORMATS,),
        ),
    },
    draw=draw,
)  # fmt: skip
