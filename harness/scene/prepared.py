"""Prepared scenes: recentred in float64, rounded to float32 once, with welded vertices and zero-area flags. Every
method, Embree and the referee get the same arrays. A :class:`Moment` is one frame of a prepared scene, at one image
size, with its lights.
"""

import hashlib
from collections.abc import Callable
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import lru_cache
from weakref import WeakValueDictionary

import numpy as np

from ..arrays import F32, F64, I32, U8
from ..errors import UserError
from .alpha import alpha_of
from .corner_order import in_order_of_duplicates
from .moment import Moment, max_coordinate_of, proxy_positions_of, ray_tables
from .scene import AlphaMask, Camera, Geometry, Light, Scene
from .targets import targets_of

INFINITELY_FAR = 2.0**56
"""Distance of a directional light in scene radii: so far that a coordinate of the scene added to it is rounded away in 53
bits.
"""

SHRUNK = 2.0**-4
"""Share of the first frame's extent below which a frame has a scale of its own. Nearer than 2^28 times a mesh's size, a
light's post is not so far away that float64 loses the mesh.
"""


@dataclass(frozen=True, eq=False)
class Prepared:
    """A scene recentred, rounded and welded: the arrays that all methods receive. Made by :func:`prepare`.

    scene     lights, camera and effects; :func:`under` gives the same geometry with another scene
    geometry  the mesh over time, as the scene made it, in float64
    faces     int32 [triangle_count, 3]; duplicates list their corners in one order (:mod:`.scene.corner_order`)
    centre    float64 [3]: the point that was subtracted. Zero where the bounding box lies within its own size of the
              origin: subtracting would gain nothing, and the float32 values of the file remain unchanged
    weld      int32 [vertex_count]: see :func:`weld`
    middle    float64 [3]: the middle of the first frame's bounding box, recentred
    radius    half the diagonal of that box
    alpha     the scene's mask of holes, checked (:func:`.scene.alpha.checked`), or None
    mirror    uint8 [triangle_count]: 1 for each triangle that is a mirror
    points    points(frame): float32 positions [vertex_count, 3] and validity flags uint8 [triangle_count]
    """

    scene: Scene
    geometry: Geometry
    faces: I32
    centre: F64
    weld: I32
    middle: F64
    radius: float
    alpha: AlphaMask | None
    mirror: U8
    points: Callable[[int], tuple[F32, U8]]

    @property
    def frame_count(self) -> int:
        return self.geometry.frame_count

    @property
    def moves(self) -> bool:
        """Whether the mesh moves. The lights may, whatever this says."""
        return self.geometry.moves

    @property
    def bodies(self) -> I32 | None:
        """The body of each triangle, 0, 1, 2, ..., int32 [triangle_count]; None: the mesh deforms, or nothing says what of
        it moves together. A mesh that does not move is one body, unless its scene names more.
        """
        motion = self.geometry.motion
        if motion is None or motion.bodies is None:
            return None if self.moves else np.zeros(self.triangle_count, dtype=np.int32)
        if np.shape(motion.bodies) != (self.triangle_count,):
            given = f"bodies of shape {np.shape(motion.bodies)}"
            raise UserError(f"{self.scene.name}: {given}, but there are {self.triangle_count} triangles")
        return np.unique(motion.bodies, return_inverse=True)[1].astype(np.int32).ravel()

    @property
    def triangle_count(self) -> int:
        return len(self.faces)

    @property
    def vertex_count(self) -> int:
        return len(self.weld)

    def moment(
        self, frame: int, width: int, height: int, camera: Camera | None = None, lights: tuple[Light, ...] | None = None
    ) -> Moment:
        """One frame at one image size. ``camera`` and ``lights`` default to the scene's, moved along its path. Of lights
        it has the targets.
        """
        from .spotlight import spot_rows

        points, valid = self.points(frame)
        chosen = camera or self.scene.camera
        given = self.lights(frame) if lights is None else lights
        lights = targets_of(given, self.middle + self.centre, self.scene.camera.up)
        parallel = chosen.height is not None
        eye, axes, tangents, column, row = ray_tables(chosen, width, height, self.centre)
        starts = np.abs(column).max(axis=0) + np.abs(row).max(axis=0) if parallel else eye
        scale, extent = self.scale(points)
        positions = np.array([self.light_point(light, scale) for light in lights]).reshape(-1, 3).astype(np.float32)
        reach, proxies = max_coordinate_of(starts, extent), proxy_positions_of(positions, lights)
        spots, facing = spot_rows(lights), self.scene.facing
        return Moment(
            frame, points, valid, eye, axes, tangents, column, row, positions, spots, facing, reach, proxies, parallel
        )

    def scale(self, points: F32) -> tuple[float, float]:
        """The radius from which a frame's directional lights are placed, and a bound on its finite coordinates.

        points  float32 [vertex_count, 3]: those of the frame

        Both are the first frame's while the mesh keeps its size, so that lights and structures rest where nothing else
        changes. A mesh that grows beyond this bound, or shrinks below :data:`SHRUNK` of it, has the scale of its largest
        coordinate: it would reach the proxies of its lights, or be lost in the rounding of the way to them.
        """
        extent = self.radius + float(np.abs(self.middle).max())
        size = largest_coordinate(points) if self.moves else 0.0
        if size == 0.0 or SHRUNK * extent <= size <= extent:
            return self.radius, extent
        return size, size

    def light_point(self, light: Light, radius: float) -> F64:
        """The position of a light, recentred, float64 [3]. ``radius``: see :meth:`scale`.

        A directional light is placed at :data:`INFINITELY_FAR` radii (rounded up to a power of two) in its
        direction. There ``p - light`` rounds to ``-light`` in float64 for every point p of the frame, so that everything
        computed from differences equals the limit, and exact arithmetic differs from the limit by less than the
        resolution of float64.
        """
        position = np.asarray(light.position, dtype=np.float64)
        if not light.directional:
            return position - self.centre
        size = np.abs(position).max(initial=0.0)
        if not 0.0 < size < np.inf:
            raise UserError(f"directional light: its direction {light.position} must be finite and not zero")
        way = position / size
        scale = 2.0 ** np.ceil(np.log2(radius))
        if INFINITELY_FAR * scale > np.finfo(np.float32).max:
            raise UserError(
                f"directional light: the scene has a radius of {radius:.3g}, too large for one; scale it below "
                f"{float(np.finfo(np.float32).max) / INFINITELY_FAR / 2:.2g}, or use a light with a position"
            )
        return way / np.linalg.norm(way) * (INFINITELY_FAR * scale)

    def lights(self, frame: int) -> tuple[Light, ...]:
        """The scene's lights at a frame, moved along its light path."""
        path = self.scene.light_path
        if path is None:
            return self.scene.lights
        share = frame / max(1, self.frame_count - 1)
        return path.at(self.scene.lights, share)

    def sha256(self, frame: int = 0) -> str:
        """Hash of the arrays as all methods get them: float32 positions of a frame, then faces in their order."""
        digest = hashlib.sha256(np.ascontiguousarray(self.points(frame)[0]).tobytes())
        digest.update(self.faces.tobytes())
        return digest.hexdigest()


