"""Stand-in for the UNC Bunny/Dragon: a bunny flies into a dragon, and both break into flying pieces. The pieces exist
from the start as patches with vertices of their own, so the topology never changes; a crack runs out from the point of
impact and each patch moves rigidly from the moment the crack reaches it.
"""

import numpy as np
from numpy.typing import NDArray

from ...arrays import F64, I64
from ..scene import Geometry, Moves
from .bodies import Blob, Body, ball, both, chain, curve, limb, normals, scales, spread_points
from .shapes import Mesh, join, noise

FRAMES = 16
FRAME_TIME = 0.036  # time between frames, seconds
IMPACT_TIME = 0.144
BUNNY_SPEED = 2.2
GRAVITY = 9.81
CRACK_SPEED = 9.0
BUNNY_SPACING = 0.00994
DRAGON_SPACING = 0.0094
SEED = 5


def bunny() -> Body:
    """A sitting bunny, 0.95 m to the tips of its ears, nose towards +x, on y = 0."""
    middle = [
        ball((-0.10, 0.33, 0), (0.36, 0.31, 0.27), ((0, 0, 1), -8)),
        ball((0.14, 0.36, 0), (0.22, 0.28, 0.20), blend=0.12),
        ball((-0.20, 0.42, 0), (0.24, 0.22, 0.23), blend=0.10),
        limb((0.18, 0.52, 0), (0.24, 0.66, 0), 0.13, 0.12, blend=0.08),
        ball((0.29, 0.70, 0), (0.175, 0.135, 0.125), ((0, 0, 1), -22), blend=0.06),
        ball((0.42, 0.645, 0), (0.07, 0.06, 0.065), blend=0.05),
        ball((-0.47, 0.27, 0), 0.095, blend=0.03),
    ]
    sides = [
        ball((0.36, 0.64, 0.065), (0.075, 0.06, 0.055), blend=0.04),
        ball((0.355, 0.742, 0.098), 0.026, blend=0.012),
        ball((0.482, 0.655, 0.02), (0.012, 0.008, 0.01), blend=0.01, cut=True),
        ball((-0.17, 0.24, 0.20), (0.22, 0.21, 0.11), ((0, 0, 1), 20), blend=0.035),
        ball((0.02, 0.06, 0.22), (0.20, 0.058, 0.075), blend=0.03),
        limb((0.22, 0.32, 0.12), (0.24, 0.10, 0.115), 0.085, 0.055, blend=0.05),
        ball((0.285, 0.05, 0.115), (0.105, 0.05, 0.06), blend=0.03),
        ball((0.10, 0.93, 0.085), (0.062, 0.215, 0.045), ((0.25, 0, 1), 40), blend=0.025),
        ball((0.125, 0.935, 0.108), (0.034, 0.165, 0.030), ((0.25, 0, 1), 40), blend=0.02, cut=True),
    ]
    return Body(middle + both(sides))


# Middle line of the dragon from the back of its head to the tip of its tail: x, y, z, radius.
SPINE = (
    (-0.30, 1.07, 0.00, 0.095), (-0.37, 0.92, 0.00, 0.118), (-0.47, 0.72, 0.01, 0.140), (-0.545, 0.50, 0.02, 0.175),
    (-0.50, 0.29, 0.02, 0.200), (-0.33, 0.205, 0.00, 0.205), (-0.15, 0.32, -0.02, 0.200),
    (-0.03, 0.55, -0.02, 0.190), (0.09, 0.78, -0.01, 0.182), (0.25, 0.92, 0.00, 0.172), (0.41, 0.85, 0.01, 0.162),
    (0.49, 0.65, 0.02, 0.155), (0.47, 0.42, 0.02, 0.150), (0.47, 0.22, 0.01, 0.130), (0.60, 0.10, 0.00, 0.100),
    (0.76, 0.13, -0.01, 0.085), (0.84, 0.29, -0.02, 0.070), (0.81, 0.50, -0.02, 0.056),
    (0.755, 0.68, -0.02, 0.044), (0.79, 0.84, -0.01, 0.034),
)  # fmt: skip


