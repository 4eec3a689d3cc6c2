"""The hard cases with their exact answers, made once for all tests of a run."""

from __future__ import annotations

import functools

from shadowbench.harness.hardcases import all_cases, find_case
from shadowbench.harness.hardcases.judge import Judged

CASES = [case for case in all_cases() if not case.refused]


@functools.cache
def judged(name: str) -> Judged:
    case = find_case(name)
    return Judged(case, case.make())
