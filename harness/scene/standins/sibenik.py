"""Stand-in for the Sibenik Cathedral: nave with arcades, ribbed vaults, crossing with a dome, apse; 44 m long. Very
large and long thin triangles (walls, floor, barrel vaults, the wall above each arch) stand beside finely turned
columns, balusters and mouldings, as in the original. x runs from the west door to the apse, y is up.
"""

import numpy as np
from numpy.typing import ArrayLike

from ..scene import Geometry
from .shapes import Mesh, box, cylinder, flip, grid, join, lathe, pairs, patch, place, sphere, transform, tube

COLUMN_HEIGHT = 5.2  # from the floor to the top of the abacus

HALF = 4.0  # half width of the nave, and radius of its vault
SIDE = 8.5  # distance of the outer walls from the axis
SPRING, AISLE_SPRING, ARCADE_SPRING = 10.5, 5.6, COLUMN_HEIGHT  # where vaults and arches begin
WEST, EAST = -20.0, 20.0
CROSSING = (4.0, 12.0)
COLUMNS = (-16.0, -12.0, -8.0, -4.0, 0.0, 16.0)
BAYS = tuple((x, x + 4.0) for x in (-20.0, -16.0, -12.0, -8.0, -4.0, 0.0, 12.0, 16.0))


def arch(profile: ArrayLike, segments: int) -> Mesh:
    """A half ring over the x axis: profile [(radius, z), ...] swept from x = +radius over the top to -radius."""
    return transform(lathe(profile, segments, start=-90.0, sweep=180.0), rotate=((1.0, 0.0, 0.0), -90.0))


def rib(start: ArrayLike, end: ArrayLike, rise: float, radius: float, segments: int, sides: int = 8) -> Mesh:
    """A round rib along half an ellipse from ``start`` to ``end`` at one height, ``rise`` metres high."""
    angle = np.linspace(0.0, np.pi, segments + 1)[:, None]
    middle, reach = (np.add(start, end)) / 2, np.subtract(end, start) / 2
    return tube(middle - np.cos(angle) * reach + np.sin(angle) * np.array([0.0, rise, 0.0]), radius, sides, caps=False)


def window(half: float, height: float) -> Mesh:
    """A round-headed window in a wall at z = 0 facing +z: splayed reveal, round frame, mullion and sill."""
    angle = np.linspace(0.0, np.pi, 13)
    x = np.concatenate([[half], half * np.cos(angle), [-half]])
    y = np.concatenate([[0.0], height + half * np.sin(angle), [0.0]])
    path = np.stack([x, y, np.full_like(x, 0.06)], axis=-1)
    inner = path * (0.82, 0.93, 0.0) + (0.0, 0.05, 0.0)
    frame = tube(path, 0.09, 5)
    mullion = box((-0.04, 0.0, 0.0), (0.04, height + half, 0.08))
    sill = box((-half - 0.15, -0.2, 0.0), (half + 0.15, 0.0, 0.25))
    return join([patch(np.stack([path, inner], axis=1)), frame, mullion, sill])


def rose(radius: float) -> Mesh:
    """A round window in a wall at z = 0: three rings and twelve spokes."""
    turn = 2 * np.pi * np.arange(30) / 30
    rings = [
        tube(np.stack([r * np.cos(turn), r * np.sin(turn), 0 * turn + 0.05], axis=-1), thick, 6, closed=True)
        for r, thick in ((radius, 0.14), (0.62 * radius, 0.06), (0.25 * radius, 0.07))
    ]
    spoke = np.array([[0.25 * radius, 0.0, 0.05], [0.6 * radius, 0.0, 0.05], [radius, 0.0, 0.05]])
    spokes = [transform(tube(spoke, 0.045, 6), rotate=((0.0, 0.0, 1.0), 30.0 * k)) for k in range(12)]
    return join(rings + spokes)


