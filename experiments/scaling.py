"""How the whole frame's time grows: with triangles, with pixels, and with lights; everything rebuilt every frame.

The scene holds the same surfaces at every triangle count (:mod:`.scene.standins.balls`), so that rays meet the same
things. One sweep follows the other, each from one common point: 300,000 triangles, 1024x1024, one light.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from ..harness.runner.experiment import Entry, Experiment, Preset
from ..harness.scene.overrides import Lighting
from ._paper import METHOD

OURS = "ray grids"
METHODS = (
    Entry("ray_grids", {}, OURS),
    Entry(METHOD, {}, "the paper's grids"),
    Entry("bvh", {"update": "bvh_rebuild"}, "LBVH rebuilt in a graph"),
)


def lights(*counts: int) -> tuple[Lighting, ...]:
    """So many lights, turned evenly about the middle of the scene."""
    return tuple(Lighting(f"{n} lights", count=n) for n in counts)


def sweeps(base: Preset, scenes: tuple[str, ...], sides: tuple[int, ...], counts: tuple[int, ...]) -> Preset:
    """``base``'s one scene at other triangle counts, other sizes, and other numbers of lights."""
    sizes = tuple(replace(base, width=side, height=side) for side in sides)
    return replace(
        base, scenes=(*base.scenes, *scenes), also=(*sizes, replace(base, lightings=lights(*counts)))
    )


def draw(folder: Path, quiet: bool = False) -> list[Path]:
    """Three drawings side by side, growth exponents with intervals, CSV."""
    from ._figures import scaling

    return scaling.draw(folder, quiet, OURS)


EXPERIMENT = Experiment(
    name="scaling",
    title="Scaling: time against triangles, pixels and lights",
    presets={
        "quick": sweeps(
            Preset(
                128, 128, ("balls-10k",), METHODS, frames=1, samples=2, most=3, stage_samples=1, rounds=2, budget_s=2.0,
            ),
            ("balls-1k", "balls-3k", "balls-30k", "balls-100k"), (64, 256, 512), (2, 4, 8),
        ),
        "paper": sweeps(
            Preset(
                1024, 1024, ("balls-300k",), METHODS, frames=1, samples=10, most=20, deviation=0.01, stage_samples=2,
                rounds=2, budget_s=1.5, timeout_s=120.0, memory=24 << 30,
            ),
            ("balls-10k", "balls-30k", "balls-100k", "balls-1m", "balls-3m", "balls-10m"), (256, 512, 2048, 4096),
            (2, 4, 8, 16),
        ),
    },
    draw=draw,
)  # fmt: skip
