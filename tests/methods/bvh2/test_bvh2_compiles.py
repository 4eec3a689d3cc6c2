"""Kernels that factories make compile for a GPU without one, and what is traced most takes the registers it is given."""

from __future__ import annotations

import pytest
from shadowbench.methods.bvh2 import build_hploc, build_lbvh, careful, primary, refit, shadow, sort
from shadowbench.methods.bvh2.parameters import Trace
from tools.kernel_report import uses_of

REGISTERS = Trace().registers
STACK_BYTES = 512
"""A ray's own stack: 128 references, which are no spilled registers."""

# The others are hot: test_kernel_report reads their binaries.
KERNELS = {
    "lbvh": build_lbvh.make_lbvh_kernel(64),
    "hploc": build_hploc.make_hploc_kernel(2, 48),
    "hploc, wide": build_hploc.make_hploc_kernel(8, 64),
    "refit": refit.make_refit_kernel(48),
    "sort, large": sort.make_sweep_kernel(16),
    "mirrored": careful.make_closest_kernel(48),
    "mirrored shadows": careful.make_shadow_kernel(48),
    "float32 packet": primary.make_float32_kernel(True, 64, REGISTERS),
}
TRACED = {
    "exact": (primary.make_exact_kernel(False, 48, REGISTERS), STACK_BYTES),
    "exact packet": (primary.make_exact_kernel(True, 48, REGISTERS), 0),
    "exact shadow": (shadow.make_shadow_kernel("exact", 48, REGISTERS), STACK_BYTES),
}


@pytest.mark.parametrize("name", KERNELS)
def test_kernels_compile_for_cuda(name):
    assert uses_of(KERNELS[name].module)


@pytest.mark.parametrize("name", TRACED)
def test_traced_kernels_spill_nothing(name):
    kernel, stack = TRACED[name]
    (use,) = uses_of(kernel.module).values()
    assert use.registers <= REGISTERS
    assert use.stack_bytes <= stack
