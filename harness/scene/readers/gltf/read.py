"""Reads glTF 2.0 files, ``.glb`` and ``.gltf``: vertices at a time, displaced by morph targets, then moved by their
node or bent by a skin; cameras and lights (KHR_lights_punctual) in the first frame. Both look along -z of their node.
Intensities in candela and lux become shares: pictures know no distance.
"""

import dataclasses
import itertools
import math
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ....arrays import F64, I32, Floats
from ...scene import Camera, Light, Spot, Vector
from ..checks import ALL, Loaded, Wanted, checked, guarded, some
from .accessors import Accessors
from .animation import Animation, aimed, first_animation
from .container import Entry, File, MissingError, counted, refuse_required
from .model import Block, Model
from .nodes import Matrices, Tree
from .primitives import Vertices

MOST_POSITIONS = 1 << 27  # largest number of vertices of all frames together: 3 GiB

MOST_FRAMES = 1 << 14
"""Largest number of frames that are read: each takes about half a millisecond, however little moves."""

_BLOCK = 1 << 16  # vertices that are bent at a time


class Frames:
    """Positions at any time. What no animation moves is computed once.

    first  the transforms of all nodes to the scene at the first time
    """

    def __init__(self, model: Model, tree: Tree, animation: Animation | None, time: float) -> None:
        self._tree, self._animation = tree, animation
        self._levels = tree.moved(animation.moving if animation else set())
        moved = {int(place) for places in self._levels for place in places}
        bending = set(animation.weights(time)) if animation else set()
        self._bent = bending | {block.place for block in model.blocks if block.skin is not None}
        self._moving = [one for one in model.blocks if one.place in bending or not moved.isdisjoint(one.movers)]
        self.first, weights = self._pose(time)
        stored = animation is None and all(self._as_stored(block) for block in model.blocks)
        self.points: Floats = np.empty((model.vertex_count, 3), np.float32 if stored else np.float64)
        _write(self.points, model.blocks, self.first, weights)

    def at(self, time: float) -> Floats:
        """Positions [vertex_count, 3] at a time."""
        result = self.points.copy()
        _write(result, self._moving, *self._pose(time))
        return result

    def bodies(self) -> I32 | None:
        """What each vertex moves with: 0, the scene, or its node's number; None where skins or morph targets bend one."""
        if any(block.place in self._bent for block in self._moving):
            return None
        result = np.zeros(len(self.points), dtype=np.int32)
        for block in self._moving:
            result[block.start : block.start + block.count] = 1 + block.place
        return result

    def _pose(self, time: float) -> tuple[Matrices, Mapping[int, F64]]:
        """The transforms of all nodes to the scene, and the weights of morph targets that are animated."""
        if self._animation is None:
            return self._tree.world, {}
        local = self._animation.local(self._tree, time)
        return self._tree.posed(local, self._levels), self._animation.weights(time)

    def _as_stored(self, block: Block) -> bool:
        plain = block.skin is None and not any(block.weights) and block.vertices.positions.dtype == np.float32
        return plain and bool((block.matrices(self._tree.world) == np.eye(4)).all())


def _write(result: Floats, blocks: list[Block], world: Matrices, weights: Mapping[int, F64]) -> None:
    for block in blocks:
        points = _displaced(block.vertices, weights.get(block.place, block.weights))
        part = result[block.start : block.start + block.count]
        if block.skin is not None:
            _bent(points, block.vertices, block.skin.matrices(world), part)
        else:
            _transformed(points, block.matrices(world), part.reshape(len(block.instances), -1, 3))


def _displaced(vertices: Vertices, weights: Sequence[float] | NDArray) -> Floats:
    """Positions [count, 3] with each target's displacement times its weight; float64 where there is one."""
    result: Floats = vertices.positions
    with np.errstate(over="ignore", invalid="ignore"):
        for target, weight in zip(vertices.targets, weights, strict=False):
            if target is not None and weight:
                result = result + np.multiply(target, weight, dtype=np.float64)
    return result


