"""Methods of another package, each of which misbehaves in its own way. Copied into a folder of its own and found by entry
points, as an installed package would be; see :func:`.tiny_runs.install_misbehaving`.
"""

import ctypes
import dataclasses
import errno
import math
import os
import subprocess
import time
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import warp as wp
from shadowbench.harness.errors import CapacityRejected
from shadowbench.harness.frame.method import SimpleMethod


@dataclass(frozen=True)
class Pace:
    """``ms``: how long each pass takes, at least. ``like``: the method that it is, so that one worker measures several."""

    ms: float = 0.0
    like: str = ""


class Steady(SimpleMethod):
    """Says that every ray misses, which is right where the camera looks at nothing."""

    name: ClassVar[str] = "steady"
    title: ClassVar[str] = "Steady"
    Trace = Pace

    def __new__(cls, build=None, trace=None):
        kinds = {kind.name: kind for kind in Steady.__subclasses__()}
        return super().__new__(kinds.get(trace.like, cls) if trace else cls)

    def build_structure(self, frame):
        time.sleep(self.trace.ms / 1e3)

    def trace_primary(self, frame):
        time.sleep(self.trace.ms / 1e3)
        answers = frame.answers
        answers.triangle.fill_(-1)
        answers.t.fill_(float("inf"))
        answers.u.zero_()
        answers.v.zero_()

    def trace_shadow(self, frame, light):
        frame.answers.shadowed[light].zero_()

    def built(self):
        return {"pace": self.trace.ms}

    def counters(self):
        return {"frames": np.int64(1)}


class Talker(Steady):
    """Prints where the worker's replies go, if the worker lets it."""

    name: ClassVar[str] = "talker"

    def trace_primary(self, frame):
        print("not a reply")
        os.write(1, b"nor is this\n")
        super().trace_primary(frame)


class Raises(Steady):
    name: ClassVar[str] = "raises"

    def trace_primary(self, frame):
        raise ArithmeticError("a line\nand another")


class Late(Steady):
    """Works while it is warmed up, and fails in the first round."""

    name: ClassVar[str] = "late"
    runs = 0

    def trace_primary(self, frame):
        self.runs += 1
        if self.runs > 3:
            raise ArithmeticError("tired")
        super().trace_primary(frame)


class Once(Steady):
    """Traces when it is called for the first time, and never again."""

    name: ClassVar[str] = "once"
    traced = False

    def trace_primary(self, frame):
        if not self.traced:
            super().trace_primary(frame)
        self.traced = True


class SlowStart(Steady):
    """Says in its first frame that every ray hits triangle 0, and answers rightly from then on."""

    name: ClassVar[str] = "slow_start"
    runs = 0

    def trace_primary(self, frame):
        super().trace_primary(frame)
        self.runs += 1
        if self.runs == 1:
            frame.answers.triangle.zero_()
            frame.answers.t.fill_(1.0)


class Fickle(Steady):
    """Answers otherwise from the second round on: one warm-up, three whole frames, two in passes, one that is compared."""

    name: ClassVar[str] = "fickle"
    runs = 0

    def trace_shadow(self, frame, light):
        self.runs += 1
        frame.answers.shadowed[light].fill_(int(self.runs > 1 + 7))


class Hangs(Steady):
    name: ClassVar[str] = "hangs"

    def trace_primary(self, frame):
        time.sleep(1e6)


class Exits(Steady):
    name: ClassVar[str] = "exits"

    def trace_primary(self, frame):
        print("leaving")
        os._exit(3)


@dataclass(frozen=True)
class Fork(Pace):
    """``how``: the other process is a "copy" of this one, an "orphan" in a session of its own, or a "program"; then this one
    "ends", "hangs", or goes "on".
    """

    how: str = "copy"
    then: str = "on"


class Forks(Steady):
    """Starts a process that holds all that its worker holds, and does not end."""

    name: ClassVar[str] = "forks"
    Trace = Fork

    def build_structure(self, frame):
        if self.trace.how == "program":
            subprocess.Popen(["sleep", "100000"], close_fds=False)
        elif os.fork() == 0:
            if self.trace.how == "orphan":
                os.setsid()
                if os.fork():
                    os._exit(0)
            time.sleep(1e6)
        print("started", flush=True)
        if self.trace.then == "ends":
            os._exit(3)
        if self.trace.then == "hangs":
            time.sleep(1e6)


class Rejects(Steady):
    name: ClassVar[str] = "rejects"

    def needs(self):
        return wp.array([10**9], dtype=wp.int64, device="cpu")

    def grow(self, needed):
        raise CapacityRejected(f"needs {int(needed[0])} pairs, allowed are {1 << 20}")


class Wanders(Steady):
    """Works in other folders than the one that its process began in, from its construction on."""

    name: ClassVar[str] = "wanders"

    def __init__(self, build=None, trace=None):
        super().__init__(build, trace)
        os.chdir("/")

    def trace_primary(self, frame):
        os.chdir("/")
        super().trace_primary(frame)


@dataclass(frozen=True)
class Library(Pace):
    """``holds``: bytes."""

    holds: int = 5 << 20


class OfALibrary(Steady):
    """Holds memory of which neither Warp nor the system knows, as a library does on a GPU."""

    name: ClassVar[str] = "of_a_library"
    Trace = Library

    def held_bytes(self):
        return self.trace.holds


class Greedy(Steady):
    """Holds 320 MiB of numpy arrays, which no allocator of Warp's knows of."""

    name: ClassVar[str] = "greedy"

    def prepare(self, frame):
        self.held = np.ones(40 << 20)


