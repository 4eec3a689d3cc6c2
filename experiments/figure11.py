"""Figure 11 of the paper: time against the light's distance from the model, for several r.

The light moves from inside the model to 1e7 scene radii. The rectangle of the light's grid is unclamped or clamped,
its axes are the world's or aimed at the scene: workload. Light-space coordinates are float64, or float32 at one r:
number format. In exact arithmetic a rectangle clamped to what is lit has the same tiles at every large distance.
"""

from __future__ import annotations

from pathlib import Path

from ..harness.lighting import Lighting
from ..harness.plan import Entry, Experiment, Preset
from ._paper import faithful

CLAMPS = ("none", "hits")
VALUES = ("32", "64", "128", "256")
LARGE = (*VALUES, "1024")
"""At 1024x1024 a tile may hold thousands of rays: what happens where r hardly cuts them up."""

TRAVERSAL = "shadow rays"


def entries(light_tiles: int, values: tuple[str, ...]) -> tuple[Entry, ...]:
    """Every r in float64 and one in float32, for each rectangle and axes."""
    made = []
    for clamp in CLAMPS:
        for aimed in ("false", "true"):
            for r, precision in [*((r, "float64") for r in values), ("64", "float32")]:
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
    """Time against distance and against r, CSV, and what is work and what number format."""
    from ..harness.figures import figure11

    return figure11.draw(folder, quiet, TRAVERSAL, CLAMPS)


EXPERIMENT = Experiment(
    name="figure11",
    title="Figure 11: time against the distance of the light",
    presets={
        # As many rays a light tile as at 1024x1024 with the paper's 128 x 128 tiles, so that r has something to do.
        "quick": Preset(
            32, 32, ("cloth",), entries(4, VALUES), frames=3, samples=1, most=1, stage_samples=1, rounds=1, budget_s=1.2,
            timeout_s=180.0, lightings=distances(0.1, 1, 10, 1e3, 1e7), memory=256 << 20,
        ),
        "paper": Preset(
            1024, 1024, ("cloth",), entries(128, LARGE), frames=1, samples=3, most=10, deviation=0.01, stage_samples=5,
            rounds=2, budget_s=1.0, timeout_s=120.0, lightings=distances(0.1, 1, 10, 1e2, 1e3, 1e5, 1e7),
            memory=2 << 30,
        ),
    },
    draw=draw,
)  # fmt: skip
