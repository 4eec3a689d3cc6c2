"""A device of slangpy in Warp's own CUDA context, the pipeline of its shaders, and what a machine may lack for them."""

from __future__ import annotations

import ctypes
import functools
import importlib.metadata
import os
import sys
from pathlib import Path
from typing import Any

import warp as wp

from ...harness.errors import UserError, one_line

RAY_GENERATION = ("closest", "shadow")
"""The entry points of ``rays.slang`` that make rays, in the order of the shader table."""

PAYLOAD = 16
"""Bytes of ``Hit`` in ``rays.slang``."""

OPTIX = {"linux": "libnvoptix.so.1", "win32": "nvoptix.dll"}
"""The library of the driver in which OptiX is."""


@functools.cache
def missing() -> str | None:
    """What this machine lacks, with what to install; None if nothing is known to be missing."""
    try:
        importlib.metadata.version("slangpy")
    except importlib.metadata.PackageNotFoundError:
        return "the package slangpy is not installed; pip install 'shadowbench-rt[driver]'"
    library = OPTIX.get(sys.platform, "OptiX")
    try:
        ctypes.CDLL(library)
    except OSError:
        return (
            f"the NVIDIA driver's library {library} is missing; install the driver with its graphics part (in a "
            "container: NVIDIA_DRIVER_CAPABILITIES=all)"
        )
    if sys.platform == "linux" and not any(_has_headers(folder) for folder in _toolkits()):
        return (
            "cuda_runtime.h of a CUDA toolkit is not found; install the toolkit (NVRTC and headers suffice) and set "
            "CUDA_PATH to its folder"
        )
    return None


def _toolkits() -> list[Path]:
    """Where slangpy looks for a CUDA toolkit on Linux."""
    named = [Path(path) for path in (os.environ.get("CUDA_PATH"),) if path]
    return [*named, *sorted(Path("/usr/local").glob("cuda*"), reverse=True), Path("/usr")]


def _has_headers(toolkit: Path) -> bool:
    """Whether a CUDA toolkit has the headers that shaders are compiled with."""
    folders = ("include", "targets/x86_64-linux/include")
    return any((toolkit / folder / "cuda_runtime.h").is_file() for folder in folders)


@functools.cache
def device_of(alias: str) -> Any:
    """The slangpy device of a CUDA device of Warp, in Warp's context. It lives as long as the process.

    Raises :class:`UserError` where the driver offers no ray tracing.
    """
    import slangpy

    wp.zeros(1, device=alias)  # the context exists
    try:
        with wp.ScopedDevice(alias):
            made = slangpy.Device(
                type=slangpy.DeviceType.cuda,
                existing_device_handles=slangpy.get_cuda_current_context_native_handles(),
                enable_rhi_validation=False,
                enable_hot_reload=False,
            )
    except RuntimeError as error:
        raise UserError(f"driver: slangpy makes no device ({one_line(error)}); update the NVIDIA driver") from error
    if not made.has_feature(slangpy.Feature.ray_tracing):
        raise UserError(
            "driver: the driver offers no OptiX that slangpy knows (8.0, 8.1, 9.0); update the NVIDIA driver"
        )
    return made


@functools.cache
def pipeline_of(alias: str, holes: bool) -> tuple[Any, Any, Any]:
    """Program, pipeline and shader table of ``rays.slang`` on a device; ``holes``: with the any-hit shader."""
    import slangpy

    device = device_of(alias)
    file = Path(__file__).with_name("rays.slang")
    module = device.load_module_from_source("shadowbench_rays", file.read_text(encoding="utf-8"), file)
    names = (*RAY_GENERATION, "missed", "found", *(("holed",) if holes else ()))
    try:
        program = device.link_program([module], [module.entry_point(name) for name in names])
        group = slangpy.HitGroupDesc(
            hit_group_name="triangles", closest_hit_entry_point="found", any_hit_entry_point="holed" if holes else ""
        )
        pipeline = device.create_ray_tracing_pipeline(
            program=program, hit_groups=[group], max_recursion=1, max_ray_payload_size=PAYLOAD
        )
    except RuntimeError as error:
        raise UserError(
            f"driver: the shaders do not compile here ({one_line(error)}); set CUDA_PATH to a CUDA toolkit that the "
            "driver supports"
        ) from error
    table = device.create_shader_table(
        program=program,
        ray_gen_entry_points=list(RAY_GENERATION),
        miss_entry_points=["missed"],
        hit_group_names=["triangles"],
    )
    return program, pipeline, table


def submit(alias: str, encoder: Any) -> None:
    """Submit what an encoder holds to the current stream of Warp. The host does not wait."""
    import slangpy

    stream = slangpy.NativeHandle.from_cuda_stream(wp.get_stream(alias).cuda_stream)
    device_of(alias).submit_command_buffer(encoder.finish(), cuda_stream=stream)


def version() -> str:
    """The version of slangpy."""
    return importlib.metadata.version("slangpy")


def optix_version(alias: str) -> str:
    """The version of OptiX that a device uses."""
    number = int(device_of(alias).info.optix_version)
    return f"{number // 10000}.{number % 10000 // 100}"
