"""Figure 6 of the paper: spotlights on the Fairy scene, so that only what they hold has a shadow.

A cone, the paper's rectangle of azimuth and elevation, and a wider cone whose light falls off towards its edge.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..harness.report import compare, document, gallery, panels, style
from ..harness.report.picture import opened
from ..harness.results.folder import image_name
from ..harness.results.table import samples
from ..harness.runner.experiment import Entry, Experiment, Preset
from ..harness.scene.overrides import Lighting
from ._paper import METHOD

if TYPE_CHECKING:
    import pandas as pd

FAIRY = (0.05, 1.25, 0.0)
"""Where the fairy of the stand-in hovers."""

FALLING, FALL_OFF = 10.0, 150.0
"""Half-angle, and the exponent that leaves a tenth of the light at that angle."""

LIGHTINGS = (
    Lighting(),
    Lighting("cone", target=FAIRY, angle=6.0),
    Lighting("rectangle", target=FAIRY, angle=9.0, rise=4.0),
    Lighting("cone-fall-off", target=FAIRY, angle=FALLING, falloff=FALL_OFF),
)
METHODS = (Entry(METHOD),)


COLUMNS = [
    *document.COMMON, "spot", "spot_angle", "spot_rise", "spot_falloff", "hit_pixels", "shadow_rays", "shadow_ray_share",
]  # fmt: skip
HEADINGS: document.Columns = {
    "scene": ("title", "{}"), "light": ("light", "{}"), "hit points": ("hit_pixels", "{:,.0f}"),
    "with a shadow ray": ("shadow_rays", "{:,.0f}"), "share": ("shadow_ray_share", "{:.0%}"),
    "light grid, ms": ("light_build_text", "{}"), "shadow rays, ms": ("shadow_text", "{}"),
}  # fmt: skip


def draw(folder: Path, quiet: bool = False) -> list[Path]:
    """The scene without and with each spot, and what the spot saves."""
    frames = document.frames(folder)
    table = document.named(frames)
    known = table.columns.union(
        [f"light.{name}" for name in ("target", "angle", "rise", "falloff")], sort=False
    )
    table = table.reindex(columns=known)
    spot = table["light.target"].notna()
    table["spot"] = table["light.rise"].isna().map({True: "cone", False: "rectangle"}).where(spot)
    for name in ("angle", "rise", "falloff"):
        table[f"spot_{name}"] = table[f"light.{name}"].astype(float).where(spot)
    table["light"] = [spot_text(r) for r in table.itertuples()]
    # The light everywhere first, then cones and rectangles, and what falls off last.
    table = table.sort_values(["file", "spot_falloff", "spot"], na_position="first")
    own, plain = compare.pairs(frames, frames["light_label"] == "", (*compare.SCENE, *compare.SIZE, "label"))
    table["shadow_rays"] = counted_rays(table)
    table["hit_pixels"] = table["key"].map(counted_rays(plain))
    table["shadow_ray_share"] = table["shadow_rays"] / table["hit_pixels"]
    repeats = samples(folder)
    for part, name in (("light build", "light_build"), ("shadow", "shadow")):
        table[f"{name}_over_plain"] = table["key"].map(own[f"{name}_ms"] / plain[f"{name}_ms"])
        spread = table["key"].map(compare.pass_spread(repeats, part))
        table[f"{name}_text"] = document.carry(table[f"{name}_ms"], spread)
    files = [document.write_csv(table, folder / "figure6.csv", COLUMNS)]
    for name, rows in table.groupby("file", sort=False):
        files += picture(rows, folder, folder / f"figure6-{name}.png")
    done = document.measured(table)
    spots = done[done["spot"].notna() & done["shadow_ray_share"].notna()]
    finding = "No spot was measured beside the light that shines everywhere."
    if len(spots):
        share = document.span(spots["shadow_ray_share"], "{:.0%}".format)
        grids, rays = (document.span(spots[f"{name}_over_plain"]) for name in ("light_build", "shadow"))
        finding = (
            f"Spots leave {share} of the hit points a shadow ray; light grids take {grids} times and shadow rays {rays} "
            "times as long as with the light everywhere (the paper has no times)."
        )
    tables = {"Lights": document.texts(done, HEADINGS)}
    return document.write(folder, "figure6", EXPERIMENT.title, finding, tables, files, table, quiet)


def counted_rays(table: pd.DataFrame) -> pd.Series:
    """Shadow rays of a frame, of all lights, as the method counted them."""
    return table.filter(regex=r"^counter\.light .* rays$").sum(axis=1, min_count=1)


def spot_text(r: Any) -> str:
    """A row's light in a few words, such as "cone of 6 degrees"; angles are from side to side."""
    if not isinstance(r.spot, str):
        return "everywhere"
    rise = "" if np.isnan(r.spot_rise) else f" x {2 * r.spot_rise:g}"
    edge = np.cos(np.radians(r.spot_angle)) ** r.spot_falloff
    falls = f", falling off to {edge:.0%}" * bool(r.spot_falloff)
    return f"{r.spot} of {2 * r.spot_angle:g}{rise} degrees{falls}"


def picture(own: pd.DataFrame, folder: Path, path: Path) -> list[Path]:
    """The pictures of a scene under each light, two a row; above each which light, below all which scene."""
    rows = own.drop_duplicates("light_label").itertuples()
    found = (
        (r, opened(folder / "images" / image_name(r.scene, r.light_label, r.width, r.height))) for r in rows
    )
    kept = [(r, image) for r, image in found if image is not None]
    if not kept:
        return []
    first, across, down = own.iloc[0], min(2, len(kept)), -(-len(kept) // 2)
    high = style.COLUMN_WIDTH / across * first["height"] / first["width"] + 0.25
    size = (style.COLUMN_WIDTH, high * down + 0.35)
    with panels.sheet(path, size, down, across, legend=0, grid="", dpi=220, colours=40) as (figure, grid):
        for axes in grid.flat:
            axes.set_axis_off()
        for axes, (r, image) in zip(grid.flat, kept, strict=False):
            whole = np.asarray(image.convert("RGB"))  # below the picture itself stands its own caption
            axes.imshow(whole[: round(image.width * r.height / r.width)])
            rays = (
                f"\nshadow rays: {r.shadow_ray_share:.0%}"
                if isinstance(r.spot, str) and r.shadow_ray_share >= 0
                else ""
            )
            axes.set_title(r.light[:1].upper() + r.light[1:] + rays, fontsize=5.5)
        about = gallery.stand_in_text(first["stand_in"]) if first["stand_in"] else ""
        panels.caption(figure, f"{first['title']}, {document.where(own)}", about)
    return [path]


EXPERIMENT = Experiment(
    name="figure6",
    title="Figure 6: spotlights",
    presets={
        "quick": Preset(
            384, 384, ("fairy",), METHODS, frames=1, samples=3, most=3, rounds=2, budget_s=10.0, lightings=LIGHTINGS
        ),
        "paper": Preset(
            1024, 1024, ("fairy",), METHODS, frames=1, samples=10, most=40, deviation=0.005, stage_samples=10,
            rounds=3, budget_s=30.0, timeout_s=600.0, lightings=LIGHTINGS,
        ),
    },
    draw=draw,
)  # fmt: skip
