"""Sequences of frames in which meshes, lights and cameras go through what breaks structures that remember: drawn by a seed.

Meshes hold NaN for a frame, lose triangles and get them back, collapse into a plane, a line or a point and unfold, grow
and shrink by powers of two. Lights cross seams and hulls, and stand on vertices, edges, faces and at the eye; cameras
fly through geometry, stand on it, and look away. Also the first frame may be such a one.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from shadowbench.harness.hardcases.shapes import Mesh, ball, icosphere, joined, quad, sheet, soup
from shadowbench.harness.scene.moment import Moment
from shadowbench.harness.scene.overrides import perforated
from shadowbench.harness.scene.prepared import Prepared, prepare
from shadowbench.harness.scene.scene import Camera, Geometry, Light, Scene, Spot

F64 = NDArray[np.float64]

SIZE = (12, 10)

CHANGES = ("not a number", "vanish", "point", "line", "plane", "grow", "shrink", "move", "squash")
MESH_EVENTS = ("as it is",) * 4 + CHANGES
LIGHT_EVENTS = ("as it is", "anywhere", "seam", "vertex", "edge", "face", "hull", "eye", "far", "within")
CAMERA_EVENTS = ("as it is",) * 2 + ("through", "vertex", "edge", "face", "within", "away", "far", "anywhere")

HOME = np.array([0.3, 1.7, 3.1]), np.array([0.1, 0.4, 0.0])
"""Eye and target from which a camera sets out."""

SEAM_STEP = 2.0**-20
"""How far beside a coordinate plane through the middle of a light's map a light stands when it crosses one."""


@dataclass(frozen=True, eq=False)
class Story:
    """The moments of one scene in their order, each with what happens in it."""

    prepared: Prepared
    labels: list[str]
    moments: list[Moment]


def draw_mesh(random: np.random.Generator) -> Mesh:
    floor = quad((-3, 0, -3), (3, 0, -3), (3, 0, 3), (-3, 0, 3))
    kind = random.integers(4)
    if kind == 0:
        mesh = joined(floor, ball(0.5, (0, 0.6, 0)), soup(int(random.integers(1000)), 8, 0.3))
    elif kind == 1:
        mesh = joined(icosphere(1), floor)
    elif kind == 2:
        heights = 2.0 + random.integers(-4, 5, (6, 6)) / 16
        mesh = joined(sheet(np.linspace(-1, 1, 6), np.linspace(-1, 1, 6), heights), ball(0.25, (0, 0, -0.5), 4, 5))
    else:
        mesh = soup(int(random.integers(1000)), 40, 0.5)
    return mesh[0].astype(np.float32).astype(np.float64), mesh[1]


def changed(random: np.random.Generator, points: F64, faces: NDArray[np.int64], event: str) -> F64:
    """The mesh in one frame."""
    points = points.copy()
    some = random.uniform(size=len(points)) < random.choice([0.1, 0.5, 1.0])
    middle = points[random.integers(len(points))].copy()
    if event == "not a number":
        points[some, random.integers(3)] = random.choice([np.nan, np.inf, -np.inf])
    elif event == "vanish":
        gone = faces[random.uniform(size=len(faces)) < random.choice([0.2, 0.8])]
        points[gone[:, 1]] = points[gone[:, 0]]
    elif event == "point":
        points[:] = middle
    elif event == "line":
        points[:, 1:] = middle[1:]
    elif event == "plane":
        axis = random.integers(3)
        points[:, axis] = middle[axis]
    elif event in ("grow", "shrink"):
        points *= 2.0 ** (random.integers(3, 30) * (1 if event == "grow" else -1))
    elif event == "move":
        points[some] += random.normal(size=3)
    elif event == "squash":
        points[some] *= random.uniform(0.01, 3, 3)
    return points.astype(np.float32).astype(np.float64)


def on_mesh(random: np.random.Generator, points: F64, faces: NDArray[np.int64], where: str) -> F64:
    """A point exactly on a vertex, or as exactly as float32 holds it on an edge or in a face, that is finite."""
    corners = points[faces[random.integers(len(faces))]]
    weights = {"vertex": (1, 0, 0), "edge": (0.5, 0.5, 0), "face": (0.5, 0.25, 0.25)}[where]
    place = np.float64(weights) @ np.where(np.isfinite(corners), corners, 0.0)
    return place.astype(np.float32).astype(np.float64)


def light_at(random: np.random.Generator, event: str, now: F64, eye: F64, points: F64, faces: NDArray) -> F64:
    finite = np.where(np.isfinite(points), points, 0.0)
    low, high = finite.min(axis=0), finite.max(axis=0)
    if event == "anywhere":
        return random.normal(size=3) * 3
    if event == "seam":
        place = (low + high) / 2
        place[random.integers(3)] += 2.0
        place[random.integers(3)] += random.choice([-1, 0, 1]) * SEAM_STEP
        return place
    if event in ("vertex", "edge", "face"):
        return on_mesh(random, points, faces, event)
    if event == "hull":
        place = random.uniform(low, high)
        axis = random.integers(3)
        place[axis] = random.choice([low[axis], high[axis]])
        return place
    if event == "eye":
        return eye
    if event == "far":
        return now / max(1e-3, float(np.linalg.norm(now))) * 10.0 ** random.integers(3, 9)
    return (low + high) / 2 if event == "within" else now


