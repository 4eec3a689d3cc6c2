"""Figure 6 of the paper: spotlights on the Fairy scene: only hit points inside them have shadow rays.

A cone, the paper's rectangle of azimuth and elevation, and a wider cone whose light falls off towards its edge.
"""

from pathlib import Path

import numpy as np

from ..harness.report import compare, document, numbers, panels
from ..harness.report.dataframe import DataFrame
from ..harness.report.picture import opened, stand_in_text
from ..harness.results.folder import image_name
from ..harness.runner.planning.experiment import Entry, Experiment
from ..harness.scene.overrides import Lighting
from ._paper import METHOD, large, small

FAIRY = (0.05, 1.25, 0.0)  # where the fairy of the stand-in hovers
FALLING, FALL_OFF = 10.0, 150.0  # half-angle, and the exponent that leaves a tenth of the light at that angle

LIGHTINGS = (
    Lighting(),
    Lighting("cone", target=FAIRY, angle=6.0),
    Lighting("rectangle", target=FAIRY, angle=9.0, rise=4.0),
    Lighting("cone-fall-off", target=FAIRY, angle=FALLING, falloff=FALL_OFF),
)
METHODS = (Entry(METHOD),)

SPOT = ["light.angle", "light.rise", "light.falloff"]
COLUMNS = [*document.COMMON, "light", "spot", *SPOT, "hit_pixels", "shadow_rays", "shadow_ray_share"]


def draw(folder: Path, quiet: bool = False) -> list[Path]:
    """The scene under each light, CSV, and what each spot saves of light grid and shadow rays."""
    frames = document.frames(folder)
    table = document.named(frames)
    is_spot = table.reindex(columns=["light.target"])["light.target"].notna()
    table[SPOT] = table.reindex(columns=SPOT).astype(float).where(is_spot, axis=0)
    table["spot"] = table["light.rise"].isna().map({True: "cone", False: "rectangle"}).where(is_spot, "")
    table["light"] = list(map(spot_text, table["spot"], *(table[name] for name in SPOT)))
    table = table.sort_values(["file", "light.falloff", "spot"], na_position="first")
    own, plain = compare.pairs(frames, frames["light_label"] == "", (*compare.SCENE, *compare.SIZE, "label"))
    for name, side in (("shadow_rays", table), ("hit_pixels", plain)):  # of all lights, as the method counted them
        table[name] = side.filter(regex=r"^counter\.light .* rays$").sum(axis=1, min_count=1)
    table["shadow_ray_share"] = table["shadow_rays"] / table["hit_pixels"]
    times = [side["light_build_ms"] + side["shadow_ms"] for side in (own, plain)]
    done = document.measured(table.assign(over_plain=times[0] / times[1]))
    pictures = [picture(own, folder, name) for name, own in table.groupby("file", sort=False)]
    spots = done[(done["spot"] != "") & done["shadow_ray_share"].notna()]
    finding = "No spot was measured beside the light that shines everywhere."
    if len(spots):
        shares = spots.groupby("light")["shadow_ray_share"].mean().map("{:.0%}".format)
        found = numbers.means(spots, "over_plain", "light")
        told = [f"a {light} leaves {shares[light]} of the hit points a shadow ray and takes {ratio} of the time"
                for light, ratio in dict([found[0], found[-1]]).items()]  # fmt: skip
        finding = (
            f"For light grid and shadow rays, {numbers.listed(told)} of a light everywhere (the paper has no times)."
        )
    return document.write(folder, EXPERIMENT, table, COLUMNS, finding, {}, pictures, quiet)


def spot_text(spot: str, angle: float, rise: float, falloff: float) -> str:
    """A light in a few words, such as "cone of 6 degrees"; angles are from side to side."""
    if not spot:
        return "everywhere"
    high = f" x {2 * rise:g}" if spot == "rectangle" else ""
    falls = f", falling off to {np.cos(np.radians(angle)) ** falloff:.0%}" if falloff else ""
    return f"{spot} of {2 * angle:g}{high} degrees{falls}"


def picture(own: DataFrame, folder: Path, name: str) -> Path | None:
    """The pictures of a scene under each light, two per row; the light is named above each, the scene below all."""
    shown = []
    for r in own.drop_duplicates("light_label").itertuples():
        image = opened(folder / "images" / image_name(r.scene, r.light_label, r.width, r.height))
        if image is not None:
            rays = f"\nshadow rays: {r.shadow_ray_share:.0%}" if r.shadow_ray_share < 1 else ""
            whole = np.asarray(image.convert("RGB"))  # below the picture itself stands its own caption
            shown.append((r.light.capitalize() + rays, whole[: round(image.width * r.height / r.width)]))
    if not shown:
        return None
    made = [stand_in_text(text) for text in own["stand_in"].unique() if text]
    about = "\n".join([f"{own['title'].iloc[0]}, {document.where(own)}", *made])
    return panels.images(folder / f"figure6-{name}.png", shown, across=2, below=about, dpi=220, colours=40)


EXPERIMENT = Experiment(
    "figure6", "Figure 6: spotlights",
    {
        "quick": small(384, ("fairy",), METHODS, 10.0, stage_samples=2, rounds=2, lightings=LIGHTINGS),
        "paper": large(("fairy",), METHODS, 20.0, most=30, stage_samples=5, lightings=LIGHTINGS),
    },
    draw,
)  # fmt: skip
