"""Answers of methods: of one frame, and compared bit for bit."""

import numpy as np
from numpy.typing import NDArray
from shadowbench.harness.frame.registry import make_method
from shadowbench.harness.frame.session import Session
from shadowbench.harness.scene.effects import Limits
from shadowbench.harness.scene.moment import Moment
from shadowbench.harness.scene.prepared import Prepared

Answers = dict[str, NDArray]


def trace(
    name: str,
    settings: dict[str, str],
    prepared: Prepared,
    width: int,
    height: int,
    device: str = "cpu",
    limits: Limits | None = None,
) -> tuple[Session, Moment, Answers]:
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
