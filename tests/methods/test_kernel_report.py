"""Hot kernels take no more registers, stack or instructions than recorded: seen before it is timed, without a GPU.

A change that is worth more is recorded anew: ``python tests/tools/kernel_report.py --record``.
"""

import functools

import pytest
import warp as wp
from tools import kernel_report
from tools.kernel_report import Use

MORE_REGISTERS = 4
MORE_STACK_BYTES = 16
MORE_INSTRUCTIONS = 1.08
"""Margins: below these a compiler's whim; above, fewer threads in flight, more spills, or more work."""


def grown(before: Use, now: Use) -> list[str]:
    """What has grown beyond the margins."""
    limits = (
        ("registers", before.registers + MORE_REGISTERS),
        ("stack_bytes", before.stack_bytes + MORE_STACK_BYTES),
        ("instructions", int(before.instructions * MORE_INSTRUCTIONS) + 16),
    )
    return [
        f"{name}: {getattr(now, name)}, recorded {getattr(before, name)}, at most {limit}"
        for name, limit in limits
        if getattr(now, name) > limit
    ]


RECORDED = kernel_report.recorded()
LABELS = list(dict.fromkeys(label for label, _ in RECORDED))
modules = functools.cache(kernel_report.hot_modules)
"""The modules by label. Made in the test that asks first: it takes seconds."""


def test_every_hot_module_is_recorded():
    assert sorted(modules()) == sorted(LABELS)


@pytest.mark.parametrize("label", LABELS)
def test_a_hot_kernel_takes_no_more_than_recorded(label):
    recorded = {name: use for (module, name), use in RECORDED.items() if module == label}
    found = kernel_report.uses_of(modules()[label])
    again = "; python tests/tools/kernel_report.py --record keeps what is found now"
    assert set(found) == set(recorded), f"{label}: other kernels than recorded{again}"
    worse = {name: grown(recorded[name], use) for name, use in found.items() if grown(recorded[name], use)}
    assert not worse, f"{worse}{again}"


def test_growth_is_reported():
    before = Use(60, 0, 1000)
    assert (grown(before, Use(64, 16, 1096)), len(grown(before, Use(65, 17, 1097)))) == ([], 3)


def test_a_record_holds_no_kernel_that_is_gone():
    use = Use(60, 0, 1000)
    before = {("a", "renamed"): use, ("gone", "kernel"): use, ("b", "kernel"): use}
    found = {("a", "kernel"): Use(50, 0, 900)}
    assert kernel_report.kept(before, found, {"a", "b"}) == {("b", "kernel"): use, **found}


def spilling(cap: int | None) -> wp.Kernel:
    """A kernel with many values alive at once, given ``cap`` registers a thread."""

    @wp.kernel(enable_backward=False, module="unique", cuda_max_registers=cap)
    def busy_kernel(values: wp.array(dtype=wp.mat44d), out: wp.array(dtype=wp.mat44d)):
        i = wp.tid()
        a = values[i]
        b = values[i + 1]
        out[i] = a * b * wp.transpose(a) * b + wp.inverse(a) * wp.inverse(b)

    return busy_kernel


def test_a_spill_is_seen_in_the_binary():
    """With 32 registers the same kernel needs a stack and more instructions."""
    free = kernel_report.uses_of(spilling(None).module)["busy_kernel"]
    tight = kernel_report.uses_of(spilling(32).module)["busy_kernel"]
    assert tight.registers <= 32 < free.registers
    assert tight.stack_bytes > free.stack_bytes
    assert tight.instructions > free.instructions


def test_a_file_that_is_no_binary_is_refused():
    with pytest.raises(ValueError, match="ELF"):
        kernel_report.uses_in(b"//\n.version 8.0\n")
