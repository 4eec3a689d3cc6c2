"""A device of slangpy by OptiX or Vulkan, the pipeline of its shaders, and what a machine may lack for them."""

import ctypes
import functools
import importlib.metadata
import os
import sys
from pathlib import Path
from typing import Any

import warp as wp

from ...harness.errors import UserError, one_line
from ...harness.frame.cards import UNITS, has_ray_tracing_units

RAY_GENERATION = ("closest", "shadow")
"""The entry points of ``rays.slang`` that make rays, in the order of the shader table."""

PAYLOAD = 16
"""Bytes of ``Hit`` in ``rays.slang``."""

LIBRARIES = {
    "optix": {"linux": "libnvoptix.so.1", "win32": "nvoptix.dll"},
    "vulkan": {"linux": "libvulkan.so.1", "win32": "vulkan-1.dll"},
}
"""The library in which an API is: a part of the NVIDIA driver, and Vulkan's loader."""


@functools.cache
def missing(api: str) -> str | None:
    """What this machine lacks for an API, with what to install; None if nothing is known to be missing."""
    try:
        importlib.metadata.version("slangpy")
    except importlib.metadata.PackageNotFoundError:
        return "the package slangpy is not installed; pip install 'shadowbench-rt[driver]'"
    library = LIBRARIES[api].get(sys.platform, "")
    try:
        ctypes.CDLL(library)
    except OSError:
        if api == "vulkan":
            return f"Vulkan's library {library} is missing; install the loader (libvulkan1) and the GPU's driver"
        return (
            f"the NVIDIA driver's library {library} is missing; install the driver with its graphics part (in a "
            "container: NVIDIA_DRIVER_CAPABILITIES=all)"
        )
    headers = ("include/cuda_runtime.h", "targets/x86_64-linux/include/cuda_runtime.h")
    found = any((toolkit / file).is_file() for toolkit in _toolkits() for file in headers)
    if api == "optix" and sys.platform == "linux" and not found:
        return (
            "cuda_runtime.h of a CUDA toolkit is not found; install the toolkit (NVRTC and headers suffice) and set "
            "CUDA_PATH to its folder"
        )
    return None


def _toolkits() -> list[Path]:
    """Where slangpy looks for a CUDA toolkit on Linux."""
    named = os.environ.get("CUDA_PATH")
    return [*([Path(named)] if named else []), *sorted(Path("/usr/local").glob("cuda*"), reverse=True), Path("/usr")]


@functools.cache
def device_of(api: str, alias: str) -> Any:
    """The slangpy device: for OptiX in the context of a CUDA device of Warp, for Vulkan the first that it finds. It lives
    as long as the process.

    Raises :class:`UserError` where the driver offers no ray tracing.
    """
    import slangpy

    slangpy.Logger.get().level = slangpy.LogLevel.error  # it writes warnings to where results are written
    kind, own = slangpy.DeviceType.vulkan, {}
    with wp.ScopedDevice(alias):
        if api == "optix":
            wp.zeros(1)  # Warp's context exists
            kind = slangpy.DeviceType.cuda
            own = {"existing_device_handles": slangpy.get_cuda_current_context_native_handles()}
        try:
            made = slangpy.Device(type=kind, enable_rhi_validation=False, enable_hot_reload=False, **own)
        except RuntimeError as error:
            raise UserError(f"driver: slangpy makes no device ({one_line(error)}); update the GPU's driver") from error
    if not made.has_feature(slangpy.Feature.ray_tracing):
        raise UserError(f"driver: {made.info.adapter_name} offers no ray tracing by {api}; update the GPU's driver")
    return made


@functools.cache
def pipeline_of(api: str, alias: str, holes: bool) -> tuple[Any, Any, Any]:
    """Program, pipeline and shader table of ``rays.slang`` on a device; ``holes``: with the any-hit shader."""
    import slangpy

    device = device_of(api, alias)
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
            f"driver: the shaders do not compile here ({one_line(error)}); for OptiX, set CUDA_PATH to a CUDA toolkit "
            "that the driver supports"
        ) from error
    table = device.create_shader_table(
        program=program,
        ray_gen_entry_points=list(RAY_GENERATION),
        miss_entry_points=["missed"],
        hit_group_names=["triangles"],
    )
    return program, pipeline, table


def facts_of(api: str, alias: str) -> dict[str, str]:
    """API, adapter, version of slangpy, and whether rays are traced by units of the hardware, for records and tables."""
    import slangpy

    device = device_of(api, alias)
    number = int(device.info.optix_version)
    if api == "optix":
        card = wp.get_device(alias)
        has = {True: "yes", False: "none", None: "unknown"}[has_ray_tracing_units(int(card.arch), str(card.name))]
        own = {"api": f"OptiX {number // 10000}.{number % 10000 // 100}", UNITS: has}
    else:
        software = device.has_feature(slangpy.Feature.software_device)
        own = {"api": "Vulkan", "adapter": device.info.adapter_name, UNITS: "none" if software else "unknown"}
    return own | {"slangpy": importlib.metadata.version("slangpy")}
