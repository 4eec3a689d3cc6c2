"""Images from files, each as a data address: figures, pictures of scenes, maps of counts and of errors."""

import base64
import io
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from PIL import Image

from ...errors import warn
from ...files import open_regular, read_regular
from ...judge.verdict import ERRORS, MEANINGS, Verdict
from ...results.pixel_maps import OFFSET, map_path, wrong_path
from .. import document
from ..dataframe import DataFrame
from ..document import Source
from ..picture import UNREADABLE, answered_path, reference_path

LARGEST = 1024  # most pixels per side of a picture on the page
ROOM = 5_000_000  # bytes for all figures, pictures and maps together; files beyond that are listed on the page
LARGEST_FILE = 64 << 20  # bytes of a file that is read to be shown as it is

TYPES = {".svg": "image/svg+xml", ".png": "image/png", ".webp": "image/webp"}


class Album:
    """Files as data addresses, within a number of bytes. ``left_out``: names of what did not fit or could not be read."""

    def __init__(self, room: int = ROOM):
        self.room = room
        self.left_out: list[str] = []

    def add(self, content: bytes, suffix: str, name: str) -> str | None:
        """The address; None where it does not fit."""
        text = base64.b64encode(content).decode("ascii")
        if len(text) > self.room:
            self.left_out.append(name)
            return None
        self.room -= len(text)
        return f"data:{TYPES[suffix]};base64,{text}"

    def file(self, path: Path) -> str | None:
        """A file as it is."""
        try:
            return self.add(read_regular(path, LARGEST_FILE), path.suffix, f"{path.parent.name}/{path.name}")
        except OSError as error:
            warn(f"{path}: cannot be read ({error.strerror}), left out")
            self.left_out.append(f"{path.parent.name}/{path.name}")
            return None


def figures(places: Mapping[str, Path], album: Album) -> list[dict[str, Any]]:
    """The drawings of each folder, by its name, SVG before PNG."""
    return [
        {"folder": folder, "name": path.name, "uri": uri}
        for folder, place in places.items()
        for path in sorted(place.glob("*.svg")) + sorted(place.glob("*.png"))
        if (uri := album.file(path))
    ]


def opened(path: Path) -> Image.Image | None:
    """A picture as RGB; None if there is none, or if it is damaged, with a message."""
    if not path.is_file():
        return None
    try:
        with open_regular(path) as stream, Image.open(stream) as image:
            return image.convert("RGB")
    except UNREADABLE as error:
        warn(f"{path}: not a whole picture ({error}), left out")
        return None


def shared_palette(images: Sequence[Image.Image]) -> Image.Image:
    """At most 256 colours for pictures of one size that are compared: a pixel that is equal in two of them stays equal."""
    sheet = Image.new("RGB", (images[0].width * len(images), images[0].height))
    for place, image in enumerate(images):
        sheet.paste(image, (place * images[0].width, 0))
    return sheet.quantize(256, method=Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE)


def compact(image: Image.Image, palette: Image.Image | None = None) -> bytes:
    """A picture as lossless WebP of at most 256 colours, those of ``palette`` if it is given."""
    scale = min(1.0, LARGEST / max(image.size))
    if scale < 1.0:
        image = image.resize((round(image.width * scale), round(image.height * scale)), Image.Resampling.BOX)
    palette = palette or shared_palette([image])
    small = image.quantize(palette=palette, dither=Image.Dither.NONE).convert("RGB")
    stream = io.BytesIO()
    small.save(stream, "WEBP", lossless=True, quality=90, method=4)
    return stream.getvalue()