def dragon() -> Body:
    """A coiled dragon, 1.75 m long and 1.35 m high, head towards -x, on y = 0."""
    line = curve(SPINE, 2)
    blobs = chain(line[:, :3], [float(r) for r in line[:, 3]], blend=0.03)
    blobs += _crest(curve(SPINE, 4))
    blobs += [
        ball((-0.40, 1.115, 0), (0.155, 0.10, 0.105), ((0, 0, 1), 6), blend=0.06),
        limb((-0.46, 1.12, 0), (-0.80, 1.135, 0), 0.085, 0.052, blend=0.04),
        ball((-0.835, 1.150, 0), (0.05, 0.055, 0.062), blend=0.03),
        limb((-0.42, 1.03, 0), (-0.60, 0.945, 0), 0.070, 0.050, blend=0.03),
        limb((-0.60, 0.945, 0), (-0.78, 0.925, 0), 0.050, 0.036, blend=0.01),
        limb((-0.78, 0.925, 0), (-0.86, 0.985, 0), 0.030, 0.012, blend=0.015),
        limb((-0.72, 0.90, 0), (-0.74, 0.78, 0), 0.024, 0.004, blend=0.01),
        limb((-0.64, 0.91, 0), (-0.63, 0.80, 0), 0.022, 0.004, blend=0.01),
    ]
    sides = _head_sides()
    sides += _leg((-0.50, 0.40), (-0.28, 0.30), (-0.44, 0.085), 0.13)
    sides += _leg((0.45, 0.40), (0.24, 0.31), (0.37, 0.085), 0.11)
    return Body(blobs + both(sides) + _tail_tip())


def _crest(line: F64) -> list[Blob]:
    """Spikes along the back, leaning towards the tail."""
    ahead = np.gradient(line[:, :2], axis=0)
    ahead /= np.sqrt(ahead[:, :1] ** 2 + ahead[:, 1:] ** 2)
    spikes = []
    for i in range(3, len(line) - 2):
        x, y, z, radius = (float(value) for value in line[i])
        along, up = ahead[i], np.array([-ahead[i, 1], ahead[i, 0]])
        foot = np.array([x, y]) + up * (radius - 0.015)
        tip = foot + up * (0.035 + 0.33 * radius) + along * 0.045
        spikes.append(limb((*foot, z), (*tip, z), 0.020 + 0.07 * radius, 0.004, blend=0.012))
    return spikes


def _head_sides() -> list[Blob]:
    """The left half of what comes in pairs on the head."""
    blobs = [
        ball((-0.85, 1.195, 0.036), 0.030, blend=0.02),
        ball((-0.885, 1.165, 0.035), 0.014, blend=0.01, cut=True),
        limb((-0.60, 1.165, 0.062), (-0.40, 1.225, 0.095), 0.026, 0.030, blend=0.02),
        ball((-0.535, 1.158, 0.088), 0.028, blend=0.008),
        *chain([(-0.37, 1.19, 0.06), (-0.22, 1.27, 0.10), (-0.07, 1.30, 0.13), (0.05, 1.37, 0.14)],
               [0.036, 0.028, 0.019, 0.004], blend=0.015),
        *chain([(-0.84, 1.12, 0.055), (-0.90, 1.05, 0.11), (-0.98, 1.06, 0.14), (-1.04, 1.13, 0.15)],
               [0.014, 0.011, 0.008, 0.003], blend=0.008),
    ]  # fmt: skip
    for i in range(6):  # frill behind the cheeks
        angle = np.radians(-50 + 22 * i)
        foot = (-0.36 + 0.015 * i, 1.03 + 0.03 * i, 0.085)
        tip = (foot[0] + 0.20 * np.cos(angle), foot[1] + 0.17 * np.sin(angle) - 0.02, 0.19 - 0.012 * i)
        blobs.append(limb(foot, tip, 0.030, 0.004, blend=0.012))
    for i in range(6):  # teeth above and below
        x, z, size = -0.83 + 0.055 * i, 0.045 + 0.004 * i, 0.055 if i == 0 else 0.032
        blobs.append(limb((x, 1.09, z), (x, 1.085 - size, z), 0.012, 0.003, blend=0.004))
        blobs.append(limb((x + 0.03, 0.965, 0.032), (x + 0.03, 0.99 + 0.5 * size, 0.032), 0.010, 0.003, blend=0.004))
    return blobs


