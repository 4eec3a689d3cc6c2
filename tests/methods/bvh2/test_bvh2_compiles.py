"""Kernels that factories make compile for a GPU without one, and what is traced most takes the registers it is given."""

from __future__ import annotations

import pytest
from shadowbench.harness.frame.effects.specialise import specialised
from shadowbench.harness.scene.effects import Switches
from shadowbench.methods.trees.build import hploc as build_hploc
from shadowbench.methods.trees.build import lbvh as build_lbvh
from shadowbench.methods.trees.build import refit, sort
from shadowbench.methods.trees.parameters import Trace
from shadowbench.methods.trees.records import rays as ray_records
from shadowbench.methods.trees.trace import careful, mirrored, primary, shadow
from shadowbench.methods.trees.undecided import MOST_KEPT
from tools.kernel_report import uses_of

REGISTERS = Trace().registers
FLOAT64_REGISTERS = primary.FLOAT64_REGISTERS
STACK_BYTES = 512
"""A ray's own stack: 128 references, which are no spilled registers."""

EXACT_BYTES = STACK_BYTES + 4 * (MOST_KEPT + 2)
"""With the doubts that an exact ray keeps."""

FLOAT64_BYTES = 128
"""What primary rays may spill after their loop, where float64 computes the hit."""

DOUBT_BYTES = 256
"""What shadow rays may spill after their loop, where float64 decides what few of them left."""

RECEIVER_BYTES = 64
"""What they may spill before it, where float64 decides whether a hit receives the light."""

HOLE_BYTES = 96
"""What primary and shadow rays may spill more where float64 decides whether a hit lies in a hole."""

MARKED = Switches(receivers=True)
HOLES = Switches(alpha=True)

# The others are hot: test_kernel_report reads their binaries.
KERNELS = {
    "lbvh": build_lbvh.make_lbvh_kernel(64),
    "hploc": build_hploc.make_hploc_kernel(2, 48),
    "hploc, wide": build_hploc.make_hploc_kernel(8, 64),
    "refit": refit.make_refit_kernel(48),
    "sort, large": sort.make_sweep_kernel(16),
    "parallel": careful.make_closest_kernel(48),
    "shadows of parallel rays": careful.make_shadow_kernel(48),
    "mirrored, wide": mirrored.make_exact_kernel(64, 64),
    "float32 packet": primary.make_float32_kernel(True, 64, REGISTERS),
}
TRACED = {
    "exact": (primary.make_exact_kernel(False, 48, FLOAT64_REGISTERS), EXACT_BYTES + FLOAT64_BYTES),
    "exact packet": (primary.make_exact_kernel(True, 48, FLOAT64_REGISTERS), FLOAT64_BYTES),
    "mirrored": (mirrored.make_exact_kernel(48, REGISTERS), EXACT_BYTES),
    "mirrored shadow": (mirrored.make_shadow_kernel("exact", 48, REGISTERS), EXACT_BYTES + DOUBT_BYTES),
    "holes": (
        specialised(primary.make_exact_kernel(False, 48, FLOAT64_REGISTERS), HOLES),
        EXACT_BYTES + FLOAT64_BYTES + HOLE_BYTES,
    ),
    "shadows with holes": (
        specialised(shadow.make_shadow_kernel("exact", 48, REGISTERS, False), HOLES),
        EXACT_BYTES + DOUBT_BYTES + HOLE_BYTES,
    ),
    "mirrored, with holes": (specialised(mirrored.make_exact_kernel(48, REGISTERS), HOLES), EXACT_BYTES),
    "mirrored, float32": (mirrored.make_float32_kernel(48, REGISTERS), STACK_BYTES),
    "exact shadow": (shadow.make_shadow_kernel("exact", 48, REGISTERS, False), EXACT_BYTES + DOUBT_BYTES),
    "exact shadow, marking": (
        specialised(shadow.make_shadow_kernel("exact", 48, REGISTERS, True), MARKED),
        EXACT_BYTES + DOUBT_BYTES + RECEIVER_BYTES,
    ),
    "float32 shadow, marking": (
        specialised(shadow.make_shadow_kernel("float32", 48, REGISTERS, True), MARKED),
        STACK_BYTES,
    ),
}


@pytest.mark.parametrize("name", KERNELS)
def test_kernels_compile_for_cuda(name):
    assert uses_of(KERNELS[name].module)


@pytest.mark.parametrize("name", TRACED)
def test_traced_kernels_spill_nothing(name):
    kernel, stack = TRACED[name]
    (use,) = uses_of(kernel.module).values()
    assert use.registers <= (FLOAT64_REGISTERS if name in ("exact", "exact packet", "holes") else REGISTERS)
    assert use.stack_bytes <= stack


def test_kernels_of_mirrored_rays_spill_nothing():
    found = {
        name: use for module in (mirrored, ray_records) for name, use in uses_of(module.__name__).items()
    }
    assert set(found) == {"list_kernel", "resolve_kernel", "ray_kernel", "float32_ray_kernel"}
    assert [name for name, use in found.items() if use.stack_bytes] == []
