"""Bumpy balls over rolling ground, with any number of triangles: the same surfaces, sampled finer or coarser.

They are used to measure how time grows with the number of triangles. Ten million triangles are generated in seconds. The
balls occlude one another and cast shadows on one another and on the ground.

A name gives the number of triangles, and may give what share of the pixels sees the ground and what share of the
triangles moves, in per cent: ``balls-300k``, ``balls-300k-seen10``, ``balls-300k-moving30``. Or all is deformed, by a dial:
in ``balls-300k-swirl50`` the middle turns by 50 % of a full turn, the parts farther out by less, the rim not at all.
"""

import functools
import re
from dataclasses import dataclass, replace

import numpy as np

from ...arrays import F64, I32, Floats
from ...errors import UserError
from ..light_paths import vector
from ..readers.checks import MAX_TRIANGLES
from ..scene import Camera, Geometry, Light, Moves, Scene
from .shapes import Mesh, join

NAME = re.compile(r"balls-([1-9]\d{0,17})(k|m)?(?:-seen(100|[1-9]\d?))?(?:-moving(100|\d\d?)|-swirl([1-9]\d{0,2}))?")
EXAMPLE = "balls-300k"
BALLS = 24
GROUND_SHARE = 0.4  # share of the triangles that belong to the ground; the balls share the rest equally
HALF = 6.0  # half the ground's side in metres
FRAMES = 21  # number of frames of a scene in which a share of the triangles moves
CAMERA = Camera(eye=(7.5, 4.2, 8.5), target=(0.0, 0.7, 0.0), fov=42.0)


@dataclass(frozen=True)
class Name:
    """What a name specifies.

    count   triangles, about
    seen    share of the pixels that see the ground, 0..1; None: as :data:`CAMERA` sees it
    moving  share of the triangles that move, 0..1; None: the scene has one frame, unless it is swirled
    swirl   turns of the middle over the frames; None: not swirled
    """

    count: int
    seen: float | None = None
    moving: float | None = None
    swirl: float | None = None


def read_name(name: str) -> Name | None:
    """The specification in a name such as ``balls-30k`` or ``balls-10m-seen5-moving30``; None for another name."""
    match = NAME.fullmatch(name)
    if not match:
        return None
    count = int(match[1]) * {"": 1, "k": 1000, "m": 1_000_000}[match[2] or ""]
    return Name(count, *(None if share is None else int(share) / 100 for share in match.groups()[2:]))


def count_of(name: str) -> int | None:
    """The triangle count in a name; None for another name."""
    known = read_name(name)
    return known.count if known else None


def scene(name: str) -> Scene:
    """The scene of such a name, within 10 % of its count. Raises :class:`UserError` for more than can be indexed."""
    known = read_name(name)
    assert known is not None
    if known.count > MAX_TRIANGLES:
        raise UserError(f"{name}: too many triangles; name balls-{MAX_TRIANGLES} at most")
    return Scene(
        name=name,
        title=f"Balls {name.removeprefix('balls-').replace('-', ', ')}",
        geometry=functools.partial(moving_geometry, known.count, known.moving, known.swirl),
        camera=CAMERA if known.seen is None else camera_for(known.seen),
        lights=(Light((-5.0, 9.0, 4.0)),),
        notes="balls over rolling ground: the same surfaces at every triangle count",
    )


def camera_for(seen: float) -> Camera:
    """The camera with which a square picture sees the flat ground in a share of its pixels. The eye goes back along the
    view where the share is below that of :data:`CAMERA`; else its field of view narrows. Found by bisection on 128x128
    rays. Balls that stand out over the ground's edge add to the share.
    """
    across = (np.arange(128) + 0.5) / 64 - 1.0
    x, y = (axis[..., None] for axis in np.meshgrid(across, across))

    def closer(scale: float) -> Camera:
        if scale < 1.0:
            half = scale * np.tan(np.radians(CAMERA.fov / 2))
            return replace(CAMERA, fov=float(2 * np.degrees(np.arctan(half))))
        target = np.array(CAMERA.target)
        return replace(CAMERA, eye=vector(target + scale * (np.array(CAMERA.eye) - target)))

    def share(camera: Camera) -> float:
        eye = np.array(camera.eye)
        forward = np.array(camera.target) - eye
        forward /= np.linalg.norm(forward)
        right = np.cross(forward, camera.up)
        right /= np.linalg.norm(right)
        half = np.tan(np.radians(camera.fov / 2))
        rays = forward + half * (x * right + y * np.cross(right, forward))
        down = rays[..., 1] < 0.0
        distance = -eye[1] / np.where(down, rays[..., 1], -1.0)
        ground = eye + distance[..., None] * rays
        return float((down & (np.abs(ground[..., [0, 2]]) < HALF).all(axis=-1)).mean())

    low, high = 1e-3, 1e3
    for _ in range(40):
        middle = (low * high) ** 0.5
        low, high = (middle, high) if share(closer(middle)) >= seen else (low, middle)
    return closer(low)


