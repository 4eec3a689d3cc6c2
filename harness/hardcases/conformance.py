"""Requirements on every method apart from right answers: sequences of frames, graph replays and allocations.
``shadowbench check`` tests them after the hard cases, which test single frames (right answers, every answer written,
two runs with the same bits).
"""

import re
from collections.abc import Callable, Iterable
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
from .shapes import ball_on_floor

SIZE = (33, 26)
FRAMES = 4

LIGHTS = (Light((1.0, 2.5, 0.5)), Light((-0.7, 0.3, 0.9)))
SPOTTED = (replace(LIGHTS[0], spot=Spot((-1.0, -2.0, -0.5), 40.0)), LIGHTS[1])
ELSEWHERE, AWAY = Camera((-2.0, 0.4, -1.5), (0.0, 0.5, 0.0)), Camera((0.3, 1.7, 3.1), (0.3, 30.0, 3.2))

Answers = dict[str, NDArray]


@dataclass
class Check:
    """One requirement. ``status``: ok, exempt (with the reason), or error."""

    name: str
    status: str = "ok"
    reason: str = ""

    def as_json(self) -> dict[str, Any]:
        return asdict(self)


class ExemptError(Exception):
    """A requirement does not apply, for a reason."""


def moving_scene() -> Prepared:
    """A ball that falls onto a floor, is squashed, and flies away in the last frame; two lights."""
    points, faces = ball_on_floor()

    def positions(frame: int) -> F64:
        result = points.copy()
        result[4:] *= (1 + 0.3 * frame, 1 - 0.25 * frame, 1 + 0.1 * frame)
        result[4:] += (0.2 * frame, 0.4 if frame == 1 else 0.0, -0.3 * frame)
        if frame == FRAMES - 1:
            result[4:] *= 40.0  # buffers must grow
        return result

    geometry = Geometry(faces.astype(np.int32), positions, FRAMES)
    return prepare(Scene("moving", "Moving", lambda: geometry, Camera((0.3, 1.7, 3.1), (0.2, 1.25, 2.1)), LIGHTS))


def moments(prepared: Prepared) -> list[Moment]:
    """Every frame of the mesh, then one in which camera and lights have also moved, then the first one again."""
    found = [prepared.moment(k, *SIZE) for k in range(FRAMES)]
    return [*found, prepared.moment(1, *SIZE, ELSEWHERE, (Light((0, 40, 3)), Light((0.0, 0.05, 0.0)))), found[0]]


Turn = tuple[str, int, Camera | None, tuple[Light, ...]]  # what changed, and a moment


def turns() -> list[Turn]:
    """Moments in which one input after the other changes."""
    one = (LIGHTS[0].moved((0, 40, 3)), LIGHTS[1])
    both = (one[0], LIGHTS[1].moved((0.0, 0.05, 0.0)))
    return [
        ("the camera moved", 0, ELSEWHERE, LIGHTS), ("light 0 moved", 0, ELSEWHERE, one),
        ("light 1 moved", 0, ELSEWHERE, both), ("the mesh moved", 1, ELSEWHERE, one),
        ("nothing moved", 1, ELSEWHERE, one), ("everything moved", 0, None, LIGHTS),
    ]  # fmt: skip


def turns_away() -> list[Turn]:
    """Spotlight and mesh move while the camera sees no receiver of the spotlight; then the camera looks back."""
    moved = (SPOTTED[0].moved((0.8, 2.8, 0.7)), SPOTTED[1])
    return [
        ("the camera looked away", 0, AWAY, SPOTTED),
        ("the spot moved unseen", 0, AWAY, moved),
        ("the camera looked back", 0, None, moved),
        ("the camera looked away again", 0, AWAY, moved),
        ("the mesh moved unseen", 1, AWAY, moved),
        ("the camera looked back again", 1, None, moved),
    ]


def conformance(make_method: Callable[[], Method], device: str) -> list[Check]:
    tried = Tried(make_method, device, moving_scene())
    exempt = tried.make_method().applies(tried.prepared.scene, device)
    requirements = {
        "frames": tried.frames, "graph replays": tried.replays, "allocations": tried.allocations,
        "shadows not asked for": tried.unasked, "partial frames": tried.partial,
    }  # fmt: skip
    return [Check(name, "exempt", exempt) if exempt else checked(name, test) for name, test in requirements.items()]


