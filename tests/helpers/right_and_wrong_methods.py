"""Methods of which each is right, or wrong in one way, for tests of the commands that judge; and a mesh to try them on."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh
from helpers import exact_answers as cases
from helpers.exact_method import ExactMethod
from shadowbench.harness.errors import CapacityRejected


class Right(ExactMethod):
    name = title = "right"


class Wrong(Right):
    """Leaks the first shadowed pixel."""

    name = title = "wrong"

    def spoil(self, answers):
        bits = answers["shadowed"][0]
        bits[np.argmax(bits)] = 0


class Honest(Wrong):
    name = title = "honest"
    known_inexact = "it leaks, and says so"


class Lazy(Right):
    """Never writes its shadows."""

    name = title = "lazy"

    def trace_shadow(self, frame, light):
        pass


class Crashing(Right):
    name = title = "crashing"

    def trace_primary(self, frame):
        raise RuntimeError("no such luck")


class Greedy(Right):
    name = title = "greedy"

    def trace_primary(self, frame):
        raise CapacityRejected("needs 12 pairs")


class Choosy(Right):
    name = title = "choosy"

    def applies(self, scene, device):
        return "only spheres"


@dataclass
class Point:
    """Stands in for an installed package's entry point."""

    cls: type
    value: str = "elsewhere:Sample"

    def load(self):
        return self.cls


INSTALLED = {cls.name: Point(cls) for cls in (Right, Wrong, Honest, Lazy, Crashing, Greedy, Choosy)}
"""What the registry finds in place of installed packages."""


def ball_file(folder: Path) -> str:
    """A ball over a floor as a file."""
    geometry = cases.ball_on_floor().geometry()
    path = folder / "ball.ply"
    trimesh.Trimesh(geometry.positions(0), geometry.faces, process=False).export(path)
    return str(path)
