"""Stand-in for the Happy Buddha: a laughing figure in a robe, arms raised, on a lotus base; 2 m tall. One dense,
closed, consistently oriented surface, as the scan is: signed distances of body parts, blended, with folds of cloth and
chisel marks on top, turned into triangles of nearly one size.
"""

from collections.abc import Callable

import numpy as np

from ...arrays import Floats
from ..scene import Geometry
from .implicit import polygonise

Part = Callable[[Floats, Floats, Floats], Floats]  # arrays [n] in float32, unless a caller wants more
SPACING = 0.00414  # lattice spacing in metres; sets the triangle count (Stanford's mesh has 1,087,716)
BLOCK = 8192  # points evaluated at once, so that the arrays stay in cache


def geometry() -> Geometry:
    """The statue's mesh, stands on y = 0 and faces +z."""
    return Geometry.static(*polygonise(distance, (-0.78, -0.03, -0.52), (0.78, 2.1, 0.56), SPACING, slack=2.0))


def distance(points: Floats) -> Floats:
    """Signed distance in metres (to within about 30 % near the surface), negative inside; points [n, 3]."""
    result = np.empty(len(points), dtype=np.float32)
    for start in range(0, len(points), BLOCK):
        x, y, z = np.ascontiguousarray(points[start : start + BLOCK].T)
        result[start : start + BLOCK] = _statue(x, y, z)
    return result


# Blending and basic bodies. All take coordinates as separate float32 arrays.


def _blend(a: Floats, b: Floats, k: float) -> Floats:
    """Union with a fillet of about ``k`` metres."""
    h = np.maximum(k - np.abs(a - b), 0.0)
    return np.minimum(a, b) - h * h * (0.25 / k)


def _carve(a: Floats, b: Floats, k: float) -> Floats:
    """``a`` without ``b``, the edge rounded by about ``k`` metres."""
    return -_blend(-a, b, k)


def _ball(x: Floats, y: Floats, z: Floats, centre: tuple, radii: tuple) -> Floats:
    """An ellipsoid; exact at the surface to first order."""
    px, py, pz = x - centre[0], y - centre[1], z - centre[2]
    near = np.sqrt((px / radii[0]) ** 2 + (py / radii[1]) ** 2 + (pz / radii[2]) ** 2)
    steep = np.sqrt((px / radii[0] ** 2) ** 2 + (py / radii[1] ** 2) ** 2 + (pz / radii[2] ** 2) ** 2)
    return near * (near - 1.0) / np.maximum(steep, 1e-3)


def _bone(x: Floats, y: Floats, z: Floats, a: tuple, b: tuple, ra: float, rb: float, flat: float = 1.0) -> Floats:
    """A capsule from ``a`` to ``b`` with radii ``ra`` and ``rb``, squeezed in z by ``flat``."""
    z, az, bz = z / flat, a[2] / flat, b[2] / flat
    dx, dy, dz = b[0] - a[0], b[1] - a[1], bz - az
    px, py, pz = x - a[0], y - a[1], z - az
    h = np.clip((px * dx + py * dy + pz * dz) / (dx * dx + dy * dy + dz * dz), 0.0, 1.0)
    px, py, pz = px - h * dx, py - h * dy, pz - h * dz
    return (np.sqrt(px * px + py * py + pz * pz) - (ra + (rb - ra) * h)) * min(1.0, flat)


def _disc(x: Floats, y: Floats, z: Floats, low: float, high: float, radius: Floats | float, edge: float) -> Floats:
    """A round plate between two heights, with a rounded edge."""
    out = np.hypot(x, z) - radius + edge
    up = np.abs(y - (low + high) / 2) - (high - low) / 2 + edge
    return np.hypot(np.maximum(out, 0.0), np.maximum(up, 0.0)) + np.minimum(np.maximum(out, up), 0.0) - edge


def _ridges(phase: Floats) -> Floats:
    """Cloth folds over a phase in radians: round ridges with narrow valleys, 0 to 1."""
    return 1.0 - np.abs(np.sin(0.5 * phase)) ** 1.5


# Parts of the statue, from the ground up.


def _base(x: Floats, y: Floats, z: Floats) -> Floats:
    """A plinth, two rows of lotus petals, and the plate that the figure stands on."""
    turn = np.arctan2(x, z)
    lower = np.abs(np.cos(8.0 * turn)) ** 0.6
    upper = np.abs(np.sin(8.0 * turn)) ** 0.6
    plinth = _disc(x, y, z, 0.0, 0.055, 0.44, 0.012)
    petals = _disc(x, y, z, 0.045, 0.125, 0.37 + 0.05 * lower, 0.036)
    petals = _blend(petals, _disc(x, y, z, 0.105, 0.185, 0.345 + 0.05 * upper, 0.036), 0.008)
    plate = _disc(x, y, z, 0.17, 0.215, 0.36, 0.012)
    return _blend(_blend(plinth, petals, 0.012), plate, 0.012)


