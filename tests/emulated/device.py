"""Makes Warp's CPU device one that takes the GPU's ways. For a process of its own, before the project is imported."""

import functools
import hashlib
import re
import sys
from collections.abc import Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import warp as wp
from shadowbench.harness.frame.devices import start_warp
from warp._src.context import ModuleBuilder  # the one name that is not public: it writes the C++ of a module

from .assembly import with_shared_memory, without_assembly

HEADER = Path(__file__).with_name("lanes.h")

WARP = "warp"
"""The package for which the CPU remains a CPU. For all other modules it counts as a GPU."""

BLOCK = 256
"""Threads of a block where a launch does not say, as on a GPU."""

MULTIPROCESSORS = 2
"""Few: kernels with threads for all of them then take several rounds. A block takes as long as its threads one by one."""

_HEADER_ENDS = "#define builtin_block_dim() wp::block_dim()\n"
"""In the C++ of a module: all that is Warp's own comes before."""

_THREAD = re.compile(r"    const size_t task_index = payload.*\n    \w+_cpu_kernel_forward<false>\(.*\n")
"""Where a thread of a block is run."""

_BEGIN = """    blockIdx.x = (uint)(payload->block_first / WP_TILE_BLOCK_DIM);
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
    wp.config.enable_cpu_blocks = True
    # Compiling takes longer than running.
    wp.config.optimization_level = 1
    wp.config.cpu_compiler_flags = "-march=native"
    start_warp()
    _keep_kernels_apart()
    _compile_with_header()
    _translate_snippets(replaced, unseen)
    _launch_in_blocks()
    stream = SimpleNamespace(is_capturing=False)
    streams = wp.Device.stream
    wp.Device.is_cuda = property(lambda device: device.ordinal >= 0 or not _asked_by_warp())
    wp.Device.is_cpu = property(lambda device: device.ordinal < 0 and _asked_by_warp())
    wp.Device.stream = streams.getter(lambda device: streams.fget(device) if device.ordinal >= 0 else stream)
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


def _translate_snippets(replaced: Sequence[tuple[str, str]], unseen: set[str]) -> None:
    """Of the functions that are defined from here on."""
    define = wp.Function.__init__

    def translated(snippet: str) -> str:
        for old, new in replaced:
            if old in snippet:
                unseen.discard(old)
            snippet = snippet.replace(old, new)
        return with_shared_memory(without_assembly(snippet))

    def define_translated(function: Any, *given: Any, native_snippet: str | None = None, **named: Any) -> None:
        define(function, *given, native_snippet=native_snippet and translated(native_snippet), **named)

    wp.Function.__init__ = define_translated


def _launch_in_blocks() -> None:
    """Of :data:`BLOCK` threads, where a launch does not say."""
    launch = wp.launch

    @functools.wraps(launch)
    def launch_in_blocks(*given: Any, block_dim: int | None = None, **named: Any) -> Any:
        return launch(*given, block_dim=block_dim if block_dim and block_dim > 0 else BLOCK, **named)

    wp.launch = launch_in_blocks


def _compile_with_header() -> None:
    write = ModuleBuilder.codegen

    def codegen(builder: Any, device: str) -> str:
        source: str = write(builder, device)
        in_order = "#define EMULATED_IN_ORDER\n" if _TILES.search(source) else ""
        threads = len(_THREAD.findall(source))
        if source.count(_HEADER_ENDS) != 1 or threads != source.count("_cpu_block_thunk_forward(\n"):
            raise RuntimeError(f"Warp {wp.__version__} compiles blocks in another way than this emulation expects")
        source = source.replace(_HEADER_ENDS, f'{_HEADER_ENDS}{in_order}#include "{HEADER}"\n')
        return _THREAD.sub(rf"{_BEGIN}\g<0>{_END}", source)

    ModuleBuilder.codegen = codegen


def _keep_kernels_apart() -> None:
    """A folder of compiled kernels for this version of the emulation: Warp knows of the snippets, not of what is around."""
    files = sorted(path for path in HEADER.parent.iterdir() if path.suffix == ".h" or path == Path(__file__))
    version = hashlib.sha256(b"".join(path.read_bytes() for path in files)).hexdigest()[:8]
    place = Path(wp.config.kernel_cache_dir) / f"emulated-{version}"
    place.mkdir(exist_ok=True)
    wp.config.kernel_cache_dir = str(place)


def _asked_by_warp() -> bool:
    """Whether the function that reads a property of a device is one of Warp's."""
    return str(sys._getframe(2).f_globals.get("__name__", "")).partition(".")[0] == WARP
