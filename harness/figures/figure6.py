"""Figure 6: a scene under a light that shines everywhere and under a spot: only what the cone holds has a shadow."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from . import gallery, points, style
from .shade import opened, save_png
from .sheet import title_of

COLUMNS = [*points.COMMON, "hit_pixels", "shadow_rays", "shadow_ray_share"]


def draw(folder: Path | str, quiet: bool = False) -> list[Path]:
    """The pictures side by side, CSV and text."""
    folder = Path(folder)
    rows = points.rows(folder)
    for r in rows:
        r["shadow_rays"] = ray_count(r)
    add_shares(rows)
    files = [points.write_csv(rows, folder / "figure6.csv", COLUMNS)]
    sentences = []
    for scene in dict.fromkeys(r["scene"] for r in rows):
        sheet = side_by_side(
            [r for r in rows if r["scene"] == scene], folder, folder / f"figure6-{scene}.png"
        )
        files += [sheet] if sheet else []
        sentences += [sentence(pair) for pair in pairs(points.measured(rows)) if pair[0]["scene"] == scene]
    title = "Figure 6: a spotlight"
    return points.report(folder, "figure6", title, sentences, files, rows, quiet)


def ray_count(r: dict[str, Any]) -> float | None:
    """Shadow rays of a frame, mean over the frames: what the method counted."""
    counted = [v for k, v in r["counters"].items() if k.startswith("light ") and k.endswith(" rays")]
    return sum(counted) if counted else None


def add_shares(rows: Sequence[dict[str, Any]]) -> None:
    """Add how many pixels hit something (known from the light that shines everywhere), and the spot's share."""
    everywhere = {(r["scene"], r["label"]): r["shadow_rays"] for r in rows if not r["light_label"]}
    for r in rows:
        r["hit_pixels"] = everywhere.get((r["scene"], r["label"]))
        if r["hit_pixels"] and r["shadow_rays"] is not None:
            r["shadow_ray_share"] = r["shadow_rays"] / r["hit_pixels"]


def pairs(rows: Sequence[dict[str, Any]]) -> list[tuple[dict[str, Any], dict[str, Any]]]:
    """The same scene and method without and with the spot."""
    plain = {(r["scene"], r["label"]): r for r in rows if not r["light_label"]}
    spots = [r for r in rows if r["light_label"] and (r["scene"], r["label"]) in plain]
    return [(plain[r["scene"], r["label"]], r) for r in spots]


def sentence(pair: tuple[dict[str, Any], dict[str, Any]]) -> str:
    """What the spot saves."""
    plain, spot = pair
    rays = ""
    if spot.get("shadow_ray_share") is not None:
        rays = (
            f"{spot['shadow_rays']:,.0f} of {spot['hit_pixels']:,.0f} hit points ({spot['shadow_ray_share']:.0%}) lie "
            f"in the cone and have a shadow ray, all others have none; "
        )
    times = " and ".join(
        f"{what} {style.number(plain[key])} -> {style.number(spot[key])} ms"
        for what, key in (("light grid", "light_build_ms"), ("shadow rays", "shadow_ms"))
    )
    return (
        f"{title_of(spot)}, {spot['label']}: {rays}{times}. The paper shows the same effect (only the fairy's shadow) "
        f"and no times."
    )


def side_by_side(rows: Sequence[dict[str, Any]], folder: Path, path: Path) -> Path | None:
    """The pictures of a scene without and with the spot in one file, each with a line that says which it is."""
    made = []
    for label in dict.fromkeys(r["light_label"] for r in rows):
        file = folder / "images" / (f"{rows[0]['scene']}-{label}.png" if label else f"{rows[0]['scene']}.png")
        image = opened(file)
        if image is not None:
            pixels = np.asarray(image.convert("RGB"))
            made.append(gallery.captioned(pixels, "", f"Light: {label or 'everywhere'}"))
    if not made:
        return None
    height = min(m.shape[0] for m in made)
    return save_png(np.concatenate([m[:height] for m in made], axis=1), path)