def _skirt(x: Floats, y: Floats, z: Floats) -> Floats:
    """The lower robe: an oval that widens to the hem, with folds that deepen downwards, and two feet."""
    s = np.clip((y - 0.2) / 0.85, 0.0, 1.0)
    turn = np.arctan2(x, z)
    wave = turn + 0.35 * np.sin(2.0 * turn + 5.0 * y) * (1.0 - s)
    fold = 0.05 * (1.0 - s) * _ridges(9.0 * wave + 3.0 * s) + 0.012 * _ridges(23.0 * wave - 6.0 * s)
    wide = 0.25 + 0.03 * np.cos(3.1 * s) + fold
    body = np.sqrt(x * x + (1.2 * (z - 0.01 - 0.03 * s)) ** 2) - wide
    body = np.maximum(body * 0.8, np.abs(y - 0.62) - 0.425)
    foot = _ball(np.abs(x), y, z, (0.11, 0.235, 0.25), (0.065, 0.04, 0.12))
    toes = _ball(np.abs(x), y, z, (0.11, 0.228, 0.33), (0.06, 0.028, 0.055))
    return _blend(_blend(body, foot, 0.02), toes, 0.02)


def _trunk(x: Floats, y: Floats, z: Floats) -> Floats:
    """Bare belly and chest, with the robe open over them in a V and tied below the belly."""
    side = np.abs(x)
    belly = _ball(x, y, z, (0.0, 0.98, 0.09), (0.27, 0.25, 0.235))
    chest = _ball(x, y, z, (0.0, 1.27, 0.03), (0.25, 0.2, 0.17))
    breast = _ball(side, y, z, (0.1, 1.26, 0.12), (0.1, 0.085, 0.085))
    back = _ball(x, y, z, (0.0, 1.1, -0.06), (0.26, 0.4, 0.19))
    body = _blend(_blend(_blend(belly, chest, 0.08), breast, 0.04), back, 0.08)
    body = _carve(body, _ball(x, y, z, (0.0, 0.96, 0.34), (0.018, 0.022, 0.05)), 0.015)
    # The robe is the body grown by its thickness, minus the opening in front.
    wrinkle = 0.012 * _ridges(70.0 * y + 24.0 * side + 3.0 * np.sin(9.0 * x)) + 0.006 * _ridges(150.0 * side)
    opening = 0.02 + 0.2 * np.clip((y - 0.78) / 0.3, 0.0, 1.0) - 0.12 * np.clip((y - 1.15) / 0.3, 0.0, 1.0)
    robe = _carve(body - 0.028 - wrinkle, np.maximum(side - opening, -z), 0.02)
    belt = np.hypot((np.sqrt(x * x + (1.15 * (z - 0.04)) ** 2) - 0.268), (y - 0.80) * 0.8) - 0.03
    knot = _ball(x, y, z, (0.03, 0.78, 0.3), (0.05, 0.04, 0.03))
    tail = _bone(x, y, z, (0.03, 0.77, 0.3), (0.05, 0.5, 0.31), 0.03, 0.045, 0.5)
    tail = _blend(tail, _bone(x, y, z, (0.02, 0.77, 0.3), (-0.04, 0.56, 0.31), 0.03, 0.04, 0.5), 0.01)
    return _blend(_blend(_blend(body, robe, 0.006), belt, 0.01), _blend(knot, tail, 0.015), 0.01)


def _arms(x: Floats, y: Floats, z: Floats) -> Floats:
    """Arms raised to a bowl held overhead; wide sleeves that hang from the elbows down to the hem."""
    side = np.abs(x)
    shoulder = (0.22, 1.36, 0.0)
    elbow = (0.43, 1.50, 0.03)
    hand = (0.17, 1.84, 0.03)
    upper = _bone(side, y, z, shoulder, elbow, 0.115, 0.095)
    fore = _bone(side, y, z, elbow, hand, 0.085, 0.045)
    rings = 0.012 * _ridges(80.0 * (y + 0.6 * side) + 2.0 * np.sin(20.0 * z))
    arm = _blend(upper - rings, fore, 0.03)
    cuff = _bone(side, y, z, (0.41, 1.53, 0.03), (0.335, 1.64, 0.03), 0.105, 0.095) - rings
    # The hanging cloth is thin; its folds bend it forwards and back, so that its outline stays smooth.
    sway = side - 0.015 * np.sin(7.0 * y + 2.0 * np.sign(x))
    bend = z + 0.024 * np.sin(58.0 * sway + 2.2 * np.sin(5.0 * y + np.sign(x)) - 14.0 * y)
    sleeve = _bone(sway, y, bend, (0.45, 1.47, 0.0), (0.44, 0.74, -0.01), 0.105, 0.1, 0.36)
    lower = _bone(sway, y, bend, (0.44, 0.8, -0.01), (0.3, 0.3, 0.02), 0.085, 0.05, 0.4)
    return _blend(_blend(arm, cuff, 0.02), _blend(sleeve, lower, 0.05), 0.03)


