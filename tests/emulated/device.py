"""Makes Warp's CPU device one that takes the GPU's ways. For a process of its own, before the project is imported."""

from __future__ import annotations

import atexit
import hashlib
import re
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import warp as wp
from shadowbench.harness.frame.warp_init import start_warp
from warp._src import codegen, context

from .assembly import with_shared_memory, without_assembly

HEADER = Path(__file__).with_name("lanes.h")

WARP = "warp"
"""The package for which the CPU remains a CPU. For all other modules it counts as a GPU."""

BLOCK = 256
"""Threads of a block where a launch does not say, as on a GPU."""

MULTIPROCESSORS = 2
"""Few: kernels with threads for all of them then take several rounds. A block takes as long as its threads one by one."""

_BLOCK_INDEX = """    blockIdx.x = (uint)(payload->block_first / WP_TILE_BLOCK_DIM);
    gridDim.x = (uint)((dim->size + WP_TILE_BLOCK_DIM - 1) / WP_TILE_BLOCK_DIM);
    emulated_begin(lane, dim->size - payload->block_first);
"""

_END = "    emulated_end(lane);\n"

_TILES = re.compile(r"\bwp::tile(_[a-z_]+)?\(")
"""A call of one of Warp's functions for the threads of a block, in the code of a module."""


def install(replaced: Sequence[tuple[str, str]] = ()) -> set[str]:
    """From here on kernels are compiled with :data:`HEADER`, and ``is_cuda`` of the CPU device is true but for Warp itself.

    ``replaced``: texts of snippets and what stands in their place. Returns those that no snippet has held yet.
    """
    unseen = {old for old, _ in replaced}
    _compile_with_header(replaced, unseen)
    wp.config.enable_cpu_blocks = True
    start_warp()
    _keep_kernels_apart(replaced)
    resolve = context._resolve_launch_block_dim

    def block_dim(device: context.Device, wanted: int | None) -> int:
        return resolve(device, BLOCK if wanted is None or wanted <= 0 else wanted)

    context._resolve_launch_block_dim = block_dim
    stream = SimpleNamespace(is_capturing=False)
    streams = context.Device.stream
    context.Device.is_cuda = property(lambda device: device.ordinal >= 0 or not _asked_by_warp())
    context.Device.is_cpu = property(lambda device: device.ordinal < 0 and _asked_by_warp())
    context.Device.stream = streams.getter(lambda device: streams.fget(device) if device.ordinal >= 0 else stream)
    wp.get_device("cpu").sm_count = MULTIPROCESSORS
    from shadowbench.harness.frame.method import BaseMethod
    from shadowbench.harness.frame.schedule.runner import PassRunner
    from shadowbench.methods.common import bounds

    bounds.BLOCKS = 2 * MULTIPROCESSORS
    PassRunner.replays = property(lambda runner: False)  # type: ignore[method-assign, assignment]
    _take_methods_for_gpus(BaseMethod)
    return unseen


def _take_methods_for_gpus(method: Any) -> None:
    """Those that run on GPUs only, too."""
    applies = method.applies

    def anywhere(self: Any, scene: Any, device: str) -> str | None:
        return applies(self, scene, "cuda" if "cuda" in self.devices else device)

    method.applies = anywhere


def _compile_with_header(replaced: Sequence[tuple[str, str]], unseen: set[str]) -> None:
    generate = codegen.codegen_snippet

    def codegen_snippet(adj: Any, name: str, snippet: str, *more: Any, **named: Any) -> str:
        for old, new in replaced:
            if old in snippet:
                unseen.discard(old)
            snippet = snippet.replace(old, new)
        told = f"#if 0\n{snippet}\n#endif\n"  # by which kernels with a replaced text are found
        return generate(adj, name, told + with_shared_memory(without_assembly(snippet)), *more, **named)

    codegen.codegen_snippet = codegen_snippet
    codegen.cpu_module_header += f'#include "{HEADER}"\n'
    template = codegen.cpu_block_module_template_forward
    begin = "    const size_t task_index ="
    call = "    {name}_cpu_kernel_forward<false>(*dim, task_index, payload->args);\n"
    if template.count(begin) != 1 or template.count(call) != 1:
        raise RuntimeError(f"Warp {wp.__version__} compiles blocks in another way than this emulation expects")
    template = template.replace(begin, _BLOCK_INDEX + begin).replace(call, call + _END)
    codegen.cpu_block_module_template_forward = template
    write = context.ModuleBuilder.codegen

    def codegen_module(builder: Any, device: str) -> str:
        source: str = write(builder, device)
        return "#define EMULATED_IN_ORDER\n" + source if _TILES.search(source) else source

    context.ModuleBuilder.codegen = codegen_module


def _keep_kernels_apart(replaced: Sequence[tuple[str, str]]) -> None:
    """A folder of compiled kernels for this version of the emulation, since Warp does not know that they differ.

    With replaced texts it is another one, which is removed at the end, and has links to the kernels without these texts.
    """
    files = sorted(path for path in HEADER.parent.iterdir() if path.suffix in (".h", ".py"))
    version = hashlib.sha256(b"".join(path.read_bytes() for path in files)).hexdigest()[:8]
    place = Path(wp.config.kernel_cache_dir) / f"emulated-{version}"
    place.mkdir(exist_ok=True)
    if replaced:
        own = tempfile.TemporaryDirectory(prefix="shadowbench-emulated-")
        atexit.register(own.cleanup)
        for module in place.iterdir():
            sources = [path.read_text() for path in module.glob("*.cpp")]
            if sources and not any(old in text for old, _ in replaced for text in sources):
                (Path(own.name) / module.name).symlink_to(module)
        place = Path(own.name)
    wp.config.kernel_cache_dir = str(place)


def _asked_by_warp() -> bool:
    """Whether the function that reads a property of a device is one of Warp's."""
    return str(sys._getframe(2).f_globals.get("__name__", "")).partition(".")[0] == WARP