def checked(name: str, test: Callable[[], str]) -> Check:
    try:
        wrong = test()
    except ExemptError as reason:
        return Check(name, "exempt", str(reason))
    except Exception as error:  # any exception is a finding of the check
        wrong = f"{type(error).__name__}: {error}"
    return Check(name, "error", wrong) if wrong else Check(name)


@dataclass(frozen=True, eq=False)
class Tried:
    """A method on a device and a moving scene. Each requirement gives what is wrong, or nothing."""

    make_method: Callable[[], Method]
    device: str
    prepared: Prepared

    def session(self, effects: Effects | None = None) -> Session:
        return Session(self.make_method(), self.prepared, *SIZE, self.device, effects=effects)

    def spotted(self) -> "Tried | None":
        """With a spotlight and shadow rays only where surfaces face a light; None if the method has no receivers."""
        scene = replace(self.prepared.scene, lights=SPOTTED, facing=True)
        able = self.make_method().applies(scene, self.device) is None
        return replace(self, prepared=prepare(scene)) if able else None

    def given(self, session: Session) -> Answers:
        """The answers of a frame that has just been run."""
        wp.synchronize_device(self.device)
        return session.frame.answers.to_host()

    def frames(self) -> str:
        """Frame k of a session has the same bits as the only frame of a new session: no buffer holds outdated data."""
        session = self.session()
        for k, moment in enumerate(moments(self.prepared)):
            if unlike := differing(session.answers(moment), self.session().answers(moment)):
                return f"frame {k} differs from a fresh session in {unlike}"
        return ""

    def partial(self) -> str:
        """A frame made from the last one, by running only the passes whose inputs changed, has the bits of a complete
        frame.

        This tests that passes declare correctly what they read and write, and that no buffer is shared by mistake. It is
        repeated with a spotlight that has no receivers in some frames: skipped work must be done later.
        """
        spotted = self.spotted()
        return self.in_turns(turns()) or (spotted.in_turns(turns_away()) if spotted else "")

    def in_turns(self, given: Iterable[Turn]) -> str:
        """Compare partial frames in sequence with complete frames of new sessions."""
        session = self.session()
        session.answers(self.prepared.moment(0, *SIZE))
        for label, frame, camera, lights in given:
            moment = self.prepared.moment(frame, *SIZE, camera, lights)
            session.advance(moment)
            if unlike := differing(self.given(session), self.session().answers(moment)):
                return f"after {label}: {unlike} differ from a complete frame"
        return ""

    def replays(self) -> str:
        """A captured graph gives the bits of plain launches, also after points, camera and lights have moved. This is
        repeated with a spotlight, whose passes the graph skips if it has no receivers.
        """
        spotted = self.spotted()
        wrong = self.replayed(moments(self.prepared))
        if wrong or not spotted:
            return wrong
        return spotted.replayed([spotted.prepared.moment(k, *SIZE, seen, lit) for _, k, seen, lit in turns_away()])

    def replayed(self, shown: list[Moment]) -> str:
        """Run each moment by plain launches, then all of them again by graph replays."""
        session = self.session()
        if not session.replays:
            raise ExemptError("there are graphs on CUDA only" if session.method.capturable else "not capturable")
        wanted = [(moment, session.answers(moment)) for moment in shown]
        for k, (moment, eager) in enumerate(wanted):
            session.load(moment)
            session.replay_complete()
            if unlike := differing(self.given(session), eager):
                return f"frame {k} as a graph differs in {unlike}"
        return ""

    def allocations(self) -> str:
        """A frame that runs again, as it is timed, allocates no memory through Warp, on any device. On CUDA this is a
        replay of the graph: a scan or a sort that is launched eagerly allocates scratch memory each time, while a graph
        owns the memory that it captured.
        """
        session = self.session()
        if not session.method.capturable:
            raise ExemptError("not capturable")
        session.answers(moments(self.prepared)[0])
        session.replay()
        count, text = counted_allocations(session.replay)
        return f"{count} allocations in a frame after the first: {text}" if count else ""

    def unasked(self) -> str:
        """Lights without shadows do not change the closest hits, and their shadow bits are 0."""
        moment = moments(self.prepared)[0]
        both = self.session().answers(moment)
        both["shadowed"][0] = 0
        unlike = differing(self.session(Effects(shadows=(False, True))).answers(moment), both)
        return f"without light 0's shadows {unlike} differ" if unlike else ""


def differing(some: Answers, others: Answers) -> str:
    """The names of the answers whose bits differ."""
    return ", ".join(name for name in some if not same_bits(some[name], others[name]))


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
