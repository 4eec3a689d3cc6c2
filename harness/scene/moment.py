"""One moment of a scene: the arrays of a frame on the host, and the tables of its rays."""

from dataclasses import dataclass, field

import numpy as np

from ..arrays import F32, F64, U8, Ints
from ..errors import UserError
from .scene import Camera, Light

NEARER = 2.0**-32  # share of the distance to a directional light at which its post lies: 2^24 radii away


@dataclass(frozen=True, eq=False)
class Moment:
    """Everything that a frame is made from, on the host.

    points   float32 [vertex_count, 3]
    valid    uint8 [triangle_count]: 0 for zero-area, NaN and infinite triangles, which are never hit
    eye      float32 [3]
    axes     float32 [3, 3]: right, up, forward, unit length
    tangents float32 [2]: half width and half height of the image plane at distance 1 along forward
    column   float32 [width, 3], row float32 [height, 3]: a pixel's direction is column[x] + row[y], one float32 addition
             per component; its forward part is 1 up to rounding, so t is the depth along forward
    orthographic  whether the rays are parallel: column[x] + row[y] is where a pixel's ray starts, its direction is forward,
             and ``tangents`` are half the width and height of what the image shows
    lights   float32 [light_count, 3]
    spots    float64 [light_count, 12]: the spot of each light (:mod:`.judge.receivers`); no row: not limited
    proxy_positions    float32 [light_count, 3]: the points from which a structure may be built in place of the lights.
             For a light with a position this is the light; for a directional light it is the point at :data:`NEARER` of
             its distance. A ray of the light lies within 2^-23 of its direction as seen from the proxy, relative to the
             angle between that direction and the direction to the scene's middle
    max_coordinate  float32 [1]: a power of two that no coordinate of scene and eye exceeds; bounds on rounding are
             proportional to it. It does not change while the camera moves near the scene, so that a structure does not
             depend on the eye
    facing   whether only hit points that face a light have a shadow ray to it
    """

    index: int
    points: F32
    valid: U8
    eye: F32
    axes: F32
    tangents: F32
    column: F32
    row: F32
    lights: F32
    spots: F64 = field(default_factory=lambda: np.zeros((0, 12)))
    facing: bool = False
    max_coordinate: F32 = field(default_factory=lambda: np.ones(1, dtype=np.float32))
    proxy_positions: F32 | None = None
    orthographic: bool = False

    @property
    def width(self) -> int:
        return len(self.column)

    @property
    def height(self) -> int:
        return len(self.row)

    def directions(self, pixels: Ints) -> F32:
        """The float32 directions [n, 3] of the given pixel indices (row * width + column)."""
        if self.orthographic:
            return np.broadcast_to(self.axes[2], (len(pixels), 3))
        return self._sums(pixels)

    def origins(self, pixels: Ints) -> F32:
        """The origins of the rays of the given pixel indices, float32 [n, 3]."""
        if self.orthographic:
            return self._sums(pixels)
        return np.broadcast_to(self.eye, (len(pixels), 3))

    def _sums(self, pixels: Ints) -> F32:
        return self.column[pixels % self.width] + self.row[pixels // self.width]


def proxy_positions_of(positions: F32, lights: tuple[Light, ...]) -> F32:
    """Float32 [light_count, 3]: see :attr:`Moment.proxy_positions`. Scaled by a power of two: exact directions."""
    scale = [NEARER if light.directional else 1.0 for light in lights]
    return np.ascontiguousarray(positions * np.array(scale, dtype=np.float32).reshape(-1, 1))


def max_coordinate_of(starts: F32, extent: float) -> F32:
    """Float32 [1]: the least power of two from eight times ``extent`` upwards that bounds the coordinates of ``starts``."""
    most = max(8.0 * extent, float(np.abs(starts).max()))
    return np.array([2.0 ** np.ceil(np.log2(min(most, 2.0**126)))], dtype=np.float32)


def ray_tables(camera: Camera, width: int, height: int, centre: F64) -> tuple[F32, F32, F32, F32, F32]:
    """Eye [3], axes [3, 3], tangents [2], column [width, 3], row [height, 3], all float32. Pixel (x, y) has its centre
    at (x + 0.5, y + 0.5), row 0 at the top; square pixels; ``fov`` and ``height`` are vertical.
    """
    if width < 1 or height < 1:
        raise UserError(f"image size {width}x{height}: both must be at least 1")
    eye = np.asarray(camera.eye, dtype=np.float64)
    forward = np.asarray(camera.target, dtype=np.float64) - eye
    if not np.isfinite(forward).all() or not forward.any():
        raise UserError("camera: eye and target must be finite and different")
    forward /= np.abs(forward).max()
    forward /= np.linalg.norm(forward)
    up = np.asarray(camera.up, dtype=np.float64)
    right = np.cross(forward, up)
    if not np.isfinite(up).all() or np.linalg.norm(right) <= 1e-9 * np.linalg.norm(up):
        raise UserError("camera: up must be finite and not parallel to the view; choose another up")
    if camera.height is None and not 0.0 < camera.fov < 180.0:
        raise UserError(f"camera: fov {camera.fov} degrees must be more than 0 and less than 180")
    if camera.height is not None and not 0.0 < camera.height < np.inf:
        raise UserError(f"camera: height {camera.height} must be finite and greater than 0")
    right /= np.linalg.norm(right)
    true_up = np.cross(right, forward)
    half = np.tan(np.radians(camera.fov) / 2) if camera.height is None else camera.height / 2
    tangents = np.array([half * width / height, half])
    x = (2 * (np.arange(width) + 0.5) / width - 1) * tangents[0]
    y = (1 - 2 * (np.arange(height) + 0.5) / height) * tangents[1]
    column = (forward if camera.height is None else eye - centre) + x[:, None] * right
    row = y[:, None] * true_up
    exact = (eye - centre, np.stack([right, true_up, forward]), tangents, column, row)
    start, axes, tangents, column, row = (np.ascontiguousarray(table, dtype=np.float32) for table in exact)
    return start, axes, tangents, column, row
