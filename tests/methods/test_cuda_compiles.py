"""Every kernel compiles for a GPU, ahead of time and without one: a kernel that only a GPU would refuse is seen here."""

import importlib
import pkgutil

import pytest
import shadowbench.harness
import shadowbench.methods
import warp as wp
from helpers.compiled_twins import kernels_with_effects, source_of, with_source
from helpers.turns import PARTS
from shadowbench.harness.frame.effects.specialise import named
from shadowbench.harness.scene.effects import Switches
from shadowbench.methods.streams.occlusion import rows as light_rows
from tools.kernel_report import hot_modules, uses_of


def modules_with_kernels() -> list[str]:
    """Modules that hold kernels, but for those whose binaries ``test_kernel_report`` reads."""
    names = []
    hot = set(hot_modules().values())
    for package in (shadowbench.methods, shadowbench.harness):
        for found in pkgutil.walk_packages(package.__path__, package.__name__ + "."):
            module = importlib.import_module(found.name)
            if any(isinstance(v, wp.Kernel) and v.module.name == found.name for v in vars(module).values()):
                names.append(found.name)
    return [name for name in names if name not in hot]


@pytest.mark.slow
@pytest.mark.parametrize("part", range(PARTS))
def test_modules_compile_for_cuda(part):
    for name in modules_with_kernels()[part::PARTS]:
        assert uses_of(name), name


def test_a_queue_that_is_read_again_compiles_for_cuda():
    """Those that are read once are hot, as above."""
    assert uses_of(light_rows.make_rows_kernel(True).module)


@pytest.mark.slow
@pytest.mark.parametrize("part", range(PARTS))
def test_kernels_with_every_effect_compile_for_cuda(part):
    for name, kernel in list(kernels_with_effects().items())[part::PARTS]:
        switches = Switches(**dict.fromkeys(named(kernel), True))
        assert uses_of(with_source(kernel, source_of(kernel), switches).module), name