def prepare(scene: Scene) -> Prepared:
    """Recentre, round and weld a scene. Raises :class:`UserError` for a mesh, mask or mirrors that do not fit."""
    geometry = scene.geometry()
    faces = np.ascontiguousarray(geometry.faces, dtype=np.int32).reshape(-1, 3)
    first = np.asarray(geometry.positions(0), dtype=np.float64).reshape(-1, 3)
    check_faces(faces, len(first), scene.name)
    centre = recentre(first)
    low, high = finite_bounds(first - centre)
    welds = weld(first - centre)
    faces = in_order_of_duplicates(faces, welds, scene.closed)
    middle, radius = (low + high) / 2, float(np.linalg.norm(high - low) / 2) or 1.0
    alpha, mirror, points = (
        alpha_of(scene, geometry, faces),
        mirror_of(scene, geometry),
        rounded(geometry, faces, centre),
    )
    return Prepared(scene, geometry, faces, centre, welds, middle, radius, alpha, mirror, points)


def under(prepared: Prepared, scene: Scene) -> Prepared:
    """The same mesh with another scene's lights, camera and effects. The arrays of the mesh are shared."""
    alpha, mirror = prepared.alpha, prepared.mirror
    if scene.alpha is not prepared.scene.alpha:
        alpha = alpha_of(scene, prepared.geometry, prepared.faces)
    if scene.mirror is not prepared.scene.mirror:
        mirror = mirror_of(scene, prepared.geometry)
    return replace(prepared, scene=scene, alpha=alpha, mirror=mirror)


def rounded(geometry: Geometry, faces: I32, centre: F64) -> Callable[[int], tuple[F32, U8]]:
    """The float32 positions and validity flags of each frame, by its index. The last frame is kept, and any other whose
    arrays something else still holds, as moments do; a mesh that does not move has one frame's.
    """
    held: tuple[WeakValueDictionary[int, F32], WeakValueDictionary[int, U8]]
    held = WeakValueDictionary(), WeakValueDictionary()

    @lru_cache(maxsize=1)
    def made(frame: int) -> tuple[F32, U8]:
        points, valid = held[0].get(frame), held[1].get(frame)
        if points is None or valid is None:
            positions = np.asarray(geometry.positions(frame), dtype=np.float64).reshape(-1, 3)
            with np.errstate(over="ignore"):  # beyond float32 is infinite: such triangles are never hit
                points = np.ascontiguousarray((positions - centre).astype(np.float32))
            valid = valid_triangles(points, faces)
            held[0][frame], held[1][frame] = points, valid
        return points, valid

    return lambda frame: made(frame if geometry.moves else 0)


