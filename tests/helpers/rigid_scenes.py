"""Scenes of bodies that move rigidly, and meshes at rest whose triangles are dealt out to bodies."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from helpers.exact_answers import assert_right, exact_answers
from helpers.small_scenes import soup
from numpy.typing import NDArray
from shadowbench.harness.frame.registry import make_method
from shadowbench.harness.frame.session import Session
from shadowbench.harness.hardcases.shapes import Mesh, ball, box, joined
from shadowbench.harness.scene.prepared import Prepared, prepare
from shadowbench.harness.scene.scene import Camera, Geometry, Light, Moves, Scene

NAME = "two_level_bvh"
Pose = tuple[NDArray, NDArray]
"""A rotation [3, 3], and then a translation [3]."""

CAMERA = Camera((0.4, 1.5, 4.5), (0.0, 0.3, 0.0))
LIGHTS = (Light((2.0, 3.5, 1.0)), Light((-1.5, 0.4, 2.5)))


def turn(axis: Sequence[float], angle: float) -> NDArray:
    """The rotation about an axis by so many radians (Rodrigues' formula)."""
    x, y, z = np.asarray(axis, dtype=np.float64) / np.linalg.norm(axis)
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def moving(
    meshes: Sequence[Mesh],
    pose: Callable[[int, int], Pose],
    frames: int = 3,
    scale: float = 1.0,
    camera: Camera = CAMERA,
    lights: tuple[Light, ...] = LIGHTS,
) -> Prepared:
    """Bodies, each in its ``pose(body, frame)``. ``scale``: of all, also of the way to camera and lights."""
    points, faces = joined(*meshes)
    of = np.repeat(np.arange(len(meshes)), [len(mesh[0]) for mesh in meshes])

    def positions(frame: int) -> NDArray[np.float64]:
        poses = [pose(body, frame) for body in range(len(meshes))]
        return scale * np.concatenate(
            [points[of == body] @ rotation.T + place for body, (rotation, place) in enumerate(poses)]
        )

    eye, target = (tuple(scale * np.array(point)) for point in (camera.eye, camera.target))
    lights = tuple(light.moved(tuple(scale * np.array(light.position))) for light in lights)
    motion = Moves("rigid", bodies=of[faces[:, 0]])
    geometry = Geometry(faces.astype(np.int32), positions, frames, motion)
    return prepare(Scene("rigid", "Rigid", lambda: geometry, replace(camera, eye=eye, target=target), lights))


def tumbling(body: int, frame: int, way: Sequence[float] = (0.1, 0.05, -0.1)) -> Pose:
    """Body 0 rests; the others turn about axes of their own, and go their way."""
    if body == 0 or frame == 0:
        return np.eye(3), np.zeros(3)
    return turn((1.0, body, 2.0 - body), 0.7 * frame + 0.3 * body), frame * np.array(way) * (-1.0) ** body


GROUND = box((-3.0, -0.6, -3.0), (3.0, -0.5, 3.0))
SCENES: dict[str, Callable[[], Prepared]] = {
    "apart": lambda: moving([GROUND, ball(0.5, (-0.8, 0.4, 0.0)), ball(0.4, (0.9, 0.6, 0.3))], tumbling),
    "one body": lambda: moving([ball(0.9, (0.0, 0.4, 0.0))], lambda body, frame: tumbling(1, frame)),
    "touching": lambda: moving(
        [GROUND, box((-0.5, -0.5, -0.5), (0.5, 0.5, 0.5)), box((0.5, -0.5, -0.5), (1.5, 0.5, 0.5))],
        lambda body, frame: (turn((0.0, 1.0, 0.0), 0.4 * frame * (body > 0)), np.zeros(3)),
    ),
    "nested": lambda: moving(
        [box((-1.0, -0.4, -1.0), (1.0, 1.4, 1.0)), ball(0.8, (0.0, 0.5, 0.0)), ball(0.4, (0.0, 0.5, 0.0))],
        lambda body, frame: tumbling(body, frame, (0.0, 0.0, 0.0)),
        camera=Camera((0.3, 0.8, 0.95), (0.0, 0.5, 0.0), fov=80.0),
    ),
    "single triangles": lambda: moving(
        [GROUND, *((triangle, np.array([[0, 1, 2]])) for triangle in soup(5, 12)[0].reshape(-1, 3, 3))], tumbling
    ),
    "through one another": lambda: moving([GROUND, *(ball(0.6, (0.2 * k, 0.4, 0.1 * k)) for k in range(4))], tumbling),
}
"""By name, each of three frames."""


def dealt(prepared: Prepared, bodies: NDArray[np.integer]) -> Prepared:
    """The same mesh with these bodies."""
    return replace(prepared, geometry=replace(prepared.geometry, motion=Moves("rigid", bodies=bodies)))


def assert_exact_in_frames(
    prepared: Prepared, frames: Sequence[int], size: int = 24, device: str = "cpu", **settings: str
) -> Session:
    """The answers of one session in these frames are exact; the session."""
    session = Session(make_method(NAME, settings), prepared, size, size, device)
    for frame in frames:
        moment = prepared.moment(frame, size, size)
        assert_right(session.answers(moment), exact_answers(prepared, moment), f"in frame {frame}")
    return session
