"""Kernels that factories make compile for a GPU without one, and what is traced most takes the registers it is given."""

import pytest
from shadowbench.harness.frame.effects.specialise import specialised
from shadowbench.harness.scene.effects import Switches
from shadowbench.methods.trees.builders import hploc, lbvh, sort
from shadowbench.methods.trees.constants import EYE_REGISTERS, MOST_KEPT, REGISTERS
from shadowbench.methods.trees.trace import closest, shadow
from tools.kernel_report import uses_of

STACK_BYTES = 512
"""A ray's own stack: 128 references, which are no spilled registers."""

EXACT_BYTES = STACK_BYTES + 4 * (MOST_KEPT + 2)
"""With the undecided triangles that an exact ray keeps."""

FLOAT64_BYTES = 128
"""What primary rays may spill after their loop, where float64 computes the hit."""

UNDECIDED_BYTES = 256
"""What shadow rays may spill after their loop, where float64 decides what few of them left."""

RECEIVER_BYTES = 64
"""What they may spill before it, where float64 decides whether a hit receives the light."""

HOLE_BYTES = 96
"""What primary and shadow rays may spill more where float64 decides whether a hit lies in a hole."""

MARKED = Switches(receivers=True)
HOLES = Switches(alpha=True)

BOUNCED = Switches(bounced=True)

# The others are hot: test_kernel_report reads their binaries.
KERNELS = {
    "lbvh": lbvh.make_lbvh_kernel(),
    "hploc, wide": hploc.make_hploc_kernel(8),
    "sort, large": sort.make_sweep_kernel(16),
    "float32 packet": closest.make_eye_kernel(False, True),
    "parallel": closest.make_resolve_kernel(True),
}
EXACT, SHADOW = closest.make_eye_kernel(True, False), shadow.make_shadow_kernel(True, False)
TRACED = {
    "exact": (EXACT, EXACT_BYTES + FLOAT64_BYTES),
    "exact, together": (shadow.make_together_kernel(True, False), EXACT_BYTES + FLOAT64_BYTES + UNDECIDED_BYTES),
    "float32, together": (shadow.make_together_kernel(False, False), STACK_BYTES),
    "exact packet": (closest.make_eye_kernel(True, True), EXACT_BYTES - STACK_BYTES + FLOAT64_BYTES),
    "mirrored": (closest.make_listed_kernel(True), EXACT_BYTES),
    "mirrored shadow": (specialised(SHADOW, BOUNCED), EXACT_BYTES + UNDECIDED_BYTES),
    "holes": (specialised(EXACT, HOLES), EXACT_BYTES + FLOAT64_BYTES + HOLE_BYTES),
    "shadows with holes": (specialised(SHADOW, HOLES), EXACT_BYTES + UNDECIDED_BYTES + HOLE_BYTES),
    "mirrored, with holes": (specialised(closest.make_listed_kernel(True), HOLES), EXACT_BYTES),
    "mirrored, float32": (closest.make_listed_kernel(False), STACK_BYTES),
    "exact shadow": (SHADOW, EXACT_BYTES + UNDECIDED_BYTES),
    "exact shadow, marking": (
        specialised(shadow.make_shadow_kernel(True, True), MARKED),
        EXACT_BYTES + UNDECIDED_BYTES + RECEIVER_BYTES,
    ),
    "float32 shadow, marking": (
        specialised(shadow.make_shadow_kernel(False, True), MARKED),
        STACK_BYTES + RECEIVER_BYTES,
    ),
}

OF_THE_EYE = ("exact", "exact, together", "exact packet", "holes")
"""Those with the hit points of the eye's rays in float64."""


@pytest.mark.parametrize("name", KERNELS)
def test_kernels_compile_for_cuda(name):
    assert uses_of(KERNELS[name].module)


@pytest.mark.parametrize("name", TRACED)
def test_traced_kernels_spill_nothing(name):
    kernel, stack = TRACED[name]
    (use,) = uses_of(kernel.module).values()
    assert use.registers <= (EYE_REGISTERS if name in OF_THE_EYE else REGISTERS)
    assert use.stack_bytes <= stack


def test_what_prepares_and_ends_listed_rays_spills_nothing():
    modules = (
        "shadowbench.methods.trees.trace.closest",
        "shadowbench.methods.trees.records.rays",
        closest.make_resolve_kernel(False).module,
    )
    found = {name: use for module in modules for name, use in uses_of(module).items()}
    assert set(found) == {"list_kernel", "resolve_kernel", "ray_kernel", "float32_ray_kernel"}
    assert [name for name, use in found.items() if use.stack_bytes] == []