def turned_column() -> Mesh:
    """Plinth, Attic base, tapered shaft, capital with a collar, eight leaves and an abacus."""
    turn = np.linspace(-np.pi / 2, np.pi / 2, 7)
    torus = [(0.46 + 0.08 * np.cos(a), 0.33 + 0.08 * np.sin(a)) for a in turn]
    scotia = [(0.44 - 0.06 * np.cos(a), 0.48 + 0.05 * np.sin(a)) for a in turn[1:-1]]
    upper = [(0.41 + 0.05 * np.cos(a), 0.58 + 0.05 * np.sin(a)) for a in turn]
    shaft = [(0.4, 0.64), (0.35, 4.24)]  # one band of long thin triangles
    collar = [(0.35 + 0.04 * np.cos(a), 4.3 + 0.04 * np.sin(a)) for a in turn]
    bell = [(0.35 + 0.22 * s**2.2, 4.36 + 0.5 * s) for s in np.linspace(0.0, 1.0, 7)]
    turned = lathe(torus + scotia + upper + shaft + collar + bell, 22)
    leaves = []
    for k in range(8):
        curl = np.array([[0.0, 4.38, 0.36], [0.0, 4.6, 0.42], [0.0, 4.76, 0.54], [0.0, 4.74, 0.62]])
        leaves.append(transform(tube(curl, [0.05, 0.09, 0.06, 0.03], 5), rotate=((0.0, 1.0, 0.0), 45.0 * k)))
    plinth = box((-0.56, 0.0, -0.56), (0.56, 0.25, 0.56))
    abacus = [box((-0.6, 4.86, -0.6), (0.6, 4.98, 0.6)), box((-0.56, 4.98, -0.56), (0.56, COLUMN_HEIGHT, 0.56))]
    return join([plinth, turned, *leaves, *abacus])


def geometry() -> Geometry:
    """All parts of the building."""
    parts = (_shell, _columns, _arcades, _nave_vault, _aisle_vaults, _crossing, _apse, _furniture)
    return Geometry.static(*join(part() for part in parts))


def _shell() -> Mesh:
    """Floor, outer walls and end walls: the largest triangles; a skirting and a cornice along the walls."""
    parts = [
        grid((WEST, 0.0, SIDE), (EAST + 5.0 - WEST, 0.0, 0.0), (0.0, 0.0, -2 * SIDE)),
        grid((WEST, 0.0, SIDE), (0.0, 0.0, -2 * SIDE), (0.0, 15.0, 0.0)),
    ]
    for sign in (-1.0, 1.0):
        wall = grid((WEST, 0.0, -SIDE), (EAST - WEST, 0.0, 0.0), (0.0, 15.0, 0.0))
        trim = [box((WEST, 0.0, -SIDE), (EAST, 0.35, -SIDE + 0.12)), box((WEST, 5.3, -SIDE), (EAST, 5.55, -SIDE + 0.2))]
        east = grid((EAST, 0.0, -SIDE), (0.0, 0.0, SIDE - HALF), (0.0, 8.0, 0.0))
        pilasters = [place(cylinder(0.24, 5.3, 16, caps=False), x, 0.0, -SIDE + 0.1) for x in (*COLUMNS, *CROSSING)]
        windows = [place(window(0.65, 2.4), (a + b) / 2, 2.2, -SIDE) for a, b in BAYS]
        transept = place(rose(1.9), 8.0, 9.0, -SIDE)
        side = join([wall, *trim, flip(east), *windows, *pilasters, transept])
        parts.append(transform(side, scale=(1.0, 1.0, -sign)))
    return join([*parts, place(rose(2.3), WEST, 9.6, 0.0, 90.0), place(window(1.3, 3.4), WEST, 0.0, 0.0, 90.0)])


def _columns() -> Mesh:
    """Both rows of columns, and a thin shaft on the wall above each up to the nave vault."""
    column = turned_column()
    shaft = cylinder(0.16, SPRING - ARCADE_SPRING, 12, caps=False)
    corbel = sphere(0.26, 12, 8)
    inwards = ((column, 0.0, HALF), (shaft, ARCADE_SPRING, HALF - 0.42), (corbel, SPRING, HALF - 0.4))
    return join(place(part, x, y, sign * z) for x in COLUMNS for sign in (-1.0, 1.0) for part, y, z in inwards)