class Hoards(Steady):
    """Allocates 320 MiB of numpy arrays inside every frame, and frees them."""

    name: ClassVar[str] = "hoards"

    def build_structure(self, frame):
        np.ones(40 << 20)


class UnspeakableError(Exception):
    def __str__(self):
        raise ValueError("not even this")


@dataclass(frozen=True)
class Oddity(Pace):
    """``what``: what is odd; ``later``: not before the second round."""

    what: str = ""
    later: bool = False


class Odd(Steady):
    """Says what no record can hold: of its counters, of what it built, of its passes, or as it fails."""

    name: ClassVar[str] = "odd"
    Trace = Oddity
    COUNTERS: ClassVar = {
        "counter nan": {"tests": math.nan},
        "counter text": {"tests": "many"},
        "counter list": [1],
        "counter huge": {"tests": 10**400},
        "counter negative": {"tests": -1},
        "counter complex": {"tests": np.complex64(1)},
    }
    BUILT: ClassVar = {
        "built nan": {"share": math.nan},
        "built deep nan": {"levels": [{"share": -math.inf}]},
        "built text": "a tree",
        "built surrogate": {"kind": "\ud800"},
        "built None": None,
    }
    asked = grown = 0

    def plan(self, frame, effects, limits):
        passes = super().plan(frame, effects, limits)
        if self.trace.what == "pass named 5":
            passes[0] = dataclasses.replace(passes[0], name=5)
        if self.grown == 4:
            more = dataclasses.replace(passes[0], name="one more", writes=("more",))
            passes[:1] = [more, dataclasses.replace(passes[0], reads=("more",))]
        return passes

    def trace_primary(self, frame):
        if self.trace.what == "error unspeakable":
            raise UnspeakableError
        if self.trace.what == "error read-only":
            raise OSError(errno.EROFS, "Read-only file system", "/its/own/file")
        super().trace_primary(frame)

    def needs(self):
        return wp.array([1], dtype=wp.int64, device="cpu") if self.trace.what == "pass more" else None

    def grow(self, needed):
        self.grown += 1
        return self.grown == 4  # in the second round: after the preparation, and twice in the first

    def counters(self):
        return self.COUNTERS.get(self.trace.what, {})

    def built(self):
        self.asked += 1
        odd = self.BUILT.get(self.trace.what, {})
        if self.trace.what == "built itself":
            odd = {}
            odd["itself"] = odd
        return {} if self.trace.later and self.asked < 3 else odd


class OddTitle(Steady):
    name: ClassVar[str] = "odd_title"
    title: ClassVar[str] = "\udfff"


@dataclass(frozen=True)
class Limitless:
    most: float = math.nan


class OddParameter(Steady):
    name: ClassVar[str] = "odd_parameter"
    Build = Limitless


@dataclass(frozen=True)
class Gulp(Pace):
    """``how``: of Warp, of "numpy", or by the "library" of C; ``where``: "prepare", or the "first" or the "tenth" frame;
    ``gib``: bytes, in units of 2^30.
    """

    how: str = "warp"
    where: str = "prepare"
    gib: float = 6.0


class Gulps(Steady):
    """Takes much more memory than it may, in one gulp, and says when it has."""

    name: ClassVar[str] = "gulps"
    Trace = Gulp
    runs = 0

    def prepare(self, frame):
        self._gulp("prepare", frame.device)

    def build_structure(self, frame):
        self.runs += 1
        if self.runs in (1, 10):
            self._gulp({1: "first", 10: "tenth"}[self.runs], frame.device)

    def _gulp(self, where, device):
        if where != self.trace.where:
            return
        size = int(self.trace.gib * 2**30)
        if self.trace.how == "warp":
            self.taken = wp.empty(size // 8, dtype=wp.uint64, device=device)
        elif self.trace.how == "numpy":
            self.taken = np.empty(size, dtype=np.uint8)
        elif not ctypes.CDLL(None).calloc(ctypes.c_size_t(size), ctypes.c_size_t(1)):
            raise MemoryError("the library got none")
        print("taken")


class Skips(Steady):
    name: ClassVar[str] = "skips"

    def applies(self, scene, device):
        return "only for closed scenes"


class Grows(Steady):
    """Needs more than it has, twice: 1, then 10, then 100 cells."""

    name: ClassVar[str] = "grows"
    capacity = 1

    def prepare(self, frame):
        self.cells = wp.zeros(self.capacity, dtype=wp.int64, device=frame.device)

    def needs(self):
        return wp.array([100], dtype=wp.int64, device="cpu")

    def grow(self, needed):
        if self.capacity >= needed[0]:
            return False
        self.capacity *= 10
        return True


class Varies(Steady):
    """Needs more in one run of the frame than in the others, and shadows a point where that does not fit: in the first run
    that is compared (:class:`Fickle`).
    """

    name: ClassVar[str] = "varies"
    runs, need, capacity = 0, 1, 1

    def trace_shadow(self, frame, light):
        self.runs += 1
        self.need = 2 if self.runs == 1 + 7 else 1
        frame.answers.shadowed[light].fill_(int(self.need > self.capacity))

    def needs(self):
        return wp.array([self.need], dtype=wp.int64, device="cpu")

    def grow(self, needed):
        before, self.capacity = self.capacity, max(self.capacity, int(needed[0]))
        return self.capacity > before


class Broken(Steady):
    """Cannot even be made."""

    name: ClassVar[str] = "broken"

    def __init__(self, build=None, trace=None):
        raise ImportError("libmissing.so: cannot open")


CLASSES = (Steady, *Steady.__subclasses__())
