"""Every kernel compiles for a GPU, ahead of time and without one: a kernel that only a GPU would refuse is seen here."""

from __future__ import annotations

import importlib
import pkgutil

import pytest
import shadowbench.harness
import shadowbench.methods
import warp as wp
from compiled_twins import compiled, kernels_with_effects, source_of, with_source
from shadowbench.harness.specialise import Switches, named
from shadowbench.methods.ray_grids import light_stream

ARCH = 90
EFFECTS = kernels_with_effects()


def modules_with_kernels() -> list[str]:
    names = []
    for package in (shadowbench.methods, shadowbench.harness):
        for found in pkgutil.walk_packages(package.__path__, package.__name__ + "."):
            module = importlib.import_module(found.name)
            if any(isinstance(v, wp.Kernel) and v.module.name == found.name for v in vars(module).values()):
                names.append(found.name)
    return names


@pytest.mark.parametrize("name", modules_with_kernels())
def test_module_compiles_for_cuda(name, tmp_path):
    wp.compile_aot_module(importlib.import_module(name), arch=ARCH, module_dir=tmp_path)
    assert list(tmp_path.glob("*.cubin")) or list(tmp_path.glob("*.ptx"))


@pytest.mark.parametrize("queued", [False, True])
def test_streamed_variants_compile_for_cuda(queued, tmp_path):
    kernel = light_stream.make_stream_kernel(queued)
    wp.compile_aot_module(kernel.module, arch=ARCH, module_dir=tmp_path)
    assert list(tmp_path.glob("*.cubin")) or list(tmp_path.glob("*.ptx"))


@pytest.mark.parametrize("name", EFFECTS)
def test_kernels_with_every_effect_compile_for_cuda(name, tmp_path):
    kernel = EFFECTS[name]
    switches = Switches(**dict.fromkeys(named(kernel), True))
    assert compiled(with_source(kernel, source_of(kernel), switches), tmp_path / "all", "cuda").binary
