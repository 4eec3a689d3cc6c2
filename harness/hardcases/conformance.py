"""Requirements on every method apart from right answers: sequences of frames, graph replays and allocations.

``shadowbench check`` tests them after the hard cases, which test single frames (right answers, every answer written, two
runs with the same bits).
"""

import re
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from ..arrays import F64
from ..frame.method import Method
from ..frame.session import Session
from ..scene.effects import Effects
from ..scene.moment import Moment
from ..scene.prepared import Prepared, prepare
from ..scene.scene import Camera, Geometry, Light, Scene, Spot
from .judge import same_bits
from .shapes import ball, joined, quad

SIZE = (33, 26)
FRAMES = 4


@dataclass
class Check:
    """One requirement. ``status``: ok, exempt (with the reason), or error."""

    name: str
    status: str = "ok"
    reason: str = ""

    def as_json(self) -> dict[str, Any]:
        return asdict(self)


def moving_scene() -> Prepared:
    """A ball that falls onto a floor, is squashed, and flies away in the last frame; two lights."""
    points, faces = joined(quad((-3, 0, -3), (3, 0, -3), (3, 0, 3), (-3, 0, 3)), ball(0.5, (0, 0.6, 0)))

    def positions(frame: int) -> F64:
        result = points.copy()
        result[4:] *= (1 + 0.3 * frame, 1 - 0.25 * frame, 1 + 0.1 * frame)
        result[4:] += (0.2 * frame, 0.4 if frame == 1 else 0.0, -0.3 * frame)
        if frame == FRAMES - 1:
            result[4:] *= 40.0  # buffers must grow
        return result

    lights = (Light((1.0, 2.5, 0.5)), Light((-0.7, 0.3, 0.9)))
    scene = Scene(
        "moving", "Moving", lambda: Geometry(faces.astype(np.int32), positions, FRAMES),
        Camera((0.3, 1.7, 3.1), (0.2, 1.25, 2.1)), lights,
    )  # fmt: skip
    return prepare(scene)


def moments(prepared: Prepared) -> list[Moment]:
    """Every frame of the mesh, then one in which camera and lights have also moved, then the first one again."""
    width, height = SIZE
    found = [prepared.moment(k, width, height) for k in range(FRAMES)]
    elsewhere = prepared.moment(
        1, width, height, Camera((-2.0, 0.4, -1.5), (0.0, 0.5, 0.0)), (Light((0, 40, 3)), Light((0.0, 0.05, 0.0)))
    )
    return [*found, elsewhere, found[0]]


def conformance(make_method: Callable[[], Method], device: str) -> list[Check]:
    prepared = moving_scene()
    reason = make_method().applies(prepared.scene, device)
    names = ("frames", "graph replays", "allocations", "shadows not asked for", "partial frames")
    if reason:
        return [Check(name, "exempt", reason) for name in names]
    checks = []
    for name, test in zip(names, (_frames, _replays, _allocations, _unasked, _partial), strict=True):
        try:
            checks.append(test(name, make_method, prepared, device))
        except Exception as error:  # any exception is a finding of the check
            checks.append(Check(name, "error", f"{type(error).__name__}: {error}"))
    return checks


def _session(make_method: Callable[[], Method], prepared: Prepared, device: str) -> Session:
    return Session(make_method(), prepared, *SIZE, device)


def _unlike(some: dict[str, NDArray], others: dict[str, NDArray]) -> list[str]:
    return [name for name in some if not same_bits(some[name], others[name])]


def _frames(name: str, make_method: Callable[[], Method], prepared: Prepared, device: str) -> Check:
    """Frame k of a session has the same bits as the only frame of a new session: no buffer holds outdated data."""
    session = _session(make_method, prepared, device)
    for k, moment in enumerate(moments(prepared)):
        unlike = _unlike(session.answers(moment), _session(make_method, prepared, device).answers(moment))
        if unlike:
            return Check(name, "error", f"frame {k} differs from a fresh session in {', '.join(unlike)}")
    return Check(name)


def _partial(name: str, make_method: Callable[[], Method], prepared: Prepared, device: str) -> Check:
    """A frame made from the last one, by running only the passes whose inputs changed, has the bits of a complete frame.

    This tests that passes declare correctly what they read and write, and that no buffer is shared by mistake. It is
    repeated with a spotlight that has no receivers in some frames: skipped work must be done later.
    """
    found = _in_turns(name, make_method, prepared, device, _turns(prepared))
    spotted = _spotted(make_method, prepared, device)
    if found.status == "ok" and spotted is not None:
        found = _in_turns(name, make_method, spotted, device, _turns_away())
    return found


Turn = tuple[str, tuple[int, Camera | None, tuple[Light, ...]]]

SPOTTED = (Light((1.0, 2.5, 0.5), spot=Spot((-1.0, -2.0, -0.5), 40.0)), Light((-0.7, 0.3, 0.9)))


def _spotted(make_method: Callable[[], Method], prepared: Prepared, device: str) -> Prepared | None:
    """The scene with a spotlight and shadow rays only where surfaces face a light; None if the method has no receivers."""
    scene = replace(prepared.scene, lights=SPOTTED, facing=True)
    return prepare(scene) if make_method().applies(scene, device) is None else None