def moving_geometry(count: int, moving: float | None, swirl: float | None = None) -> Geometry:
    """The geometry, of which a share turns about the vertical through the middle, each ball at its own speed; or all of
    it, the less the farther out. Balls move first; with a share above theirs the ground turns as well.
    """
    still = geometry(count)
    if swirl is not None:
        inward = np.clip(1.0 - np.hypot(*still.positions(0)[:, [0, 2]].T) / HALF, 0.0, None)
        return turned(still, 2 * np.pi * swirl * inward, Moves("deforming"))
    if moving is None:
        return still
    around, side = divisions(count)
    size = (max(2, around // 2) + 1) * (around + 1)
    ground_size = (side + 1) ** 2
    balls = BALLS if moving > 1 - GROUND_SHARE else round(BALLS * moving / (1 - GROUND_SHARE))
    speeds = np.zeros(len(still.positions(0)))
    turns = np.radians(np.random.default_rng(11).uniform(60.0, 240.0, BALLS))
    speeds[ground_size : ground_size + balls * size] = np.repeat(turns[:balls], size)
    if moving > 1 - GROUND_SHARE:
        speeds[:ground_size] = np.radians(90.0)
    bodies = np.unique(speeds[still.faces[:, 0]], return_inverse=True)[1]
    return turned(still, speeds, Moves("rigid", bodies=bodies))


def turned(still: Geometry, speeds: F64, moves: Moves) -> Geometry:
    """Each vertex turns about the vertical through the middle, by so many radians over the frames."""

    def positions(frame: int) -> Floats:
        angle = (speeds * (frame / (FRAMES - 1))).astype(np.float32)
        x, y, z = still.positions(0).T
        sin, cos = np.sin(angle), np.cos(angle)
        return np.stack([cos * x + sin * z, y, cos * z - sin * x], axis=-1)

    return Geometry(still.faces, positions, FRAMES, moves)


def divisions(count: int) -> tuple[int, int]:
    """Squares around a ball, and squares along a side of the ground, for about ``count`` triangles, 100 at least."""
    count = max(count, 100)
    # A ball of n squares around and n / 2 rows has n^2 - 2 n triangles.
    around = max(4, round(1 + (1 + (1 - GROUND_SHARE) * count / BALLS) ** 0.5))
    return around, max(2, round((GROUND_SHARE * count / 2) ** 0.5))


def geometry(count: int) -> Geometry:
    """About ``count`` triangles, 100 at least."""
    around, side = divisions(count)
    random = np.random.default_rng(7)
    parts = [ground(side)]
    for k in range(BALLS):
        angle, radius = 2.4 * k, 0.42 + 0.95 * k**0.5
        centre = np.array([radius * np.cos(angle), 0.9 + random.uniform(0.0, 1.6), radius * np.sin(angle)])
        parts.append(ball(centre, random.uniform(0.3, 0.6), random.uniform(3, 9, 3), max(2, around // 2), around))
    vertices, faces = join(parts)
    return Geometry.static(vertices.astype(np.float32), faces)


def ground(side: int) -> Mesh:
    """Rolling ground of ``side`` x ``side`` squares."""
    along = np.linspace(-HALF, HALF, side + 1)
    x, z = np.meshgrid(along, along, indexing="ij")
    y = 0.25 * np.sin(1.3 * x + 0.4 * z) + 0.2 * np.cos(0.9 * z - 0.5 * x) + 0.03 * np.sin(7 * x) * np.sin(6 * z)
    return Mesh(np.stack([x, y, z], axis=-1).reshape(-1, 3), squares(side, side, side + 1))


def ball(centre: F64, radius: float, waves: F64, rows: int, around: int) -> Mesh:
    """A bumpy ball of ``rows`` x ``around`` squares; those at the poles degenerate to one triangle."""
    theta = np.linspace(0.0, np.pi, rows + 1)[:, None]
    phi = np.linspace(0.0, 2 * np.pi, around + 1)[None, :]
    x, y, z = np.sin(theta) * np.cos(phi), np.cos(theta) + 0.0 * phi, np.sin(theta) * np.sin(phi)
    bump = 1.0 + 0.06 * np.sin(waves[0] * x) * np.sin(waves[1] * y) + 0.03 * np.sin(2 * waves[2] * z)
    points = centre + radius * bump[..., None] * np.stack([x, y, z], axis=-1)
    faces = squares(rows, around, around + 1)
    # The first triangle of a square at the top and the second of one at the bottom have no area.
    first, last = np.arange(around) * 2, (len(faces) // 2 - around + np.arange(around)) * 2 + 1
    return Mesh(points.reshape(-1, 3), np.delete(faces, np.concatenate([first, last]), axis=0))


def squares(rows: int, columns: int, stride: int) -> I32:
    """Two triangles per square of a lattice of points, row by row: (a, b, c) and (b, d, c)."""
    a = (np.arange(rows)[:, None] * stride + np.arange(columns)[None, :]).ravel()
    b, c, d = a + 1, a + stride, a + stride + 1
    return np.stack([a, b, c, b, d, c], axis=1).reshape(-1, 3).astype(np.int32)
