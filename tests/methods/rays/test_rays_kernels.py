"""The traversals of Warp's tree are one loop each, whatever the test of a triangle: two take up to three times as long."""

import pytest
import warp as wp
from shadowbench.harness.frame.effects.specialise import specialised
from shadowbench.harness.scene.effects import Switches
from shadowbench.methods.accuracy_ladder.kernels import make_kernels
from shadowbench.methods.accuracy_ladder.parameters import TESTS
from shadowbench.methods.common.box_tree import Boxes, walk
from shadowbench.methods.rays.kernels import make_primary_kernel, make_shadow_kernel
from tools.loops import loop_counts


@wp.kernel(enable_backward=False, grid_stride=False)
def nested_kernel(values: wp.array(dtype=wp.int32)):
    i = wp.tid()
    at = values[i]
    while at > 0:
        while values[at] > 1:
            at = values[at]
            values[i] = at
        at = values[at + i]


def test_loops_are_counted() -> None:
    (count,) = [n for name, n in loop_counts(__name__).items() if name.startswith("nested_kernel")]
    assert count == 2


@pytest.mark.slow
@pytest.mark.parametrize(("test", "fast_math"), [*((test, False) for test in TESTS), ("exact", True)])
def test_ladder_has_one_loop(test, fast_math) -> None:
    kernels = make_kernels(test, fast_math)
    assert len(kernels) == 2
    for kernel in kernels:
        assert set(loop_counts(kernel.module).values()) == {1}, kernel.key


@pytest.mark.parametrize(
    "switches", [Switches(), Switches(alpha=True), Switches(bounced=True), Switches(receivers=True)]
)
def test_tree_has_one_loop(switches) -> None:
    for kernel in (make_primary_kernel(Boxes, walk), make_shadow_kernel(Boxes, walk)):
        assert set(loop_counts(specialised(kernel, switches).module).values()) == {1}, kernel.key