def _leg(hip: tuple[float, float], knee: tuple[float, float], ankle: tuple[float, float], out: float) -> list[Blob]:
    """A leg on the left side with four claws, from points in the plane of the body."""
    wide = out + 0.13
    blobs = [
        ball((*hip, out), (0.13, 0.15, 0.085), blend=0.04),
        limb((*hip, out + 0.03), (*knee, wide), 0.095, 0.066, blend=0.05),
        limb((*knee, wide), (*ankle, wide - 0.01), 0.066, 0.040, blend=0.02),
        limb((*ankle, wide - 0.01), (ankle[0] - 0.06, 0.045, wide), 0.044, 0.042, blend=0.02),
        limb((*knee, wide), (knee[0] + 0.09, knee[1] + 0.08, wide + 0.02), 0.035, 0.004, blend=0.02),
    ]
    for i in range(4):
        angle = np.radians(-42 + 28 * i)
        foot = (ankle[0] - 0.07, 0.045, wide)
        toe = (foot[0] - 0.10 * np.cos(angle), 0.040, wide + 0.10 * np.sin(angle))
        claw = (foot[0] - 0.165 * np.cos(angle), 0.008, wide + 0.165 * np.sin(angle))
        blobs += chain([foot, toe, claw], [0.034, 0.024, 0.004], blend=0.015)
    return blobs


def _tail_tip() -> list[Blob]:
    x, y, z, _ = SPINE[-1]
    angles = np.radians(-15 + 30 * np.arange(7))
    tips = [(x + 0.15 * np.cos(a), y + 0.17 * np.sin(a) + 0.03, z + 0.02 * (i % 3 - 1)) for i, a in enumerate(angles)]
    return [limb((x, y, z), tip, 0.030, 0.004, blend=0.01) for tip in tips]


def geometry() -> Geometry:
    rabbit = _skinned(bunny().mesh(BUNNY_SPACING), 0.0)
    rabbit = Mesh(rabbit.vertices + _BUNNY_START, rabbit.faces)
    beast = _skinned(dragon().mesh(DRAGON_SPACING), 0.045)
    rabbit, rabbit_piece = _broken(rabbit, 0.15, SEED)
    beast, beast_piece = _broken(beast, 0.13, SEED + 1)
    pieces = _Pieces(rabbit, rabbit_piece, beast, beast_piece)
    faces = join([rabbit, beast]).faces
    return Geometry(faces, pieces.positions, FRAMES, Moves("rigid", bodies=pieces.piece[faces[:, 0]]))


_IMPACT = np.array([-0.74, 0.56, 0.04])
_BUNNY_START = np.array([-1.20 - BUNNY_SPEED * IMPACT_TIME, 0.06, 0.06])


def _skinned(mesh: Mesh, scale: float) -> Mesh:
    """The mesh with relief: scales ``scale`` wide, or fur where it is 0."""
    relief = scales(mesh, scale, 0.010, SEED) if scale else 0.012 * noise(mesh.vertices * 14, SEED, 2)
    return Mesh(mesh.vertices + normals(mesh) * relief[:, None], mesh.faces)


