"""The answers of a method to one frame. A failure is reported as a status."""

from __future__ import annotations

from dataclasses import dataclass

from numpy.typing import NDArray

from ..errors import CapacityRejected
from ..scene.moment import Moment
from ..scene.prepared import Prepared


@dataclass(eq=False)
class Outcome:
    """The answers of a method to one frame. ``status``: ok, skipped, rejected or failed; ``answers`` is None unless ok."""

    method: str
    status: str
    reason: str = ""
    answers: dict[str, NDArray] | None = None
    known_inexact: str | None = None
    device: str = ""


def answer(name: str, settings: dict[str, str], prepared: Prepared, moment: Moment, device: str) -> Outcome:
    """The answers of a method to one frame, or the reason why there are none. Errors of the method are caught."""
    from ..frame.devices import device_for
    from ..frame.registry import make_method
    from ..frame.session import Session
    from ..runner.measure import differing, hashes

    method = make_method(name, settings)
    place = device_for(type(method), device)
    outcome = Outcome(name, "ok", known_inexact=getattr(method, "known_inexact", None), device=place)
    reason = method.applies(prepared.scene, place)
    if reason:
        outcome.status, outcome.reason = "skipped", reason
        return outcome
    try:
        session = Session(method, prepared, moment.width, moment.height, place, len(moment.lights))
        answers = session.answers(moment)
        wrong = differing(session, hashes(answers))
        if wrong:
            outcome.status, outcome.reason = (
                "failed",
                f"the same frame gave different answers when run again: {', '.join(wrong)}",
            )
        else:
            outcome.answers = answers
    except CapacityRejected as error:
        outcome.status, outcome.reason = "rejected", str(error)
    except Exception as error:  # the failure of one method must not hide the answers of the others
        outcome.status, outcome.reason = "failed", f"{type(error).__name__}: {error}"
    return outcome