def _hands_and_bowl(x: Floats, y: Floats, z: Floats) -> Floats:
    """Fingers over the rim of a bowl."""
    side = np.abs(x)
    palm = _ball(side, y, z, (0.16, 1.86, 0.03), (0.035, 0.06, 0.06))
    finger = np.abs(np.abs(z - 0.03) - 0.028) - 0.014
    grip = _bone(side, y, 0.03 + finger, (0.165, 1.9, 0.03), (0.12, 1.965, 0.03), 0.013, 0.01)
    hollow = _disc(x, y, z - 0.03, 1.965, 2.2, 0.118, 0.02)
    bowl = _carve(_ball(x, y, z, (0.0, 1.93, 0.03), (0.15, 0.1, 0.13)), hollow, 0.02)
    rim = np.hypot(np.sqrt(x * x + (1.12 * (z - 0.03)) ** 2) - 0.135, y - 1.965) - 0.013
    return _blend(_blend(_blend(bowl, rim, 0.01), palm, 0.015), grip, 0.006)


def _head(x: Floats, y: Floats, z: Floats) -> Floats:
    """Bald head with full cheeks, long ears, eyes nearly shut, and a laugh."""
    side = np.abs(x)
    skull = _ball(x, y, z, (0.0, 1.635, 0.04), (0.112, 0.135, 0.125))
    jaw = _ball(x, y, z, (0.0, 1.56, 0.07), (0.1, 0.085, 0.095))
    neck = _bone(x, y, z, (0.0, 1.4, 0.01), (0.0, 1.55, 0.03), 0.11, 0.09)
    head = _blend(_blend(skull, jaw, 0.04), neck, 0.04)
    head = _blend(head, _ball(side, y, z, (0.055, 1.585, 0.128), (0.04, 0.035, 0.032)), 0.02)
    head = _blend(head, _bone(side, y, z, (0.018, 1.648, 0.155), (0.07, 1.653, 0.125), 0.01, 0.008), 0.015)
    head = _carve(head, _ball(side, y, z, (0.046, 1.627, 0.155), (0.03, 0.014, 0.02)), 0.012)
    head = _blend(head, _ball(side, y, z, (0.046, 1.627, 0.132), (0.024, 0.012, 0.018)), 0.004)
    nose = _bone(x, y, z, (0.0, 1.64, 0.158), (0.0, 1.597, 0.178), 0.01, 0.02)
    nostril = _ball(side, y, z, (0.02, 1.592, 0.166), (0.014, 0.011, 0.014))
    head = _blend(head, _blend(nose, nostril, 0.008), 0.012)
    smile = y - 1.545 - 5.0 * x * x
    head = _carve(head, np.hypot(smile * 1.1, np.maximum(np.abs(z - 0.165) - 0.02, 0.0)) - 0.011 + side * 0.1, 0.01)
    lip = np.hypot(y - 1.526 - 4.0 * x * x, z - 0.158 + 4.0 * x * x) - 0.011 + 0.1 * side
    head = _blend(head, lip, 0.01)
    ear = _ball(side, y, z, (0.122, 1.6, 0.035), (0.02, 0.085, 0.038))
    ear = _carve(ear, _ball(side, y, z, (0.142, 1.615, 0.045), (0.016, 0.04, 0.02)), 0.008)
    return _blend(head, ear, 0.012)


def _necklace(x: Floats, y: Floats, z: Floats) -> Floats:
    """A string of beads that hangs over the chest."""
    turn = np.arctan2(x, z)
    bead = 0.017 + 0.006 * np.cos(36.0 * turn)
    ring = np.sqrt(x * x + (z - 0.02) ** 2) - 0.175 - 0.035 * np.cos(turn)
    return (np.hypot(ring, y - 1.4 + 0.1 * np.cos(turn) + 0.03) - bead) * 0.8


PARTS: tuple[tuple[Part, float, float, float], ...] = (
    # part, lowest and highest y that it reaches, fillet with what is below, all in metres
    (_base, 0.0, 0.23, 0.0),
    (_skirt, 0.18, 1.08, 0.012),
    (_trunk, 0.45, 1.52, 0.02),
    (_arms, 0.2, 1.95, 0.02),
    (_necklace, 1.2, 1.5, 0.004),
    (_head, 1.25, 1.8, 0.01),
    (_hands_and_bowl, 1.78, 2.04, 0.012),
)


def _statue(x: Floats, y: Floats, z: Floats) -> Floats:
    """All parts blended; a part too far from a block of points to matter is left out."""
    bottom, top = float(y.min()), float(y.max())
    result = np.full(len(y), 1.0, dtype=np.float32)
    for part, low, high, fillet in PARTS:
        if top > low - 0.07 and bottom < high + 0.07:
            d = part(x, y, z)
            result = _blend(result, d, fillet) if fillet else np.minimum(result, d)
    # Chisel marks and the roughness of a scan: about 1 mm.
    marks = np.sin(97.0 * x + 31.0 * y) * np.sin(89.0 * y - 23.0 * z) * np.sin(101.0 * z + 17.0 * x)
    grain = np.sin(310.0 * x) * np.sin(333.0 * y) * np.sin(297.0 * z)
    return (result - 0.0016 * marks - 0.0004 * grain).astype(np.float32)