def _broken(mesh: Mesh, size: float, seed: int) -> tuple[Mesh, I64]:
    """The mesh cut into patches about ``size`` wide with vertices of their own, and the patch of each vertex."""
    from scipy.spatial import cKDTree  # here: a scene is listed without it

    middle = mesh.vertices[mesh.faces].mean(axis=1)
    jag = np.stack([noise(middle * 22, seed + axis, 1) for axis in range(3)], axis=-1)
    centres = spread_points(mesh.vertices, size, seed)
    patch = cKDTree(centres).query(middle + 0.22 * size * jag)[1]
    key = (patch[:, None] * len(mesh.vertices) + mesh.faces).ravel()
    own, faces = np.unique(key, return_inverse=True)
    vertices = mesh.vertices[own % len(mesh.vertices)]
    patches = np.unique(own // len(mesh.vertices), return_inverse=True)[1]
    return Mesh(vertices, faces.reshape(-1, 3).astype(np.int32)), patches


class _Pieces:
    """Where every patch is at a time: at rest or in flight as a whole, then on its own, rigidly, under gravity."""

    def __init__(self, rabbit: Mesh, rabbit_piece: NDArray, beast: Mesh, beast_piece: NDArray):
        count = int(rabbit_piece.max()) + 1
        self.rest = np.concatenate([rabbit.vertices, beast.vertices])
        self.piece = np.concatenate([rabbit_piece, beast_piece + count])
        total = int(self.piece.max()) + 1
        weight = np.bincount(self.piece, minlength=total)
        self.middle = np.stack(
            [np.bincount(self.piece, self.rest[:, axis], total) / weight for axis in range(3)], axis=-1
        )
        self.arm = self.rest - self.middle[self.piece]
        self.thrown = np.zeros((total, 3))
        self.thrown[:count, 0] = BUNNY_SPEED
        at_impact = self.middle + self.thrown * IMPACT_TIME
        rng = np.random.default_rng(SEED)
        away = at_impact - _IMPACT
        distance = np.sqrt(away[:, 0] ** 2 + away[:, 1] ** 2 + away[:, 2] ** 2)
        self.release = IMPACT_TIME + distance / CRACK_SPEED * (0.9 + 0.2 * rng.random(total))
        speed = 1.3 / (0.6 + distance)
        self.speed = away / np.maximum(distance, 1e-9)[:, None] * speed[:, None]
        self.speed += rng.normal(0.0, 0.35, (total, 3))
        self.speed[:, 1] += 1.0
        self.speed[count:, 0] += 0.2 / (0.4 + distance[count:])
        self.speed[:count] += 0.2 * self.thrown[:count]
        axis = rng.normal(0.0, 1.0, (total, 3))
        self.axis = axis / np.sqrt(axis[:, :1] ** 2 + axis[:, 1:2] ** 2 + axis[:, 2:] ** 2)
        self.spin = rng.normal(0.0, 5.0, total)

    def positions(self, k: int) -> F64:
        """Vertices of frame k, float64 [vertex_count, 3]."""
        time = k * FRAME_TIME
        loose = np.maximum(time - self.release, 0.0)[:, None]
        # Until the crack reaches it a patch of the bunny goes on, though the impact has slowed it down.
        bound = np.minimum(time, IMPACT_TIME) + 0.25 * np.clip(time - IMPACT_TIME, 0.0, None)
        bound = np.minimum(bound, IMPACT_TIME + 0.25 * (self.release - IMPACT_TIME))
        shift = self.thrown * bound[:, None] + self.speed * loose
        shift[:, 1] -= 0.5 * GRAVITY * loose[:, 0] ** 2
        # Added to the rest position, so that patches that are still joined share bit-identical vertices.
        moved = self.rest + shift[self.piece]
        turn = _turns(self.axis, self.spin * loose[:, 0])[self.piece]
        arm = self.arm
        for row in range(3):
            moved[:, row] += turn[:, row, 0] * arm[:, 0] + turn[:, row, 1] * arm[:, 1] + turn[:, row, 2] * arm[:, 2]
        return moved


def _turns(axis: F64, angle: F64) -> F64:
    """Rotation matrices about unit axes [n, 3], less the identity: [n, 3, 3], exactly zero where the angle is."""
    x, y, z = axis[:, 0], axis[:, 1], axis[:, 2]
    s, one = np.sin(angle), 1 - np.cos(angle)
    rows = [
        [(x * x - 1) * one, x * y * one - z * s, x * z * one + y * s],
        [y * x * one + z * s, (y * y - 1) * one, y * z * one - x * s],
        [z * x * one - y * s, z * y * one + x * s, (z * z - 1) * one],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=1)
