"""Warp's headers are precompiled once for all processes, beside the compiled kernels."""

from collections.abc import Iterator
from pathlib import Path

import pytest
import warp as wp
from shadowbench.harness.frame.devices import start_warp


@pytest.fixture
def kernels(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """An empty folder of compiled kernels."""
    with monkeypatch.context() as changed:
        changed.setattr(wp.config, "kernel_cache_dir", str(tmp_path))
        start_warp()
        yield tmp_path
    start_warp()


def compiled(number: int) -> int:
    """What a kernel that has to be compiled writes: the number."""

    @wp.kernel(enable_backward=False, module="unique")
    def write_kernel(result: wp.array(dtype=wp.int32)):
        result[0] = wp.static(number)

    result = wp.zeros(1, dtype=wp.int32, device="cpu")
    wp.launch(write_kernel, dim=1, outputs=[result], device="cpu")
    return int(result.numpy()[0])


def test_the_copy_lies_beside_the_kernels_and_serves_the_next_one(kernels, capfd):
    assert compiled(41) == 41
    (copy,) = kernels.glob("wp_headers_*/*.pch")
    made = copy.stat().st_mtime_ns
    assert compiled(42) == 42
    assert copy.stat().st_mtime_ns == made
    assert "PCH" not in capfd.readouterr().err
