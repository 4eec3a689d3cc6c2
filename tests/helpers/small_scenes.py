"""Small scenes to try methods on; the answers of a frame, and whether two are the same."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from shadowbench.harness.frame.registry import make_method
from shadowbench.harness.frame.session import Session
from shadowbench.harness.scene.effects import Limits
from shadowbench.harness.scene.moment import Moment
from shadowbench.harness.scene.prepared import Prepared, prepare
from shadowbench.harness.scene.scene import Camera, Geometry, Light, Scene


def make_scene(
    vertices: NDArray,
    faces: NDArray,
    lights: list[tuple[float, float, float] | Light],
    eye: tuple[float, float, float] = (0.3, 0.2, 3.0),
    target: tuple[float, float, float] = (0.0, 0.0, 0.0),
    fov: float = 60.0,
    up: tuple[float, float, float] = (0.0, 1.0, 0.0),
    **more: Any,
) -> Prepared:
    """A static scene ready to trace. ``more``: other fields of :class:`Scene`."""
    points, triangles = (np.asarray(vertices, np.float64).reshape(-1, 3), np.asarray(faces, np.int32).reshape(-1, 3))
    return prepare(
        Scene(
            "test",
            "test",
            lambda: Geometry.static(points, triangles),
            Camera(eye, target, up, fov),
            tuple(at if isinstance(at, Light) else Light(at) for at in lights),
            **more,
        )
    )


def soup(seed: int, count: int, size: float = 0.4, spread: float = 1.0) -> tuple[NDArray, NDArray]:
    """Random triangles of mixed sizes around the origin."""
    random = np.random.default_rng(seed)
    centre = random.uniform(-spread, spread, (count, 1, 3))
    arms = random.normal(size=(count, 3, 3)) * size * np.exp(random.uniform(-3, 0.7, (count, 1, 1)))
    return (centre + arms).reshape(-1, 3), np.arange(3 * count).reshape(-1, 3)


Answers = dict[str, NDArray]


def trace(
    name: str, settings: dict[str, str], prepared: Prepared, width: int, height: int, device: str = "cpu",
    limits: Limits | None = None,
) -> tuple[Session, Moment, Answers]:  # fmt: skip
    """One frame of a method, with the session and the moment it was traced at."""
    session = Session(make_method(name, settings), prepared, width, height, device, limits=limits)
    moment = prepared.moment(0, width, height)
    return session, moment, session.answers(moment)


def assert_same(got: Answers, wanted: Answers, what: object = "") -> None:
    """Every bit of every answer."""
    for key, values in wanted.items():
        np.testing.assert_array_equal(got[key], values, f"{key} {what}")


def answers_in(session: Session) -> Answers:
    """What the last frame of a session has answered."""
    return session.frame.answers.to_host()
