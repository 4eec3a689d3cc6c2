"""Methods and frames as a command asks for them, and the answers of a method. A failure is reported as a status."""

import importlib
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from numpy.typing import NDArray

from ..errors import CapacityRejected, UserError
from ..frame.devices import placed_method
from ..frame.registry import method_names
from ..frame.session import Session
from ..runner.measuring.measured_point import differing, hashes, own_bytes, within
from ..runner.measuring.memory import Memory, bounded, give_back_memory, peak_resident_bytes, reset_peak_resident
from ..runner.planning.experiment import PACKAGE, Entry
from ..runner.planning.planned_point import parse_settings
from ..scene.effects import Limits
from ..scene.moment import Moment
from ..scene.prepared import Prepared
from ..scene.scene import Scene

REPEATS = 16  # times that a frame is run again to compare its answers: more than a quick run takes in a round
REPEATS_S = 2.0  # Time limit for these repeats, seconds. At least one is always done.


def entries_of(methods: Sequence[str] | None, settings: Sequence[str] | None) -> tuple[Entry, ...]:
    """The methods of ``--method``, by default all, each with what ``--set`` gives it. Raises :class:`UserError`."""
    return parse_settings(list(settings or ()), tuple(Entry(name) for name in dict.fromkeys(methods or method_names())))


def settings_by_method(texts: Sequence[str] | None) -> dict[str, dict[str, str]]:
    """What ``--set`` gives to each method. Raises :class:`UserError` for an unknown one."""
    return {entry.method: dict(entry.settings) for entry in entries_of(None, texts) if entry.settings}


def default_method(scene: Scene, device: str) -> str:
    """The first of the list of rivals; where it cannot trace the scene, the first method that can, else the former."""
    proposed: str = importlib.import_module(f"{PACKAGE}._rivals").OURS.method
    for name in (proposed, *method_names()):
        try:
            if placed_method(name, None, scene, device)[2] is None:
                return name
        except Exception:  # one broken method must not hide the others
            continue
    return proposed


def require_frame(prepared: Prepared, frame: int, scene: str) -> None:
    """Raise :class:`UserError` unless the scene has the frame."""
    if not 0 <= frame < prepared.frame_count:
        raise UserError(f"--frame {frame}: {scene} has frames 0 to {prepared.frame_count - 1}")


@dataclass(eq=False)
class Outcome:
    """The answers of a method to one frame. ``status``: ok, skipped, rejected or failed; ``answers`` is None unless ok."""

    method: str
    settings: dict[str, str]
    device: str
    status: str = "ok"
    reason: str = ""
    known_inexact: str | None = None
    answers: dict[str, NDArray] | None = None

    def facts(self, *names: str) -> dict[str, Any]:
        return {name: getattr(self, name) for name in names}


def answer(
    name: str, settings: dict[str, str], prepared: Prepared, moment: Moment, device: str,
    memory_limit: int | None = None,
) -> Outcome:  # fmt: skip
    """The answers of a method to one frame, or the reason why there are none. Errors of the method are caught.

    The frame is run again several times. A method whose answers then differ has failed. ``memory_limit`` in bytes, as in a
    run (:func:`.runner.measuring.measured_point.within`).
    """
    method, place, reason = placed_method(name, settings, prepared.scene, device)
    outcome = Outcome(name, settings, place, known_inexact=getattr(method, "known_inexact", None))
    if reason:
        return replace(outcome, status="skipped", reason=reason)
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
        if not wrong:
            return replace(outcome, answers=answers)
        reason = f"repeat {repeats} of the same frame gave different answers: {', '.join(wrong)}"
        return replace(outcome, status="failed", reason=reason)
    except CapacityRejected as error:
        return replace(outcome, status="rejected", reason=str(error))
    except Exception as error:  # the failure of one method must not hide the answers of the others
        return replace(outcome, status="failed", reason=f"{type(error).__name__}: {error}")
    finally:
        tracker.pause()
