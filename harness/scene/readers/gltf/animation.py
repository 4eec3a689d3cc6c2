"""The animations of a glTF file: which values change over time, and the times of the frames.

The first animation is read, from its first key to its last. Its frames follow each other at the rate at which every key is a
frame (:func:`own_rate`), or at the rate that is asked for. Between keys, values are interpolated as the file says.
"""

import math
import re
from dataclasses import dataclass
from typing import Any

import numpy as np

from ....arrays import F64
from .accessors import Accessors
from .document import Document, Entry, titled
from .extensions import refuse_unknown
from .nodes import Matrices, Tree, composed

SLOWEST = 24.0
"""Frames a second, at least, where the keys of an animation decide."""

_RATES = (24.0, 25.0, 30.0, 50.0, 60.0)
_USUAL = 30.0
"""Rates of films and games that are tried, and the one where keys fit none of them."""

_NEAR = 0.01
"""Part of the time between two frames within which a key is at a frame: keys are rounded to float32."""

_FASTEST = 240.0
"""Frames a second, at most, where the keys decide."""

_SAME = 1e-4
"""Seconds between times that are one key's but for rounding."""

_MOST_FRAMES = 1 << 24

_PATHS = ("translation", "rotation", "scale", "weights")
_POINTER = re.compile(r"/nodes/(\d+)/(translation|rotation|scale|weights)")
_NOT_DRAWN = re.compile(r"/(materials|cameras|extensions/KHR_lights_punctual|animations)/")


@dataclass(frozen=True, eq=False)
class Track:
    """One value of a node over time.

    place   of the node in the tree
    path    translation, rotation, scale or weights
    times   of its keys, seconds, increasing
    values  [key_count, n]; of cubic splines [key_count, 3, n]: in-tangent, value, out-tangent
    """

    place: int
    path: str
    times: F64
    values: F64
    interpolation: str

    def at(self, time: float) -> F64:
        """The value [n] at a time; before the first key and after the last it stays."""
        i = int(np.searchsorted(self.times, time, side="right")) - 1
        last = len(self.times) - 1
        cubic = self.interpolation == "CUBICSPLINE"
        if i < 0 or i >= last or self.interpolation == "STEP" or time == self.times[i]:
            found = self.values[min(max(i, 0), last)]
            return found[1] if cubic else found
        length = self.times[i + 1] - self.times[i]
        t = (time - self.times[i]) / length
        if not cubic:
            mix = _turned if self.path == "rotation" else _between
            return mix(self.values[i], self.values[i + 1], t)
        (_, start, leaving), (arriving, end, _) = self.values[i], self.values[i + 1]
        return (
            (2 * t**3 - 3 * t**2 + 1) * start
            + (t**3 - 2 * t**2 + t) * length * leaving
            + (3 * t**2 - 2 * t**3) * end
            + (t**3 - t**2) * length * arriving
        )


def _between(a: F64, b: F64, t: float) -> F64:
    return (1.0 - t) * a + t * b


def _turned(a: F64, b: F64, t: float) -> F64:
    """The rotation between two quaternions along the shorter way, at constant speed."""
    cosine = float(a @ b)
    if cosine < 0.0:
        b, cosine = -b, -cosine
    if not cosine < 1.0 - 1e-12:
        return _between(a, b, t)
    angle = math.acos(cosine)
    return (math.sin((1.0 - t) * angle) * a + math.sin(t * angle) * b) / math.sin(angle)


@dataclass(frozen=True, eq=False)
class Animation:
    """Tracks that move what is drawn, and the times of its frames.

    name   what it is called in notes
    keys   the times of the keys of all tracks, seconds, increasing; at least one
    rate   frames a second
    count  number of frames; the first is at the first key
    """

    name: str
    tracks: tuple[Track, ...]
    keys: F64
    rate: float
    count: int

    def time(self, frame: int) -> float:
        """The time of a frame, seconds. A frame that is at a key but for rounding has its very time."""
        time = float(self.keys[0]) + frame / self.rate
        nearest = float(self.keys[np.abs(self.keys - time).argmin()])
        return nearest if abs(nearest - time) * self.rate <= _NEAR else time

    def moving(self) -> set[int]:
        """The places of the nodes that it moves."""
        return {track.place for track in self.tracks if track.path != "weights"}

    def local(self, tree: Tree, time: float) -> Matrices:
        """The transforms of all nodes to their parents at a time."""
        places = sorted(self.moving())
        row = {place: i for i, place in enumerate(places)}
        columns = {path: values[places] for path, values in tree.parts.items()}
        for track in self.tracks:
            if track.path != "weights":
                columns[track.path][row[track.place]] = track.at(time)
        result = tree.local.copy()
        result[places] = composed(**columns)
        return result

    def weights(self, time: float) -> dict[int, F64]:
        """The weights of morph targets at a time, of each node that has a track for them."""
        return {track.place: track.at(time) for track in self.tracks if track.path == "weights"}


