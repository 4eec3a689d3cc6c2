"""Playing a story: sessions that went through all earlier frames against a session made for each frame alone."""

import gc
from collections.abc import Callable

import warp as wp
from helpers.judged_hard_cases import EXACT_SETTINGS
from helpers.stories import Story
from numpy.typing import NDArray
from shadowbench.harness.errors import CapacityRejected
from shadowbench.harness.frame.registry import make_method, method_names
from shadowbench.harness.frame.session import Session
from shadowbench.harness.hardcases.case import HardCase, Trial
from shadowbench.harness.hardcases.judge import ERROR_NAMES, Judged, same_bits
from shadowbench.harness.scene.moment import Moment

Answers = dict[str, NDArray]
Player = tuple[str, dict[str, str]]

UPDATES = ("refit", "static")
"""Values of a method's ``update`` that keep a tree over frames; "static" is for meshes that do not move."""

SMALL = {"shadow_map": {"size": "64"}}
"""Settings that only save time here."""

REJECTED: Answers = {}
"""Stands for the answers of a frame whose needs exceed the limits."""


def players(device: str) -> list[Player]:
    """Every method with its settings, and again with each way to keep a tree, or occluders, over frames."""
    found: list[Player] = []
    for name in method_names():
        method = make_method(name)
        cls = type(method)
        if device.split(":")[0] not in method.devices:
            continue
        found.append((name, EXACT_SETTINGS.get(name, SMALL.get(name, {}))))
        if name in EXACT_SETTINGS:
            found.append((name, {}))
        if hasattr(cls.Build, "update"):
            found += [(name, {"update": update}) for update in UPDATES]
        if hasattr(cls.Build, "occluders"):
            found.append((name, {"occluders": "last"}))
    return found


def keeps_still(player: Player) -> bool:
    """Whether it is for meshes that do not move."""
    return player[1].get("update") == "static"


class Judging:
    """Exact answers to the moments of a story, found once; and which answers have no true error."""

    def __init__(self, story: Story):
        self.story = story
        self._right: dict[int, list[Answers]] = {}
        self._judged: dict[int, Judged] = {}

    def judged(self, frame: int) -> Judged:
        """One frame as a case, with its exact answers."""
        if frame not in self._judged:
            trial = Trial(self.story.prepared, self.story.moments[frame])
            self._judged[frame] = Judged(HardCase("story", "", "", lambda: trial), trial)
        return self._judged[frame]

    def wrong(self, frame: int, answers: Answers) -> str:
        """The true errors of answers to a frame; empty without any."""
        if any(all(same_bits(one[key], answers[key]) for key in one) for one in self._right.get(frame, [])):
            return ""
        classes, examples, _ = self.judged(frame).count(answers)
        found = {key: count for key, count in classes.items() if key in ERROR_NAMES}
        if found:
            return f"{found} {examples[:1]}"
        self._right.setdefault(frame, []).append({key: value.copy() for key, value in answers.items()})
        return ""


def fresh(make: Callable[[], Session], moment: Moment) -> Answers:
    try:
        return make().answers(moment)
    except CapacityRejected:
        return REJECTED


def complete(session: Session, moment: Moment) -> Answers:
    """A whole frame as it is timed: on CUDA a replayed graph."""
    try:
        session.load(moment)
        session.replay_complete()
        wp.synchronize_device(session.device)
        return session.frame.answers.to_host()
    except CapacityRejected:
        return REJECTED


def in_part(session: Session, moment: Moment) -> Answers:
    """A frame made from the last one."""
    try:
        session.advance(moment)
        wp.synchronize_device(session.device)
        return session.frame.answers.to_host()
    except CapacityRejected:
        return REJECTED


WAYS = {"played": complete, "in part": in_part}


def play(player: Player, story: Story, device: str, judging: Judging | None = None) -> list[str]:
    """What goes wrong: frames of sessions that played all earlier ones differ from a new session's, or are wrong.

    ``judging``: also judge the answers, of methods that call themselves exact.
    """
    name, settings = player
    size = story.moments[0].width, story.moments[0].height

    def make() -> Session:
        return Session(
            make_method(name, settings), story.prepared, *size, device, light_count=len(story.moments[0].lights)
        )

    if make_method(name, settings).applies(story.prepared.scene, device):
        return []
    exact = not getattr(make_method(name, settings), "known_inexact", None)
    sessions = {way: make() for way in WAYS}
    found = []
    for frame, (label, moment) in enumerate(zip(story.labels, story.moments, strict=True)):
        alone = fresh(make, moment)
        for way, session in sessions.items():
            answers = WAYS[way](session, moment)
            unlike = sorted(key for key in alone.keys() | answers.keys() if not _same(alone, answers, key))
            if unlike:
                found.append(f"{name} {settings} frame {frame} ({label}), {way}: {', '.join(unlike)} differ")
        if judging is not None and exact and alone is not REJECTED and (wrong := judging.wrong(frame, alone)):
            found.append(f"{name} {settings} frame {frame} ({label}): {wrong}")
    return found


def _same(one: Answers, other: Answers, key: str) -> bool:
    return key in one and key in other and same_bits(one[key], other[key])


def grown_memory(player: Player, story: Story, device: str, times: int = 3) -> int:
    """Bytes by which live memory grows where one session plays a story again after it did so once; 0: none."""
    name, settings = player
    size = story.moments[0].width, story.moments[0].height
    if make_method(name, settings).applies(story.prepared.scene, device):
        return 0
    lights = len(story.moments[0].lights)
    session = Session(make_method(name, settings), story.prepared, *size, device, light_count=lights)
    seen = []
    for _ in range(1 + times):
        for moment in story.moments:
            complete(session, moment)
        seen.append(live_bytes(device))
    return max(seen) - seen[0]


def live_bytes(device: str) -> int:
    """Bytes of all Warp arrays that exist; on CUDA what is in use of the device's memory pool, which graphs use too."""
    gc.collect()
    wp.synchronize_device(device)
    if wp.get_device(device).is_cuda:
        return int(wp.get_mempool_used_mem_current(device))
    return sum(getattr(one, "capacity", 0) for one in gc.get_objects() if isinstance(one, wp.array))
