"""What property tests draw, and how often: strings of bytes that :mod:`lattice_examples` decodes."""

import numpy as np
from helpers.judged_hard_cases import EVERYTHING
from helpers.lattice_examples import LENGTH, METHODS, Example, answers_of, decode
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from shadowbench.harness.hardcases.case import Trial
from shadowbench.harness.hardcases.judge import same_bits
from shadowbench.harness.judge.decisions import Hits
from shadowbench.harness.judge.referee import Referee

BYTES = st.binary(min_size=40, max_size=LENGTH)
"""Short strings of bytes are padded with zeros, which are the plainest choices."""

EXAMPLES = BYTES.map(decode)
CULLED = BYTES.map(lambda data: decode(data, culled=True))
CLOSED = BYTES.map(lambda data: decode(data, closed=True))
"""Any mesh; with back faces culled where it is legal; closed bodies with eye and lights outside."""


def some(count: int):
    """Settings of a test of ``count`` examples: the same ones in every run; the short suite takes a third."""
    checks = [HealthCheck.too_slow, HealthCheck.data_too_large, HealthCheck.large_base_example]
    return settings(
        max_examples=count if EVERYTHING else count // 3,
        derandomize=True,
        deadline=None,
        database=None,
        suppress_health_check=checks,
    )


def traced(example: Example) -> dict[str, dict[str, np.ndarray]]:
    """What every method answers."""
    trial = example.trial()
    return {name: answers_of(example, name, trial) for name in METHODS}


def assert_same(some: dict, others: dict, keys=("triangle", "t", "u", "v", "shadowed")) -> None:
    """Two times :func:`traced` with the same bits."""
    for name in METHODS:
        for key in keys:
            assert same_bits(some[name][key], others[name][key]), (name, key)


def exact_hits(trial: Trial) -> tuple[Referee, Hits]:
    """The referee of a trial, and the exact closest hit of each pixel."""
    moment = trial.moment
    referee = Referee(moment.points, trial.prepared.faces, moment.valid)
    return referee, referee.closest(moment.eye, moment.directions(np.arange(moment.width * moment.height)))