def _arcades() -> Mesh:
    """The wall between nave and aisle over each bay: arch moulding, wall faces down to the arch, clerestory."""
    radius = 1.5
    roll = [(radius + 0.32, 0.44), (radius + 0.3, 0.5), (radius + 0.2, 0.5), (radius + 0.14, 0.42), (radius, 0.38)]
    moulding = flip(arch([(r, -z) for r, z in roll] + roll[::-1], 18))
    angle = np.linspace(np.pi, 0.0, 21)
    x = np.concatenate([[-2.0], radius * np.cos(angle), [2.0]])
    y = np.concatenate([[0.0], radius * np.sin(angle), [0.0]])
    low = np.stack([x, y, np.full_like(x, -0.4)], axis=-1)
    face = patch(np.stack([low, low * (1, 0, 1) + (0.0, SPRING - ARCADE_SPRING, 0.0)], axis=1))
    front = join([flip(face), transform(face, scale=(1.0, 1.0, -1.0))])
    string = box((-2.0, 2.3, -0.52), (2.0, 2.5, 0.52))
    bay = join([moulding, front, string, place(window(0.5, 1.1), 0.0, 3.0, 0.4)])
    sides = ((-HALF, 0.0), (HALF, 180.0))
    return join(place(bay, (a + b) / 2, ARCADE_SPRING, z, turn) for a, b in BAYS for z, turn in sides)


def _nave_vault() -> Mesh:
    """Barrel vaults in strips as long as nave and choir, and a moulded rib over each pair of columns."""
    vaults = []
    for a, b in ((WEST, CROSSING[0]), (CROSSING[1], EAST)):
        barrel = flip(arch([(HALF, -(b - a) / 2), (HALF, (b - a) / 2)], 24))
        vaults.append(place(barrel, (a + b) / 2, SPRING, 0.0, 90.0))
    edge = pairs(4.05, -0.3, 3.86, -0.3, 3.82, -0.18, 3.7, -0.12, 3.7, 0.12, 3.82, 0.18, 3.86, 0.3, 4.05, 0.3)
    moulding = flip(arch(edge, 32))
    ribs = [place(moulding, x, SPRING, 0.0, 90.0) for x in (WEST + 0.3, *COLUMNS, EAST - 0.3)]
    cornice = [box((a, SPRING - 0.3, s - 0.25), (b, SPRING, s + 0.25)) for a, b in BAYS for s in (-HALF, HALF)]
    return join(vaults + ribs + cornice)


def _aisle_vaults() -> Mesh:
    """A groin vault over each aisle bay, with diagonal and transverse ribs and a boss."""
    depth = SIDE - HALF
    s = np.linspace(-1.0, 1.0, 9)
    u, v = np.meshgrid(s, s, indexing="ij")
    # The higher of two barrels crossing: the groins are where they meet.
    rise = 1.9 * np.sqrt(1.0 - np.minimum(np.abs(u), np.abs(v)) ** 2)
    web = flip(patch(np.stack([2.0 * u, rise, -0.5 * depth * v], axis=-1)))
    corner = np.array([2.0, 0.0, depth / 2])
    ribs = [rib(-corner * k, corner * k, 1.9, 0.1, 14, 6) for k in (np.array([1, 1, 1]), np.array([1, 1, -1]))]
    ribs.append(rib((-2.0, 0.0, -depth / 2), (-2.0, 0.0, depth / 2), 1.9, 0.16, 16))
    bay = join([web, *ribs, place(sphere(0.22, 10), 0.0, 1.86, 0.0)])
    return join([place(bay, (a + b) / 2, AISLE_SPRING, s * (HALF + depth / 2)) for a, b in BAYS for s in (-1.0, 1.0)])


