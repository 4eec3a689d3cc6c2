"""The animations of a glTF file: which values change over time, and the times of the frames. The first animation is
read, from its first key to its last. Its frames follow each other at the rate at which every key is a frame
(:func:`own_rate`), or at the rate that is asked for. Between keys, values are interpolated as the file says.
"""

import math
import re
from dataclasses import dataclass
from typing import Any

import numpy as np

from ....arrays import F64
from .accessors import Accessors
from .container import Entry
from .model import Block
from .nodes import REST, Matrices, Tree, composed

SLOWEST = 24.0  # frames a second, at least, where the keys of an animation decide

_RATES = (24.0, 25.0, 30.0, 50.0, 60.0)
_USUAL = 30.0  # rates of films and games that are tried, and the one where keys fit none of them
_NEAR = 0.01  # part of the time between two frames within which a key is at a frame: keys are rounded to float32
_FASTEST = 240.0  # frames a second, at most, where the keys decide
_SAME = 1e-4  # seconds between times that are one key's but for rounding

_MOST_FRAMES = 1 << 24

_PATHS = (*REST, "weights")
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

    name    what it is called in notes
    keys    the times of the keys of all tracks, seconds, increasing; at least one
    rate    frames a second
    count   number of frames; the first is at the first key
    """

    name: str
    tracks: tuple[Track, ...]
    keys: F64
    rate: float
    count: int

    @property
    def moving(self) -> set[int]:
        """The places of the nodes that it moves."""
        return {track.place for track in self.tracks if track.path != "weights"}

    def time(self, frame: int) -> float:
        """The time of a frame, seconds. A frame that is at a key but for rounding has its very time."""
        time = float(self.keys[0]) + frame / self.rate
        nearest = float(self.keys[np.abs(self.keys - time).argmin()])
        return nearest if abs(nearest - time) * self.rate <= _NEAR else time

    def local(self, tree: Tree, time: float) -> Matrices:
        """The transforms of all nodes to their parents at a time."""
        places = sorted(self.moving)
        columns = {path: values[places] for path, values in tree.parts.items()}
        for track in self.tracks:
            if track.path != "weights":
                columns[track.path][places.index(track.place)] = track.at(time)
        result = tree.local.copy()
        result[places] = composed(**columns)
        return result

    def weights(self, time: float) -> dict[int, F64]:
        """The weights of morph targets at a time, of each node that has a track for them."""
        return {track.place: track.at(time) for track in self.tracks if track.path == "weights"}


def first_animation(accessors: Accessors, tree: Tree, blocks: list[Block], rate: float | None) -> Animation | None:
    """The first animation of the file; None where there is none or it moves no block.

    rate  frames a second that are asked for; None: :func:`own_rate`
    """
    file = accessors.file
    if not file.all("animations"):
        return None
    carrying = tree.above({place for block in blocks for place in block.movers})
    targets: dict[int, int] = {}
    for block in blocks:
        targets[block.place] = max(targets.get(block.place, 0), len(block.vertices.targets))
    entry = file.entry("animations", 0)
    entry.refuse_unknown()
    samplers = entry.items("samplers")
    tracks: dict[tuple[int, str], Track] = {}
    for channel in entry.entries("channels", "a channel"):
        node, path = _aim(channel) or (-1, "")
        place = tree.place.get(node, -1)
        width = targets.get(place, 0) if path == "weights" else len(REST[path]) if place in carrying else 0
        if not width:
            continue
        moved = tree.entries[place]
        if (place, path) in tracks:
            raise entry.error(f"has two channels for the {path} of {moved.name}")
        if path != "weights" and "matrix" in moved:
            raise entry.error(f"moves {moved.name}, which has a matrix")
        sampler = entry.named("sampler", channel.get("sampler"), samplers)
        tracks[place, path] = _track(accessors, Entry(file.path, entry.name, sampler.values), place, path, width)
    if not tracks:
        return None
    keys = np.unique(np.concatenate([track.times for track in tracks.values()]))
    # Times that differ by rounding only are those of one key.
    keys = keys[np.concatenate([[True], np.diff(keys) > _SAME])]
    chosen = own_rate(keys) if rate is None else rate
    count = (keys[-1] - keys[0]) * chosen + _NEAR
    if count >= _MOST_FRAMES:
        problem = f"has {count:.3g} frames at {chosen:g} a second"
        raise entry.error(problem, "shorten it, or give a lower --rate")
    return Animation(entry.title(), tuple(tracks.values()), keys, chosen, int(count) + 1)


def own_rate(keys: F64) -> float:
    """Frames a second at which every key is a frame, at least :data:`SLOWEST`. The lowest such rate of: a whole
    multiple of the rate of evenly spaced keys, and the usual ones. Where there is none, about 30 a second, so that the
    last key is a frame.
    """
    length, since = keys[-1] - keys[0], keys - keys[0]
    if not length > 0.0:
        return _USUAL
    even = round(length / np.diff(keys).min()) / length
    rates = [even * max(1, math.ceil(SLOWEST / even - _NEAR)), *_RATES]
    fitting = [rate for rate in rates if (np.abs(since * rate - np.round(since * rate)) <= _NEAR).all()]
    found = min(fitting) if fitting and min(fitting) <= _FASTEST else math.ceil(length * _USUAL) / length
    return float(round(found)) if abs(found - round(found)) < 1e-3 else found


def aimed(animation: Entry) -> list[tuple[Any, str]]:
    """The nodes and the paths that an animation moves."""
    return [aim for channel in animation.entries("channels", "a channel") if (aim := _aim(channel))]


def _aim(channel: Entry) -> tuple[Any, str] | None:
    """Node and path that a channel moves; None for what is not drawn. Raises :class:`UserError` for odd pointers."""
    target = channel.object("target")
    target.refuse_unknown()
    said, path = target.extension("KHR_animation_pointer"), target.get("path")
    if said is None and path in _PATHS:
        return target.get("node"), path
    pointer = said.get("pointer") if said is not None else None
    if isinstance(pointer, str) and (match := _POINTER.fullmatch(pointer)):
        return int(match[1]), match[2]
    if isinstance(pointer, str) and _NOT_DRAWN.match(pointer):
        return None
    raise channel.error(f"animates {pointer or path!r}, which cannot be read", "leave it out")


def _track(accessors: Accessors, sampler: Entry, place: int, path: str, width: int) -> Track:
    """A sampler's keys and values. ``width``: numbers of one value."""
    how = sampler.get("interpolation", "LINEAR")
    if how not in ("LINEAR", "STEP", "CUBICSPLINE"):
        raise sampler.error(f"has the interpolation {how!r}")
    times = accessors.floats(sampler, "input", 1)[:, 0].astype(np.float64)
    if not len(times) or not np.isfinite(times).all() or (np.diff(times) <= 0).any():
        raise sampler.error(": the times of its keys do not increase")
    each = 3 if how == "CUBICSPLINE" else 1
    values = accessors.floats(sampler, "output", 1 if path == "weights" else width).astype(np.float64)
    if values.size != len(times) * each * width:
        problem = f"has {values.size} numbers for {len(times)} keys of the {path}"
        raise sampler.error(f"{problem}, not {len(times) * each * width}")
    if not np.isfinite(values).all():
        raise sampler.error(f": a value of the {path} is not finite")
    values = values.reshape((len(times), each, width) if each == 3 else (len(times), width))
    if path == "rotation" and each == 1:
        length = np.linalg.norm(values, axis=1, keepdims=True)
        values = values / np.where(length > 0.0, length, 1.0)
    return Track(place, path, times, values, how)
