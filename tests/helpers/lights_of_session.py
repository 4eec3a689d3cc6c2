"""The lights of a method that streams triangles over their rays, as a session has planned them."""

from typing import Any

from shadowbench.harness.frame.session import Session


def placings_of_session(session: Session) -> list[Any]:
    """What places the rays of each light that has shadows, in their order."""
    return [work.launch.__self__ for work in session.planned if work.name.endswith("map rays")]


def lights_of_session(session: Session) -> list[Any]:
    """The rays of each light that has shadows, in their order."""
    return [placing.rays for placing in placings_of_session(session)]
