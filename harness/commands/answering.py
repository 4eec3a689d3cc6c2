"""The answers of a method to one frame. A failure is reported as a status."""

import time
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


REPEATS = 16
"""Number of times that a frame is run again and its answers are compared: more than a quick run takes in a round."""

REPEATS_S = 2.0
"""Time limit for these repeats, seconds. At least one is always done."""


def answer(
    name: str,
    settings: dict[str, str],
    prepared: Prepared,
    moment: Moment,
    device: str,
    memory_limit: int | None = None,
) -> Outcome:
    """The answers of a method to one frame, or the reason why there are none. Errors of the method are caught.

    The frame is run again several times. A method whose answers then differ has failed. ``memory_limit`` in bytes, as in a
    run (:func:`.runner.measuring.measured_point.within`).
    """
    from ..frame.devices import placed_method
    from ..frame.session import Session
    from ..runner.measuring.measured_point import differing, hashes, own_bytes, within
    from ..runner.measuring.memory import Memory, bounded, give_back_memory, peak_resident_bytes, reset_peak_resident
    from ..scene.effects import Limits

    method, place, reason = placed_method(name, settings, prepared.scene, device)
    outcome = Outcome(name, "ok", known_inexact=getattr(method, "known_inexact", None), device=place)
    if reason:
        outcome.status, outcome.reason = "skipped", reason
        return outcome
    limits = Limits() if memory_limit is None else Limits(memory_limit)
    give_back_memory()
    tracker = Memory()
    tracker.start()
    try:
        with bounded(limits.memory, own_bytes(prepared, moment.width, moment.height)):
            session = Session(method, prepared, moment.width, moment.height, place, len(moment.lights), limits=limits)
            answers = session.answers(moment)
            within(limits, tracker, session)
            reset_peak_resident()
            known, deadline, repeats = hashes(answers), time.monotonic() + REPEATS_S, 0
            wrong: list[str] = []
            while not wrong and repeats < REPEATS and (not repeats or time.monotonic() < deadline):
                wrong = differing(session, known)
                repeats += 1
            within(limits, tracker, session, peak_resident_bytes())
            if wrong:
                outcome.status, outcome.reason = (
                    "failed",
                    f"repeat {repeats} of the same frame gave different answers: {', '.join(wrong)}",
                )
            else:
                outcome.answers = answers
    except CapacityRejected as error:
        outcome.status, outcome.reason = "rejected", str(error)
    except Exception as error:  # the failure of one method must not hide the answers of the others
        outcome.status, outcome.reason = "failed", f"{type(error).__name__}: {error}"
    finally:
        tracker.pause()
    return outcome