def first_animation(
    document: Document,
    accessors: Accessors,
    tree: Tree,
    carrying: set[int],
    targets: dict[int, int],
    rate: float | None,
) -> Animation | None:
    """The first animation of the file; None where there is none or it moves nothing that is drawn.

    carrying  places of the nodes whose transforms move what is drawn
    targets   of the nodes whose meshes have morph targets: how many
    rate      frames a second that are asked for; None: :func:`own_rate`
    """
    if not document.all("animations"):
        return None
    entry, where = document.all("animations")[0], "animation 0"
    refuse_unknown(document, entry, where)
    samplers = document.items(entry, "samplers", where)
    tracks: dict[tuple[int, str], Track] = {}
    for channel in document.items(entry, "channels", where):
        aim = _aim(document, channel, where)
        place, path = (tree.place.get(aim[0], -1), aim[1]) if aim else (-1, "")
        if not (place in targets if path == "weights" else place in carrying):
            continue
        if (place, path) in tracks:
            raise document.error(f"{where} has two channels for the {path} of node {tree.nodes[place]}")
        if path != "weights" and "matrix" in tree.entry(place):
            raise document.error(f"{where} moves node {tree.nodes[place]}, which has a matrix")
        index = channel.get("sampler")
        if type(index) is not int or not 0 <= index < len(samplers) or not isinstance(samplers[index], dict):
            raise document.error(f"{where} names sampler {index!r}, but there are {len(samplers)}")
        width = targets[place] if path == "weights" else len(tree.parts[path][0])
        tracks[place, path] = _track(document, accessors, samplers[index], place, path, width)
    if not tracks:
        return None
    keys = np.unique(np.concatenate([track.times for track in tracks.values()]))
    # Times that differ by rounding only are those of one key.
    keys = keys[np.concatenate([[True], np.diff(keys) > _SAME])]
    chosen = own_rate(keys) if rate is None else rate
    count = (keys[-1] - keys[0]) * chosen + _NEAR
    if count >= _MOST_FRAMES:
        problem = f"{where} has {count:.3g} frames at {chosen:g} a second"
        raise document.error(problem, "shorten it, or give a lower --rate")
    return Animation(titled(entry, "animation", 0), tuple(tracks.values()), keys, chosen, int(count) + 1)


def own_rate(keys: F64) -> float:
    """Frames a second at which every key is a frame, at least :data:`SLOWEST`.

    The lowest such rate of: a whole multiple of the rate of evenly spaced keys, and the usual ones. Where there is none,
    about 30 a second, so that the last key is a frame.
    """
    length, since = keys[-1] - keys[0], keys - keys[0]
    if not length > 0.0:
        return _USUAL
    even = round(length / np.diff(keys).min()) / length
    rates = [even * max(1, math.ceil(SLOWEST / even - _NEAR)), *_RATES]
    fitting = [rate for rate in rates if (np.abs(since * rate - np.round(since * rate)) <= _NEAR).all()]
    found = min(fitting) if fitting and min(fitting) <= _FASTEST else math.ceil(length * _USUAL) / length
    return float(round(found)) if abs(found - round(found)) < 1e-3 else found


def aimed(document: Document, animations: list[Entry]) -> list[tuple[Any, str]]:
    """The nodes and the paths that animations move."""
    channels = [channel for entry in animations for channel in document.items(entry, "channels", "an animation")]
    return [aim for channel in channels if (aim := _aim(document, channel, "an animation"))]


def _aim(document: Document, channel: Any, where: str) -> tuple[Any, str] | None:
    """The node and the path that a channel moves; None for what is not drawn or belongs to no node.

    Raises :class:`UserError` for a pointer to something else that may be drawn.
    """
    if not isinstance(channel, dict):
        raise document.error(f"{where}: a channel is not an object")
    target = document.object(channel, "target", where)
    refuse_unknown(document, target, where)
    said = document.extension(target, "KHR_animation_pointer", where)
    path = target.get("path")
    if said is None and path in _PATHS:
        return target.get("node"), path
    pointer = said.get("pointer") if said is not None else None
    if isinstance(pointer, str) and (match := _POINTER.fullmatch(pointer)):
        return int(match[1]), match[2]
    if isinstance(pointer, str) and _NOT_DRAWN.match(pointer):
        return None
    raise document.error(f"{where} animates {pointer or path!r}, which cannot be read", "leave it out")


def _track(document: Document, accessors: Accessors, sampler: Entry, place: int, path: str, width: int) -> Track:
    """A sampler's keys and values. ``width``: numbers of one value."""
    where = "animation 0"
    how = sampler.get("interpolation", "LINEAR")
    if how not in ("LINEAR", "STEP", "CUBICSPLINE"):
        raise document.error(f"{where} has the interpolation {how!r}")
    times = accessors.floats(sampler.get("input"), where, 1)[:, 0].astype(np.float64)
    if not len(times) or not np.isfinite(times).all() or (np.diff(times) <= 0).any():
        raise document.error(f"{where}: the times of its keys do not increase")
    each = 3 if how == "CUBICSPLINE" else 1
    stored = accessors.floats(sampler.get("output"), where, 1 if path == "weights" else width)
    values = stored.astype(np.float64)
    if values.size != len(times) * each * width:
        problem = f"{where} has {values.size} numbers for {len(times)} keys of the {path}"
        raise document.error(f"{problem}, not {len(times) * each * width}")
    if not np.isfinite(values).all():
        raise document.error(f"{where}: a value of the {path} is not finite")
    values = values.reshape((len(times), each, width) if each == 3 else (len(times), width))
    if path == "rotation" and each == 1:
        length = np.linalg.norm(values, axis=1, keepdims=True)
        values = values / np.where(length > 0.0, length, 1.0)
    return Track(place, path, times, values, how)