def mirror_of(scene: Scene, geometry: Geometry) -> U8:
    """1 for each triangle that is a mirror, uint8 [triangle_count]. Raises :class:`UserError` for another shape."""
    count = len(np.reshape(geometry.faces, (-1, 3)))
    flags = np.zeros(count) if scene.mirror is None else np.asarray(scene.mirror(geometry))
    if flags.shape != (count,):
        raise UserError(f"{scene.name}: mirrors of shape {flags.shape}, but there are {count} triangles")
    return np.ascontiguousarray(flags, dtype=np.uint8)


def check_faces(faces: I32, vertex_count: int, name: str) -> None:
    """Raise :class:`UserError` unless every index is that of a vertex."""
    if len(faces) and (faces.min() < 0 or faces.max() >= vertex_count):
        bad = int(faces.max()) if faces.max() >= vertex_count else int(faces.min())
        raise UserError(f"{name}: a face names vertex {bad}, but there are {vertex_count} vertices; correct the file")


def finite_bounds(positions: F64) -> tuple[F64, F64]:
    """Lowest and highest corner of the vertices that float32 can hold; both zero where there are none."""
    finite = positions[(np.abs(positions) <= np.finfo(np.float32).max).all(axis=1)]
    if not len(finite):
        return np.zeros(3), np.zeros(3)
    return finite.min(axis=0), finite.max(axis=0)


def largest_coordinate(points: F32) -> float:
    """The largest coordinate of the finite vertices; 0 where there are none. ``points``: [vertex_count, 3]."""
    size = float(max(points.max(initial=0.0), -points.min(initial=0.0)))
    if np.isfinite(size):
        return size
    return float(np.abs(points[np.isfinite(points).all(axis=1)]).max(initial=0.0))


def recentre(positions: F64) -> F64:
    """The point to subtract: the middle of the box, or zero where the box lies within its own size of the origin."""
    low, high = finite_bounds(positions)
    middle = (low + high) / 2
    return middle if np.abs(middle).max() > (high - low).max() else np.zeros(3)


def weld(positions: F64) -> I32:
    """For each vertex the lowest index of a vertex at the same position (-0 equals +0), int32 [vertex_count].

    ``positions``: recentred, [vertex_count, 3]; compared as float32, as all methods get them.

    Edge planes are built in this order, so that two triangles that meet at an edge get the same plane even where
    the file has split its vertices. Vertices with NaN keep their own index.
    """
    if not len(positions):
        return np.zeros(0, dtype=np.int32)
    with np.errstate(over="ignore"):
        keys = np.ascontiguousarray(positions.astype(np.float32) + np.float32(0.0))
    _, first, inverse = np.unique(keys.view("V12").ravel(), return_index=True, return_inverse=True)
    result = first[inverse.ravel()].astype(np.int32)
    odd = np.isnan(keys).any(axis=1)
    result[odd] = np.nonzero(odd)[0]
    return result


def valid_triangles(points: F32, faces: I32) -> U8:
    """1 where a triangle has finite vertices and an area that is not zero, decided exactly. uint8 [triangle_count]."""
    if not len(faces):
        return np.zeros(0, dtype=np.uint8)
    with np.errstate(invalid="ignore", over="ignore"):
        # Coordinates first: numpy reduces a short last axis several times as slowly.
        a, b, c = (np.ascontiguousarray(points[corner].T, dtype=np.float64) for corner in faces.T)
        finite = np.take(np.isfinite(points).all(axis=1), faces.T).all(axis=0)
        e, f = b - a, c - a
        normal = np.abs(np.cross(e, f, axis=0)).max(axis=0)
        # A difference, a product and their difference each round once, by at most 2^-53 of their size.
        size = np.maximum(np.abs(e), np.abs(f)).max(axis=0)
        bound = 16 * 2.0**-53 * size * size
        same = (a == b).all(axis=0) | (b == c).all(axis=0) | (c == a).all(axis=0)
    result = finite & (normal > bound)
    for i in np.nonzero(finite & ~result & ~same)[0]:
        result[i] = not _zero_area_exact(*(points[faces[i]]))
    return result.astype(np.uint8)


def _zero_area_exact(a: F32, b: F32, c: F32) -> bool:
    p, q, r = ([Fraction(float(x)) for x in vertex] for vertex in (a, b, c))
    e, f = ([x - y for x, y in zip(other, p, strict=True)] for other in (q, r))
    return all(e[i] * f[j] == e[j] * f[i] for i, j in ((0, 1), (1, 2), (2, 0)))
