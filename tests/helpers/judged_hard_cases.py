"""The hard cases with their exact answers, made once for all tests of a run."""

import functools
import os
import re
from collections import defaultdict

from helpers.kept import kept
from helpers.turns import PARTS, in_turn
from shadowbench.harness.frame.registry import make_method, method_names
from shadowbench.harness.hardcases import all_cases, find_case
from shadowbench.harness.hardcases.judge import Judged
from shadowbench.harness.judge.context import Judge
from shadowbench.harness.judge.referee import Referee
from shadowbench.harness.judge.reference import exact_reference
from shadowbench.harness.scene.effects import Effects

CASES = [case for case in all_cases() if not case.refused]


class JudgedOnce(Judged):
    """A trial whose exact answers are worked out by one of the test processes."""

    @functools.cached_property
    def judge(self) -> Judge:
        prepared, moment = self.trial.prepared, self.trial.moment
        effects = Effects.of(prepared.scene)
        referee = Referee(moment.points, prepared.faces, moment.valid, mask=prepared.alpha)
        name = f"exact answers of {self.case.name}"
        reference = kept(name, lambda: exact_reference(prepared, moment, referee, effects))
        return Judge(prepared, moment, effects, referee, reference, random_pixels=0)


@functools.cache
def judged(name: str) -> Judged:
    case = find_case(name)
    return JudgedOnce(case, case.make())


EVERYTHING = os.environ.get("SHADOWBENCH_SWEEP") == "all"
"""Whether nobody takes turns: every method, setting and place for each case. ``make fuzz`` asks for it; it takes an hour."""

LONG = ("P17 1023x769", "P29", "P31", "P52", "S16", "S31", "S35")
"""Cases, by how their names begin, that take a third of the time of all: they run once where the others run twice."""


@functools.cache
def families() -> dict[str, list[str]]:
    """The names of the cases that vary one idea, as P34 or "V scale", by the first word that they share."""
    found = defaultdict(list)
    for case in CASES:
        found[family(case.name)].append(case.name)
    return dict(found)


def family(name: str) -> str:
    return re.match(r"V \w+|[A-Z]+\d*", name)[0]


def cases_of(method: int) -> list[str]:
    """The cases that an exact method of this number answers in this turn: of each family a quarter, of a small one at least
    one.
    """
    turns = ((names, min(PARTS, len(names))) for names in families().values())
    return [name for names, every in turns for i, name in enumerate(names) if in_turn(i + method, every)]


EXACT_SETTINGS: dict[str, dict[str, str]] = {"warp_bvh": {"update": "bvh_rebuild"}, "hybrid": {"shadows": "tree"}}
"""Settings that make a method exact whose defaults are not; or that take the way for which these cases are meant."""

OTHER_SETTINGS: dict[str, tuple[dict[str, str], ...]] = {
    "perspective_spherical": (
        {"light_map": "cube", "clamp": "none", "balancing": "algorithm-1", "r": "3"},
        {"light_map": "two-angle", "aimed": "false", "clamp": "view", "tile": "5"},
    ),
    "uniform_grid": ({"density": "100"},),
    "visibility_buffer": ({"trial": "items=1000+chunks=1000+undecided=1000"},),  # short queues, which grow
    "ray_grids": ({"trial": "inline_cells=0+region=triangles"}, {"trial": "inline_cells=0+spacing=rays"}),
}
"""Other settings of exact methods, which take other ways to the same answers."""


def settings_of(name: str, given: dict[str, str]) -> tuple[dict[str, str], ...]:
    """The settings under which an exact method is tried: those given, and of the others one in turn."""
    others = OTHER_SETTINGS.get(name, ())
    return (given, *(one for place, one in enumerate(others) if in_turn(place, len(others))))


def exact_methods() -> tuple[tuple[str, dict[str, str]], ...]:
    """Every method that calls itself exact, with the settings that make it so."""
    named = [(name, EXACT_SETTINGS.get(name, {})) for name in method_names()]
    return tuple((name, given) for name, given in named if not getattr(make_method(name, given), "known_inexact", None))
