"""Embree's own C interface, through ctypes: the library that is in the wheel of embreex.

embreex exposes neither build quality, refit, packets nor thread counts. Names and numbers are those of ``embree4/rtcore.h``
(Embree 4 API reference). The major version is asserted when the library is loaded.
"""

import ctypes
import functools
import importlib.metadata
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...harness.errors import UserError

VERSION, VERSION_MAJOR = 0, 1
"""Properties of a device: RTC_DEVICE_PROPERTY_VERSION, ..._MAJOR."""

TRIANGLES = 0
INDICES, VERTICES = 0, 1
UINT3, FLOAT3 = 0x5003, 0x9003
DYNAMIC, ROBUST = 1, 4
QUALITIES = {"low": 0, "medium": 1, "high": 2}
REFIT = 3

_p, _u, _z = ctypes.c_void_p, ctypes.c_uint, ctypes.c_size_t
SIGNATURES = {
    "rtcNewDevice": (_p, [ctypes.c_char_p]),
    "rtcReleaseDevice": (None, [_p]),
    "rtcGetDeviceError": (ctypes.c_int, [_p]),
    "rtcGetDeviceProperty": (ctypes.c_ssize_t, [_p, ctypes.c_int]),
    "rtcNewScene": (_p, [_p]),
    "rtcReleaseScene": (None, [_p]),
    "rtcSetSceneFlags": (None, [_p, ctypes.c_int]),
    "rtcSetSceneBuildQuality": (None, [_p, ctypes.c_int]),
    "rtcCommitScene": (None, [_p]),
    "rtcNewGeometry": (_p, [_p, ctypes.c_int]),
    "rtcReleaseGeometry": (None, [_p]),
    "rtcSetGeometryBuildQuality": (None, [_p, ctypes.c_int]),
    "rtcSetSharedGeometryBuffer": (None, [_p, ctypes.c_int, _u, ctypes.c_int, _p, _z, _z, _z]),
    "rtcUpdateGeometryBuffer": (None, [_p, ctypes.c_int, _u]),
    "rtcCommitGeometry": (None, [_p]),
    "rtcAttachGeometry": (_u, [_p, _p]),
    "rtcIntersect1": (None, [_p, _p, _p]),
    "rtcOccluded1": (None, [_p, _p, _p]),
    "rtcIntersect16": (None, [_p, _p, _p, _p]),
    "rtcOccluded16": (None, [_p, _p, _p, _p]),
}


def library_path() -> Path:
    """Where embreex keeps Embree 4. Raises :class:`UserError` where it is not."""
    try:
        package = importlib.metadata.distribution("embreex")
    except importlib.metadata.PackageNotFoundError:
        raise UserError("embree: the package embreex is not installed; pip install embreex") from None
    for file in package.files or ():
        path = Path(str(package.locate_file(file)))
        if path.name.startswith(("libembree4", "embree4")) and path.is_file():
            if path.suffix != ".lib" and path.suffix != ".h":
                return path
    raise UserError(
        f"embree: embreex {package.version} has no library libembree4 beside it; install its wheel: "
        "pip install --force-reinstall --only-binary embreex embreex"
    )


@functools.cache
def library() -> ctypes.CDLL:
    """The library with the signatures of what is used. Raises :class:`UserError` where it cannot be used."""
    path = library_path()
    try:
        import embreex.rtcore  # noqa: F401  (it loads TBB, which Embree needs)

        found = ctypes.CDLL(str(path))
        for name, (result, arguments) in SIGNATURES.items():
            function = getattr(found, name)
            function.restype, function.argtypes = result, arguments
    except (OSError, ImportError, AttributeError) as error:
        raise UserError(f"embree: {path} cannot be used ({error}); reinstall embreex") from error
    return found


def address(name: str) -> int:
    """The address of a function of the library, for kernels that call it."""
    return int(ctypes.cast(getattr(library(), name), ctypes.c_void_p).value or 0)