def _crossing() -> Mesh:
    """Four clustered piers, great arches, transept vaults, pendentives, drum with windows, dome and lantern."""
    middle = sum(CROSSING) / 2
    top = SPRING + HALF
    half_column = cylinder(0.34, SPRING, 16, caps=False)
    ring = lathe([(0.36, 0.0), (0.5, 0.06), (0.5, 0.16), (0.36, 0.22)], 16)
    parts = []
    for x in CROSSING:
        for z in (-HALF, HALF):
            parts.append(box((x - 0.65, 0.0, z - 0.65), (x + 0.65, SPRING, z + 0.65)))
            for dx, dz in ((0.65, 0.0), (-0.65, 0.0), (0.0, 0.65), (0.0, -0.65)):
                parts.append(place(half_column, x + dx, 0.0, z + dz))
                parts += [place(ring, x + dx, y, z + dz) for y in (0.0, 5.0, SPRING - 0.3)]
    edge = [(4.1, -0.45), (3.8, -0.45), (3.72, -0.3), (3.55, -0.2), (3.55, 0.2), (3.72, 0.3), (3.8, 0.45), (4.1, 0.45)]
    great = flip(arch(edge, 40))
    parts += [place(great, x, SPRING, 0.0, 90.0) for x in CROSSING]
    parts += [place(great, middle, SPRING, z) for z in (-HALF, HALF)]
    length = SIDE - HALF
    arm = flip(arch([(HALF, -length / 2), (HALF, length / 2)], 24))
    sides = [
        grid((x, AISLE_SPRING, -length / 2), (0.0, 0.0, length), (0.0, SPRING - AISLE_SPRING, 0.0)) for x in (-4, 4)
    ]
    for sign in (-1.0, 1.0):
        parts.append(place(arm, middle, SPRING, sign * (HALF + length / 2)))
        parts.append(place(join(sides), middle, 0.0, sign * (HALF + length / 2)))
    # Pendentives: a sphere through the piers' corners, cut by the four arches; they end just above the springing.
    height = np.linspace(0.2, HALF, 9)[:, None]
    radius = np.sqrt(2 * HALF**2 - height**2)
    margin = np.arccos(np.minimum(1.0, HALF / radius))
    angle = margin + (np.pi / 2 - 2 * margin) * np.linspace(0.0, 1.0, 13)
    web = patch(np.stack([radius * np.cos(angle), height + 0 * angle, radius * np.sin(angle)], axis=-1))
    parts += [place(web, middle, SPRING, 0.0, 90.0 * k) for k in range(4)]
    drum = [(4.0, 0.0), (3.8, 0.05), (3.75, 0.3), (4.0, 0.35), (4.0, 3.1), (3.8, 3.15), (3.75, 3.4), (4.0, 3.5)]
    bowl = [(4.0 * np.cos(a), 3.5 + 4.4 * np.sin(a)) for a in np.linspace(0.0, 1.42, 13)[1:]]
    lantern = [(0.62, 9.2), (0.3, 9.5), (0.0, 9.6)]
    parts.append(place(flip(lathe(drum + bowl + lantern, 48)), middle, top, 0.0))
    climb = np.linspace(0.0, 1.42, 15)
    meridian = np.stack([3.95 * np.cos(climb), 3.5 + 4.35 * np.sin(climb), 0 * climb], axis=-1)
    for k in range(8):
        parts.append(place(tube(meridian, 0.11, 6), middle, top, 0.0, 45.0 * k))
        turn = np.radians(45.0 * k + 22.5)
        spot = (middle + 3.97 * np.sin(turn), top + 0.8, 3.97 * np.cos(turn))
        parts.append(place(window(0.45, 1.3), *spot, 180.0 + 45.0 * k + 22.5))
    return join(parts)