def _turns(prepared: Prepared) -> list[Turn]:
    """Moments in which one input after the other changes: (frame, camera, lights)."""
    view, lights = Camera((-2.0, 0.4, -1.5), (0.0, 0.5, 0.0)), prepared.scene.lights
    moved = (lights[0].moved((0, 40, 3)), *lights[1:])
    return [
        ("the camera moved", (0, view, lights)),
        ("light 0 moved", (0, view, moved)),
        ("light 1 moved", (0, view, (moved[0], lights[1].moved((0.0, 0.05, 0.0))))),
        ("the mesh moved", (1, view, moved)),
        ("nothing moved", (1, view, moved)),
        ("everything moved", (0, None, lights)),
    ]


def _turns_away() -> list[Turn]:
    """Spotlight and mesh move while the camera sees no receiver of the spotlight; then the camera looks back."""
    away = Camera((0.3, 1.7, 3.1), (0.3, 30.0, 3.2))
    moved = (SPOTTED[0].moved((0.8, 2.8, 0.7)), SPOTTED[1])
    return [
        ("the camera looked away", (0, away, SPOTTED)),
        ("the spot moved unseen", (0, away, moved)),
        ("the camera looked back", (0, None, moved)),
        ("the camera looked away again", (0, away, moved)),
        ("the mesh moved unseen", (1, away, moved)),
        ("the camera looked back again", (1, None, moved)),
    ]


def _in_turns(
    name: str, make_method: Callable[[], Method], prepared: Prepared, device: str, turns: list[Turn]
) -> Check:
    """Compare partial frames in sequence with complete frames of new sessions."""
    session = _session(make_method, prepared, device)
    width, height = SIZE
    session.answers(prepared.moment(0, width, height))
    for label, (frame, camera, placed) in turns:
        moment = prepared.moment(frame, width, height, camera, placed)
        session.advance(moment)
        wp.synchronize_device(device)
        unlike = _unlike(session.frame.answers.to_host(), _session(make_method, prepared, device).answers(moment))
        if unlike:
            return Check(name, "error", f"after {label}: {', '.join(unlike)} differ from a complete frame")
    return Check(name)


def _replays(name: str, make_method: Callable[[], Method], prepared: Prepared, device: str) -> Check:
    """A captured graph gives the bits of plain launches, also after points, camera and lights have moved.

    This is repeated with a spotlight, whose passes the graph skips if it has no receivers.
    """
    found = _replayed(name, make_method, prepared, device, moments(prepared))
    spotted = _spotted(make_method, prepared, device)
    if found.status == "ok" and spotted is not None:
        unseen = [spotted.moment(frame, *SIZE, camera, lights) for _, (frame, camera, lights) in _turns_away()]
        found = _replayed(name, make_method, spotted, device, unseen)
    return found


def _replayed(
    name: str, make_method: Callable[[], Method], prepared: Prepared, device: str, shown: list[Moment]
) -> Check:
    """Run each moment by plain launches, then all of them again by graph replays."""
    session = _session(make_method, prepared, device)
    if not session.replays:
        captures = session.method.capturable
        return Check(name, "exempt", "there are graphs on CUDA only" if captures else "not capturable")
    wanted = [(moment, session.answers(moment)) for moment in shown]
    for k, (moment, eager) in enumerate(wanted):
        session.load(moment)
        session.replay_complete()
        wp.synchronize_device(device)
        unlike = _unlike(session.frame.answers.to_host(), eager)
        if unlike:
            return Check(name, "error", f"frame {k} as a graph differs in {', '.join(unlike)}")
    return Check(name)


def _allocations(name: str, make_method: Callable[[], Method], prepared: Prepared, device: str) -> Check:
    """A frame that runs again, as it is timed, allocates no memory through Warp, on any device.

    On CUDA this is a replay of the graph: a scan or a sort that is launched eagerly allocates scratch memory each time,
    while a graph owns the memory that it captured.
    """
    session = _session(make_method, prepared, device)
    if not session.method.capturable:
        return Check(name, "exempt", "not capturable")
    session.answers(moments(prepared)[0])
    session.replay()
    count, text = counted_allocations(session.replay)
    if count:
        return Check(name, "error", f"{count} allocations in a frame after the first: {text}")
    return Check(name)


def _unasked(name: str, make_method: Callable[[], Method], prepared: Prepared, device: str) -> Check:
    """Lights without shadows do not change the closest hits, and their shadow bits are 0."""
    moment = moments(prepared)[0]
    both = _session(make_method, prepared, device).answers(moment)
    one = Session(make_method(), prepared, *SIZE, device, effects=Effects(shadows=(False, True))).answers(moment)
    both["shadowed"][0] = 0
    unlike = _unlike(one, both)
    return Check(name, "error", f"without light 0's shadows {', '.join(unlike)} differ") if unlike else Check(name)


def counted_allocations(work: Callable[[], None]) -> tuple[int, str]:
    """Number of allocations that ``work`` makes through Warp, including Warp's native code, and where."""
    reports: list[str] = []
    with wp.ScopedMemoryTracker("frame", report_func=reports.append) as tracker:
        tracker.clear()
        work()
    totals = reports[-1].partition("Total allocations:")[2].partition("Peak usage:")[0]
    count = sum(int(number) for number in re.findall(r"^\s+\S+\s+(\d+) \(", totals, re.MULTILINE))
    places = re.findall(r"^\s+[\d.]+ \w+ : \S+ : (.+)$", reports[-1], re.MULTILINE)
    return count, "; ".join(places[:3]) or "freed again"