def gallery(sources: Sequence[Source], album: Album) -> list[dict[str, Any]]:
    """Scenes with pictures: of each the reference, what points answered where that looks otherwise, and wrong pixels."""
    made = []
    for name, place, frames in sources:
        if not (place / "images").is_dir():
            continue
        table = document.named(frames)
        used: set[Path] = set()
        for (scene, _, _), own in table.groupby(["scene", "width", "height"], sort=False):
            frames_shown = sorted({int(f) for numbers in own["frame_numbers"] for f in numbers})
            entries = (compared(name, place, scene, frame, own, album, used) for frame in frames_shown)
            made += [entry for entry in entries if entry]
        for path in sorted((place / "images").glob("*.png")):
            whole = None if path in used or path.stem.endswith(("-reference", "-answered")) else opened(path)
            if whole is None:
                continue
            uri = album.add(compact(whole), ".webp", f"{name}/images/{path.name}")
            rows = table[[path.stem == s or path.stem.startswith(f"{s}-") for s in table["scene"]]]
            title = rows["title"].iloc[0] if len(rows) else path.stem
            if uri:
                made.append({"folder": name, "title": title, "frame": None, "pictures": [
                    {"label": "with shadows", "uri": uri, "point": None}]})  # fmt: skip
    return made


def compared(
    name: str, place: Path, scene: str, frame: int, own: DataFrame, album: Album, used: set[Path]
) -> dict[str, Any] | None:
    """The reference's picture of a frame, and those of points whose wrong pixels were mapped; None where there is none."""
    path = reference_path(place, scene, frame)
    right = opened(path)
    if right is None:
        return None
    used.add(path)
    rows = [row for row in own[["key", "label", "true_errors", "error"]].to_dict("records")
            if wrong_path(place, row["key"], frame).is_file()]  # fmt: skip
    answered = {row["key"]: opened(answered_path(place, row["key"], frame)) for row in rows}
    palette = shared_palette([right, *(image for image in answered.values() if image is not None)])
    uri = album.add(compact(right, palette), ".webp", f"{name}/images/{path.name}")
    if uri is None:
        return None
    pictures = [{"label": "reference (exact)", "uri": uri, "classes": None, "wrong": 0}]
    for row in rows:
        image = answered[row["key"]]  # None: it looks like the reference's
        shown = uri if image is None else album.add(compact(image, palette), ".webp", f"{row['label']}, {scene}")
        if shown is None:
            continue
        wrong = row["true_errors"]
        pictures.append({
            "label": row["label"], "uri": shown, "key": row["key"], "error": row["error"],
            "classes": album.file(wrong_path(place, row["key"], frame)) if wrong == wrong and wrong else None,
            "wrong": None if wrong != wrong else int(wrong),
        })  # fmt: skip
    width, height = right.size
    return {"folder": name, "title": own["title"].iloc[0], "frame": frame, "width": width, "height": height,
            "pictures": pictures}  # fmt: skip


def maps(sources: Sequence[Source], album: Album) -> list[dict[str, Any]]:
    """Maps of tests per pixel: of each folder and scene those that were saved."""
    made = []
    for name, place, frames in sources:
        if not (place / "maps").is_dir():
            continue
        table = document.named(frames)
        for (title, _, _), own in table.groupby(["title", "width", "height"], sort=False):
            found = [
                {"label": row["label"], "frame": int(frame), "uri": uri, "key": row["key"]}
                for row in own[["key", "label", "frame_numbers"]].to_dict("records")
                for frame in row["frame_numbers"]
                if (path := map_path(place, row["key"], int(frame))).is_file() and (uri := album.file(path))
            ]
            if found:
                made.append({"folder": name, "title": title, "width": int(own["width"].iloc[0]),
                             "height": int(own["height"].iloc[0]), "maps": found})  # fmt: skip
    return made


def legend() -> list[dict[str, Any]]:
    """The classes that a map of wrong pixels may hold, by their number in the file."""
    return [
        {"value": int(kind) + OFFSET, "name": kind.label, "meaning": re.sub(r"\s+", " ", MEANINGS.get(kind, "")),
         "wrong": kind in ERRORS}
        for kind in Verdict
    ]  # fmt: skip