def camera_at(
    random: np.random.Generator, event: str, eye: F64, target: F64, points: F64, faces: NDArray
) -> tuple[F64, F64]:
    if event == "through":  # along one way, a step further each time
        return eye + 0.25 * (target - eye), target + 0.25 * (target - eye)
    if event in ("vertex", "edge", "face"):
        return on_mesh(random, points, faces, event), target
    if event == "within":
        return np.array([0.0, 0.5, 0.0]), target
    if event == "away":
        return eye, eye + np.array([0.1, 30.0, 0.2])
    if event == "far":
        return eye * 2.0 ** random.integers(4, 16), np.zeros(3)
    if event == "anywhere":
        return random.normal(size=3) * 2, random.normal(size=3) * 0.5
    return eye, target


def drawn(random: np.random.Generator, events: Sequence[str], count: int, every: bool) -> list[str]:
    """So many events. ``every``: in an order of their own, so that each comes as soon as there is room for it."""
    if not every:
        return [str(event) for event in random.choice(events, count)]
    ordered = random.permutation(list(dict.fromkeys(events))).tolist()
    return [ordered[i % len(ordered)] for i in range(count)]


def called_for(random: np.random.Generator, scene: Scene) -> Scene:
    """The scene with some effects: spots, directional lights, facing, holes, mirrors, an orthographic camera."""
    chosen = random.uniform(size=6) < (0.5, 0.3, 0.3, 0.3, 0.4, 0.3)
    lights = list(scene.lights)
    if chosen[0]:
        lights[0] = replace(lights[0], spot=Spot((0.0, -1.0, 0.0), float(random.choice([10.0, 40.0, 120.0]))))
    elif chosen[1]:
        lights[-1] = replace(lights[-1], directional=True)
    scene = replace(scene, lights=tuple(lights), facing=bool(chosen[2]))
    if chosen[3]:
        every, holes = int(random.integers(1, 4)), int(random.choice([1, 2, 5]))
        scene = replace(scene, alpha=lambda geometry: perforated(geometry, every, holes))
    if chosen[4]:
        share = int(random.integers(2, 5))
        scene = replace(scene, bounces=int(random.integers(1, 3)), mirror=lambda geometry: mirrors(geometry, share))
    if chosen[5]:
        scene = replace(scene, camera=replace(scene.camera, height=float(random.choice([1.0, 3.0]))))
    return scene


def mirrors(geometry: Geometry, share: int) -> NDArray[np.uint8]:
    """One triangle in ``share`` is a mirror."""
    return (np.arange(len(geometry.faces)) % share == 0).astype(np.uint8)


def lamp_at(light: Light, place: F64, target: F64) -> Light:
    """A light in another place; its spot points at ``target``."""
    if light.spot is None:
        return replace(light, position=vector(place if np.abs(place).any() or not light.directional else HOME[0]))
    way = target - place
    way = way if np.abs(way).max() > 1e-20 else np.array([0.0, -1.0, 0.0])
    return replace(light, position=vector(place), spot=replace(light.spot, direction=vector(way)))


def draw_story(
    seed: int, frames: int, still: bool = False, size: tuple[int, int] = SIZE, every: bool = False,
    effects: bool = False,
) -> Story:  # fmt: skip
    """A story of so many frames.

    ``still``: its mesh does not move, for trees that are built once. ``every``: no event comes twice before every other
    one of its kind came once. ``effects``: the scene calls for some, for which kernels are compiled.
    """
    random = np.random.default_rng(seed)
    points, faces = draw_mesh(random)
    events = drawn(random, MESH_EVENTS, frames, every)
    if random.uniform() < 0.6:
        events[0] = "as it is"
    meshes = [points if still else changed(random, points, faces, event) for event in events]
    geometry = Geometry(faces.astype(np.int32), lambda k: meshes[k], frames)
    if still:
        geometry = Geometry.static(points, faces)
    lights: tuple[F64, ...] = tuple(random.normal(size=3) * 2 + (0, 2, 0) for _ in range(random.integers(1, 3)))
    shining = [drawn(random, LIGHT_EVENTS, frames, every) for _ in lights]
    views = drawn(random, CAMERA_EVENTS, frames, every)
    eye, target = HOME
    scene = Scene(
        "story", "Story", lambda: geometry, Camera(vector(eye), vector(target)), tuple(Light(vector(p)) for p in lights)
    )  # fmt: skip
    prepared = prepare(called_for(random, scene) if effects else scene)
    labels, moments = [], []
    for frame in range(frames):
        now = meshes[frame] - prepared.centre
        eye, target = camera_at(random, views[frame], eye, target, now, faces)
        if not np.abs(target - eye).max() > 1e-6 * max(1.0, float(np.abs(eye).max())):
            target = eye + np.array([0.0, 0.25, -1.0])
        events_now = [events[frame] for events in shining]
        lights = tuple(
            light_at(random, event, place, eye, now, faces) for event, place in zip(events_now, lights, strict=True)
        )
        seen = replace(prepared.scene.camera, up=(0.1, 1.0, 0.23))
        camera = replace(seen, eye=vector(eye + prepared.centre), target=vector(target + prepared.centre))
        lamps = tuple(
            lamp_at(light, place + prepared.centre, np.array([0.0, 0.3, 0.0]))
            for light, place in zip(prepared.scene.lights, lights, strict=True)
        )
        moments.append(prepared.moment(0 if still else frame, *size, camera, lamps))
        mesh = "still" if still else events[frame]
        labels.append(f"mesh {mesh}, camera {views[frame]}, lights {', '.join(events_now)}")
        if np.abs(eye).max() > 1e9 or views[frame] == "away" or random.uniform() < 0.2:
            eye, target = HOME
    return Story(prepared, labels, moments)


def vector(values: Sequence[float] | F64) -> tuple[float, float, float]:
    x, y, z = (float(one) for one in values)
    return x, y, z