def _apse() -> Mesh:
    """Half-round east end with a half dome and ribs; steps, altar with candlesticks, and a cross."""
    wall = flip(lathe([(HALF, 0.0), (HALF, SPRING)], 24, start=0.0, sweep=180.0))
    angle = np.linspace(0.0, np.pi / 2, 13)
    dome = flip(lathe(np.stack([HALF * np.cos(angle[:-1]), HALF * np.sin(angle[:-1])], axis=-1), 24, sweep=180.0))
    path = np.stack([3.95 * np.cos(angle), 3.95 * np.sin(angle), 0 * angle], axis=-1)[:-1]
    ribs = [place(tube(path, 0.1, 6), EAST, SPRING, 0.0, t) for t in (-72.0, -36.0, 0.0, 36.0, 72.0)]
    windows = [
        place(window(0.55, 3.0), EAST + 3.97 * np.cos(t), 4.6, 3.97 * np.sin(t), -90.0 - np.degrees(t))
        for t in np.radians([-54.0, -18.0, 18.0, 54.0])
    ]
    steps = [box((13.2 + 0.4 * k, 0.18 * k, -3.2 + 0.2 * k), (22.0, 0.18 * (k + 1), 3.2 - 0.2 * k)) for k in range(4)]
    altar = [box((18.0, 0.72, -1.3), (19.0, 1.7, 1.3)), box((17.9, 1.7, -1.45), (19.1, 1.8, 1.45))]
    profile = [(0.0, 0.0), (0.12, 0.0), (0.12, 0.03), (0.04, 0.06), (0.03, 0.14), (0.055, 0.18), (0.03, 0.22)]
    profile += [(0.025, 0.4), (0.07, 0.44), (0.07, 0.46), (0.02, 0.46), (0.02, 0.75), (0.0, 0.77)]
    candle = lathe(profile, 16)
    candles = [place(candle, 18.7, 1.8, z) for z in (-1.2, -0.85, -0.5, 0.5, 0.85, 1.2)]
    cross = [box((18.75, 1.8, -0.05), (18.85, 3.4, 0.05)), box((18.75, 2.75, -0.45), (18.85, 2.85, 0.45))]
    round_end = [place(part, EAST, y, 0.0) for part, y in ((wall, 0.0), (dome, SPRING))]
    return join([*round_end, *ribs, *windows, *steps, *altar, *candles, *cross])


def _furniture() -> Mesh:
    """Choir balustrade, a baptismal font, hanging lamps on thin chains, and floor bands one step high."""
    turned = pairs(0.09, 0, 0.09, 0.08, 0.05, 0.12, 0.1, 0.3, 0.045, 0.55, 0.045, 0.62, 0.08, 0.68, 0.08, 0.75)
    baluster = lathe(turned, 14)
    spots = [z for z in np.arange(-3.2, 3.3, 0.32) if abs(z) > 0.8]
    parts = [place(baluster, 12.6, 0.12, float(z)) for z in spots]
    for a, b in ((-3.35, -0.75), (0.75, 3.35)):
        parts += [box((12.45, 0.0, a), (12.75, 0.12, b)), box((12.42, 0.87, a), (12.78, 1.0, b))]
    bowl = pairs(0, 0, 0.5, 0, 0.5, 0.12, 0.2, 0.25, 0.18, 0.6, 0.3, 0.7, 0.6, 0.95, 0.62, 1.1, 0.5, 1.1)
    parts.append(place(lathe([*bowl, (0.3, 0.95), (0.0, 0.9)], 32), -15.0, 0.0, -6.2))
    shade = [(0.0, 0.0), (0.14, 0.04), (0.22, 0.16), (0.24, 0.3), (0.12, 0.4), (0.05, 0.55), (0.0, 0.56)]
    lamp = join([lathe(shade, 20), place(cylinder(0.012, 5.4, 5), 0.0, 0.5, 0.0)])
    parts += [place(lamp, x, 8.6, 0.0) for x in (-14.0, -6.0, 8.0)]
    inner = HALF - 0.7
    parts += [box((x, 0.0, -inner), (x + 0.12, 0.01, inner)) for x in np.arange(WEST + 1.0, 12.0, 1.0)]
    return join(parts + [box((WEST, 0.0, z - 0.12), (12.4, 0.015, z + 0.12)) for z in (-inner, 0.0, inner)])
