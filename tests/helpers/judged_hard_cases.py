"""The hard cases with their exact answers, made once for all tests of a run."""

from __future__ import annotations

import functools

from shadowbench.harness.frame.registry import make_method, method_names
from shadowbench.harness.hardcases import all_cases, find_case
from shadowbench.harness.hardcases.judge import Judged

CASES = [case for case in all_cases() if not case.refused]


@functools.cache
def judged(name: str) -> Judged:
    case = find_case(name)
    return Judged(case, case.make())


EXACT_SETTINGS: dict[str, dict[str, str]] = {"warp_bvh": {"update": "bvh_rebuild"}}
"""Settings that make a method exact whose defaults are not."""


def exact_methods() -> tuple[tuple[str, dict[str, str]], ...]:
    """Every method that calls itself exact, with the settings that make it so."""
    named = [(name, EXACT_SETTINGS.get(name, {})) for name in method_names()]
    return tuple(
        (name, given) for name, given in named if not getattr(make_method(name, given), "known_inexact", None)
    )