class Device:
    """An Embree device. ``threads`` build; 0: one for each core."""

    def __init__(self, threads: int = 0):
        self._library = library()
        self._handle = self._library.rtcNewDevice(f"threads={threads}".encode() if threads else None)
        if not self._handle:
            raise UserError(f"embree: no device ({self._library.rtcGetDeviceError(None)}); reinstall embreex")
        if self.fact(VERSION_MAJOR) != 4:
            raise UserError(
                f"embree: version {self.version}; the layout of rays is that of Embree 4: pip install 'embreex>=4'"
            )

    def fact(self, number: int) -> int:
        """A property of the device."""
        return int(self._library.rtcGetDeviceProperty(self._handle, number))

    @property
    def version(self) -> str:
        """The version of Embree."""
        number = self.fact(VERSION)
        return f"{number // 10000}.{number // 100 % 100}.{number % 100}"

    def check(self) -> None:
        """Raises RuntimeError if a call since the last check failed."""
        error = self._library.rtcGetDeviceError(self._handle)
        if error:
            raise RuntimeError(f"Embree reports error {error} (RTCError)")

    def __del__(self) -> None:
        if getattr(self, "_handle", None):
            self._library.rtcReleaseDevice(self._handle)


class TriangleScene:
    """A scene of one triangle mesh, whose vertices may move.

    faces    int32 [n, 3]; points  float32 [m, 3]: copied on every commit
    quality  "low", "medium" or "high"
    refit    whether later commits refit the tree of the first, which Embree makes at medium quality. It does so only in a
             dynamic scene of low quality: at any other, the tree is built again
    """

    def __init__(
        self,
        device: Device,
        points: NDArray[np.float32],
        faces: NDArray[np.int32],
        quality: str,
        robust: bool,
        refit: bool,
    ):
        self._device, self._library = device, device._library
        lib, level = self._library, QUALITIES["low" if refit else quality]
        self._faces = np.ascontiguousarray(faces, dtype=np.uint32)
        # Embree reads 16 bytes per vertex.
        self._memory = np.zeros(3 * len(points) + 4, dtype=np.float32)
        self._points = self._memory[: 3 * len(points)].reshape(-1, 3)
        self._points[:] = points
        self._scene = lib.rtcNewScene(device._handle)
        lib.rtcSetSceneFlags(self._scene, (ROBUST if robust else 0) | (DYNAMIC if refit else 0))
        lib.rtcSetSceneBuildQuality(self._scene, level)
        self._mesh = lib.rtcNewGeometry(device._handle, TRIANGLES)
        lib.rtcSetGeometryBuildQuality(self._mesh, REFIT if refit else level)
        for kind, layout, array, count in (
            (INDICES, UINT3, self._faces, len(faces)),
            (VERTICES, FLOAT3, self._memory, len(points)),
        ):
            lib.rtcSetSharedGeometryBuffer(self._mesh, kind, 0, layout, array.ctypes.data, 0, 12, count)
        lib.rtcCommitGeometry(self._mesh)
        lib.rtcAttachGeometry(self._scene, self._mesh)
        lib.rtcCommitScene(self._scene)
        device.check()

    @property
    def handle(self) -> int:
        """What kernels take as the scene."""
        return int(self._scene)

    def commit(self, points: NDArray[np.float32]) -> None:
        """Copy the first vertices and build the tree again, or refit it. Further vertices stay as they are."""
        lib = self._library
        self._points[: len(points)] = points
        lib.rtcUpdateGeometryBuffer(self._mesh, VERTICES, 0)
        lib.rtcCommitGeometry(self._mesh)
        lib.rtcCommitScene(self._scene)

    def __del__(self) -> None:
        if getattr(self, "_scene", None):
            self._library.rtcReleaseScene(self._scene)
        if getattr(self, "_mesh", None):
            self._library.rtcReleaseGeometry(self._mesh)
