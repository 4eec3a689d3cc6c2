"""The names that scripts and notebooks use, in one place; docs/api.md shows each in use.

They are defined in other modules and only collected here.
"""

from .commands.run import plan_run, run
from .errors import UserError
from .frame.devices import find_device
from .frame.registry import make_method, method_names
from .frame.session import Session
from .judge.context import Judge
from .judge.score import score_answers
from .report.picture import save_png, shade
from .results import points, samples, tidy
from .runner.planning.experiment import experiment_names
from .scene.catalogue import resolve
from .scene.chosen_view import ChosenView
from .scene.names import scene_names
from .scene.prepared import prepare
from .scene.scene import Camera, Geometry, Light, Scene

__all__ = [
    "Camera", "ChosenView", "Geometry", "Judge", "Light", "Scene", "Session", "UserError", "experiment_names",
    "find_device", "make_method", "method_names", "plan_run", "points", "prepare", "resolve", "run", "samples",
    "save_png", "scene_names", "score_answers", "shade", "tidy",
]  # fmt: skip
