"""Kernels that factories make and that are not hot compile for a GPU without one, within the registers they are given.

Of the hot ones ``test_kernel_report`` compares registers, stack and instructions with what is recorded.
"""

import pytest
from shadowbench.harness.frame.effects.specialise import specialised
from shadowbench.harness.scene.effects import Switches
from shadowbench.methods.trees.builders import hploc
from shadowbench.methods.trees.constants import MOST_KEPT, REGISTERS, RESOLVE_REGISTERS
from shadowbench.methods.trees.trace import closest, shadow
from tools.kernel_report import uses_of

STACK_BYTES = 512
"""A ray's own stack: 128 references, which are no spilled registers."""

EXACT_BYTES = STACK_BYTES + 4 * (MOST_KEPT + 2)
"""With the undecided triangles that an exact ray keeps."""

UNDECIDED_BYTES = 256
"""What shadow rays may spill after their loop, where float64 decides what few of them left."""

RECEIVER_BYTES = 64
"""What they may spill before it, where float64 decides whether a hit receives the light."""

MARKED, HOLES = Switches(receivers=True), Switches(alpha=True)
KERNELS = {
    "hploc, wide": (hploc.make_hploc_kernel(8), 64, 0),
    "float32 packet": (closest.make_eye_kernel(False, True), REGISTERS, 0),
    "parallel": (closest.make_resolve_kernel(True), RESOLVE_REGISTERS, 0),
    "mirrored, with holes": (specialised(closest.make_listed_kernel(True), HOLES), REGISTERS, EXACT_BYTES),
    "exact shadow, marking": (
        specialised(shadow.make_shadow_kernel(True, True), MARKED),
        *(REGISTERS, EXACT_BYTES + UNDECIDED_BYTES + RECEIVER_BYTES),
    ),
    "float32 shadow, marking": (
        specialised(shadow.make_shadow_kernel(False, True), MARKED),
        *(REGISTERS, STACK_BYTES + RECEIVER_BYTES),
    ),
}


@pytest.mark.parametrize("name", KERNELS)
def test_kernels_compile_for_cuda_and_spill_nothing(name):
    kernel, registers, stack = KERNELS[name]
    (use,) = uses_of(kernel.module).values()
    assert use.registers <= registers
    assert use.stack_bytes <= stack