def _transformed(points: Floats, matrices: Matrices, result: Floats) -> None:
    """Write transforms of points to ``result`` [matrix_count, point_count, 3]; unmoved ones stay bit for bit."""
    with np.errstate(over="ignore", invalid="ignore"):
        if (matrices == np.eye(4)).all():
            result[:] = points
            return
        exact = points.astype(np.float64)
        for k in range(0, len(matrices), step := max(1, _BLOCK // max(1, len(points)))):
            some = matrices[k : k + step]
            result[k : k + step] = exact @ some[:, :3, :3].transpose(0, 2, 1) + some[:, None, :3, 3]


def _bent(points: Floats, vertices: Vertices, joints: Matrices, result: Floats) -> None:
    """Write the points, each moved by the weighted mean of its joints' transforms, into ``result`` [count, 3]. Weights
    need not add up to 1: in homogeneous coordinates, as renderers have them, their sum divides out. A point without any
    weight follows its first joint.
    """
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        for k in range(0, len(points), _BLOCK):
            some = slice(k, k + _BLOCK)
            weights = vertices.weights[some].astype(np.float64)
            weights[~weights.any(axis=1), :1] = 1.0
            places = np.where(weights != 0.0, vertices.joints[some], 0)
            sums = np.zeros((len(weights), 3, 4))
            for i in range(weights.shape[1]):
                sums += weights[:, i, None, None] * joints[places[:, i], :3]
            own = points[some].astype(np.float64)
            moved = np.einsum("vij,vj->vi", sums[:, :, :3], own) + sums[:, :, 3]
            result[some] = moved / weights.sum(axis=1, keepdims=True)


_LIGHTS = "KHR_lights_punctual"
_BRIGHTEST = 1e12


def cameras(file: File, tree: Tree, world: Matrices) -> dict[str, Camera]:
    """The cameras of the scene by the names of their nodes. One that has no view, such as one of zero size, is left out."""
    found: dict[str, Camera] = {}
    for node, matrix in zip(tree.entries, world, strict=True):
        if "camera" in node:
            own = file.named(node, node.get("camera"), "cameras")
            camera = _camera(own, matrix)
            if camera is not None:
                found[_name(found, "camera", node, own)] = camera
    return found


def lights(file: File, tree: Tree, world: Matrices) -> dict[str, Light]:
    """The lights of the scene's visible nodes by the names of these. One that shines nowhere is left out."""
    found: dict[str, Light] = {}
    listed = file.head.extension(_LIGHTS)
    known = [] if listed is None else Entry(file.path, _LIGHTS, listed.values).items("lights")
    for node, matrix, shown in zip(tree.entries, world, tree.shown, strict=True):
        said = node.extension(_LIGHTS)
        if said is not None and shown:
            own = node.named("light", said.get("light"), known)
            light = _light(own, matrix)
            if light is not None:
                found[_name(found, "light", node, own)] = light
    return found


def moving(file: File, tree: Tree) -> list[str]:
    """A note if the first animation moves cameras and lights."""
    aims = aimed(Entry(file.path, "an animation", file.all("animations")[0])) if file.all("animations") else []
    places = {tree.place[node] for node, path in aims if path != "weights" and node in tree.place}
    below = [tree.entries[place] for level in tree.moved(places) for place in level]
    count = sum("camera" in node or _LIGHTS in node.get("extensions", {}) for node in below)
    return [f"moving cameras and lights read at the first frame: {count}"] if count else []


def _camera(entry: Entry, matrix: F64) -> Camera | None:
    parallel = entry.get("type") == "orthographic"
    lens = entry.get("orthographic" if parallel else "perspective")
    size = lens.get("ymag" if parallel else "yfov") if isinstance(lens, dict) else None
    if not isinstance(size, int | float) or not 0.0 < size < (1e30 if parallel else math.pi):
        return None
    forward, up, place = _unit(-matrix[:3, 2]), _unit(matrix[:3, 1]), matrix[:3, 3]
    if forward is None or up is None or not np.isfinite(place).all():
        return None
    # So far away that rounding leaves the direction as it is.
    eye, target = _vector(place), _vector(place + forward * max(1.0, np.abs(place).max()))
    if parallel:
        return Camera(eye, target, _vector(up), height=2.0 * size)
    return Camera(eye, target, _vector(up), math.degrees(size))


def _light(entry: Entry, matrix: F64) -> Light | None:
    kind, place, forward = entry.get("type"), matrix[:3, 3], _unit(-matrix[:3, 2])
    r, g, b = (min(max(x, 0.0), _BRIGHTEST) for x in entry.numbers("color", (1.0, 1.0, 1.0)))
    strength = min(max(entry.number("intensity", 1.0), 0.0), _BRIGHTEST)
    if kind == "directional":
        return None if forward is None else Light(_vector(-forward), True, (r, g, b), strength, None, True)
    if not np.isfinite(place).all():
        return None
    if kind == "point":
        return Light(_vector(place), True, (r, g, b), strength)
    angle = math.degrees(entry.object("spot").number("outerConeAngle", math.pi / 4))
    if kind != "spot" or forward is None or not 0.0 < angle <= 180.0:
        return None
    return Light(_vector(place), True, (r, g, b), strength, Spot(_vector(forward), angle))


def _unit(vector: F64) -> F64 | None:
    """The direction of a vector; None where it has none."""
    largest = np.abs(vector).max()
    if not 0.0 < largest < np.inf:
        return None
    vector = vector / largest
    return vector / np.linalg.norm(vector)


def _vector(values: F64) -> Vector:
    x, y, z = (float(value) + 0.0 for value in values)  # without negative zeros
    return x, y, z


def _name(taken: Collection[str], what: str, *entries: Entry) -> str:
    """The first name among some entries; with a number where it is taken."""
    names = (" ".join(name.split()) for entry in entries if isinstance(name := entry.get("name"), str))
    first = next(filter(None, names), what)
    numbered = (f"{first} {number}" for number in itertools.count(2))
    return next(name for name in itertools.chain([first], numbered) if name not in taken)


def read_gltf(path: Path, wanted: Wanted = ALL) -> Loaded:
    """All triangles of the default scene, and the wanted frames of its first animation. In glTF, y is up. Positions are
    float32 if all stand as the file stores them, else float64. Raises :class:`UserError` for extensions that may change
    what is drawn and cannot be read, for counts that exceed the file, and for files outside its folder.
    """
    with guarded(path, "glTF"):
        file = File(path)
        accessors = Accessors(file)
        refuse_required(file.head)
        tree = Tree(file)
        model = Model(accessors, tree, wanted.allow_missing)
        notes = list(model.notes)
        try:
            animation = first_animation(accessors, tree, model.blocks, wanted.rate)
        except MissingError:
            if not wanted.allow_missing:
                raise
            animation = None
            notes.append("animation left out, whose data are in a missing file")
        chosen = wanted.chosen(path, animation.count if animation else 1)
        if len(chosen) > MOST_FRAMES or len(chosen) * model.vertex_count > MOST_POSITIONS:
            problem = f"has {len(chosen)} frames of {model.vertex_count} vertices, more than memory may hold"
            raise file.error(problem, "choose some of them: --frames A:B:STEP")
        times = [animation.time(k) if animation else 0.0 for k in chosen]
        frames = Frames(model, tree, animation, times[0])
        mesh = checked(path, frames.points, model.faces(), (0.0, 1.0, 0.0))
        bodies = frames.bodies() if len(times) > 1 else None
        return dataclasses.replace(
            mesh, frames=(*mesh.frames, *(frames.at(time) for time in times[1:])),
            rate=animation.rate / chosen.step if animation and len(times) > 1 else None,
            bodies=None if bodies is None else bodies[mesh.faces[:, 0]], files=tuple(file.files),
            notes=(*notes, *_notes(file, model, animation, len(times)), *moving(file, tree)),
            cameras=cameras(file, tree, frames.first), lights=lights(file, tree, frames.first),
        )  # fmt: skip


def _notes(file: File, model: Model, animation: Animation | None, frames: int) -> list[str]:
    """What of the file is not drawn, or drawn in another way. ``frames``: how many are read."""
    found = []
    scenes, animations = (
        [file.entry(name, i) for i in range(len(file.all(name)))] for name in ("scenes", "animations")
    )
    left = [scene.title() for i, scene in enumerate(scenes) if i != file.head.get("scene", 0)]
    left += [entry.title() for i, entry in enumerate(animations) if i or animation is None]
    if animation is not None:
        part = f", {frames} of its {animation.count} frames" if frames < animation.count else ""
        speed = f"at {animation.rate:.4g} frames a second{part}" if animation.count > 1 else "has one key"
        found.append(f"{animation.name} {speed}")
    if left:
        found.append(f"{some(left, 5)} left out")
    materials, textures = file.all("materials"), file.head.items("textures")
    used = [materials[i] for i in model.materials if 0 <= i < len(materials)]
    if used:
        more = f" and {counted(len(textures), 'texture')}" if textures else ""
        found.append(f"{counted(len(used), 'material')}{more} left out")
    holes = sum(values.get("alphaMode") in ("MASK", "BLEND") for values in used)
    if holes:
        found.append(f"{counted(holes, 'material')} with transparency drawn opaque")
    return found
