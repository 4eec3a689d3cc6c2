"""No knob meant for speed changes a bit of any triangle test's answers: on drawn lattice examples, whose rays meet
vertices and edges exactly, so that what a test makes of them depends on its last bit.
"""

from dataclasses import replace

import pytest
import warp as wp
from helpers.drawn_examples import EXAMPLES, some
from helpers.lattice_examples import CHOICES, Example, answers_of
from hypothesis import given
from shadowbench.harness.hardcases.judge import same_bits
from shadowbench.methods.perspective_spherical.parameters import TRIANGLE_TESTS

NAME = "perspective_spherical"

PLAINEST = {"staging": "none", **{knob: values[0] for knob, values in CHOICES[NAME].items()}}


def assert_same_as_plainest(example: Example, triangle_test: str, **changes: str) -> None:
    """The example's own settings against the plainest ones, under one test: every answer, bit for bit."""
    trial = example.trial()
    drawn = example.with_settings(NAME, triangle_test=triangle_test, **changes)
    plain = replace(example, settings={NAME: {**PLAINEST, "triangle_test": triangle_test}})
    expected, got = answers_of(plain, NAME, trial), answers_of(drawn, NAME, trial)
    for key, values in expected.items():
        assert same_bits(got[key], values), (key, drawn.settings[NAME])


@pytest.mark.parametrize("triangle_test", TRIANGLE_TESTS)
@some(30)
@given(EXAMPLES)
def test_no_knob_changes_a_bit(triangle_test: str, example: Example) -> None:
    assert_same_as_plainest(example, triangle_test)


@pytest.mark.slow
@pytest.mark.parametrize(("triangle_test", "chunk"), list(zip(TRIANGLE_TESTS, "013", strict=True)))
@some(8)
@given(EXAMPLES)
def test_no_knob_changes_a_bit_of_staged_kernels(triangle_test: str, chunk: str, example: Example) -> None:
    """Blocks of 64 threads on a CPU: eight by eight pixels, in one sorting tile or in four, and as many shadow rays."""
    tile, k = ("8", "1") if example.settings[NAME]["k"] == "1" else ("4", "2")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(wp.config, "enable_cpu_blocks", True)
        assert_same_as_plainest(example, triangle_test, tile=tile, k=k, r="40", staging="shared", triangle_chunk=chunk)
