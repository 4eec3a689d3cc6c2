"""Figure 6: a scene under a light that shines everywhere and under spots: only what a spot holds has a shadow."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from ...harness.report import gallery, points, style
from ...harness.report.picture import opened, save_png
from ...harness.report.sheet import title_of

COLUMNS = [
    *points.COMMON, "spot", "spot_angle", "spot_rise", "spot_falloff", "hit_pixels", "shadow_rays", "shadow_ray_share",
]  # fmt: skip
PANEL, GAP = 330, 8
"""Pixels across one of the pictures side by side, and between them: two across fill a page's column."""


def draw(folder: Path | str, quiet: bool = False) -> list[Path]:
    """The pictures side by side, CSV and text."""
    folder = Path(folder)
    rows = points.rows(folder)
    for r in rows:
        r["shadow_rays"] = ray_count(r)
        r.update(spot_of(r))
    # The light everywhere first, then cones and rectangles, and what falls off last.
    rows.sort(key=lambda r: (r["scene"], bool(r["spot"]), r["spot_falloff"] or 0.0, r["spot"] or ""))
    add_shares(rows)
    files = [points.write_csv(rows, folder / "figure6.csv", COLUMNS)]
    sentences = []
    for scene in dict.fromkeys(r["scene"] for r in rows):
        own = [r for r in rows if r["scene"] == scene]
        sheet = panels(own, folder, folder / f"figure6-{scene}.png")
        files += [sheet] if sheet else []
        sentences += [sentence(pair) for pair in pairs(points.measured(own))]
    sentences.append("The paper shows the same effect (only the fairy's shadow) and no times.")
    return points.report(folder, "figure6", "Figure 6: spotlights", sentences, files, rows, quiet)


def spot_of(r: dict[str, Any]) -> dict[str, Any]:
    """Shape ("cone" or "rectangle", None for a light that shines everywhere), half-widths in degrees, fall-off."""
    lighting = r["record"]["scene"].get("lighting") or {}
    if not lighting.get("target"):
        return dict.fromkeys(("spot", "spot_angle", "spot_rise", "spot_falloff"))
    rise = lighting.get("rise")
    return {
        "spot": "cone" if rise is None else "rectangle",
        "spot_angle": lighting["angle"],
        "spot_rise": rise,
        "spot_falloff": lighting.get("falloff") or 0.0,
    }


def spot_text(r: dict[str, Any]) -> str:
    """A light in a few words, such as "cone of 6 degrees"; angles are from side to side."""
    if not r["spot"]:
        return "everywhere"
    size = f"{2 * r['spot_angle']:g}"
    size += f" x {2 * r['spot_rise']:g}" if r["spot_rise"] is not None else ""
    edge = np.cos(np.radians(r["spot_angle"])) ** r["spot_falloff"]
    fading = f", falling off to {edge:.0%}" if r["spot_falloff"] else ""
    return f"{r['spot']} of {size} degrees{fading}"


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
    """The same scene and method without and with each spot."""
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
            f"in it and have a shadow ray, all others have none; "
        )
    times = " and ".join(
        f"{what} {style.number(plain[key])} -> {style.number(spot[key])} ms"
        for what, key in (("light grid", "light_build_ms"), ("shadow rays", "shadow_ms"))
    )
    return f"{title_of(spot)}, {spot['label']}, {spot_text(spot)}: {rays}{times}."


def panels(rows: Sequence[dict[str, Any]], folder: Path, path: Path) -> Path | None:
    """The pictures of a scene under each light, two a row, a line under each that says which light; the scene below."""
    made = []
    for r in {r["light_label"]: r for r in rows}.values():
        name = f"{r['scene']}-{r['light_label']}" if r["light_label"] else r["scene"]
        kept = opened(folder / "images" / f"{name}.png")
        if kept is not None:
            share = r.get("shadow_ray_share")
            held = f"; shadow rays: {share:.0%}" if r["spot"] and share is not None else ""
            made.append(captioned(picture_in(kept, r), f"{spot_text(r).capitalize()}{held}"))
    if not made:
        return None
    across = min(2, len(made))
    down = -(-len(made) // across)
    high = max(m.height for m in made)
    first = rows[0]
    about = [f"{title_of(first)}, {points.where(rows)}"]
    if first["stand_in"]:
        about.append(gallery.stand_in_text(first["stand_in"]))
    line = 22
    size = (across * PANEL + (across - 1) * GAP, down * (high + GAP) + line * len(about))
    sheet = Image.new("RGB", size, gallery.PAPER)
    for i, m in enumerate(made):
        sheet.paste(m, (i % across * (PANEL + GAP), i // across * (high + GAP)))
    draw = ImageDraw.Draw(sheet)
    for i, text in enumerate(about):
        ink = gallery.WARNING if i else gallery.INK
        draw.text((4, down * (high + GAP) + i * line), text, fill=ink, font=gallery.font(17))
    return save_png(np.asarray(sheet), path, colours=40)


def picture_in(kept: Image.Image, r: dict[str, Any]) -> Image.Image:
    """A kept picture without the caption that stands below it."""
    whole = kept.convert("RGB")
    return whole.crop((0, 0, whole.width, min(whole.height, round(whole.width * r["height"] / r["width"]))))


def captioned(picture: Image.Image, text: str) -> Image.Image:
    """The picture, :data:`PANEL` pixels wide, with one line under it."""
    height = max(1, round(picture.height * PANEL / picture.width))
    small: NDArray[np.uint8] = np.asarray(picture.resize((PANEL, height), Image.Resampling.LANCZOS))
    face = gallery.fitted(text, gallery.font(18), PANEL - 8)
    panel = Image.new("RGB", (PANEL, height + 26), gallery.PAPER)
    panel.paste(Image.fromarray(small), (0, 0))
    ImageDraw.Draw(panel).text((4, height + 3), text, fill=gallery.INK, font=face)
    return panel
