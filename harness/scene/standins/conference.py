"""Stand-in for the Conference Room: a closed room with a long table, 30 upholstered chairs, lamps, blinds, cups.
Furniture of all sizes: walls, floor and ceiling of two triangles each, long thin trims and slats, and curved chairs,
lamps and cups that hold most of the triangles. x runs along the table, y is up, metres.
"""

import itertools

import numpy as np

from ..scene import Geometry
from . import furniture
from .furniture import X_AXIS, Z_AXIS, raised_field
from .shapes import Mesh, box, cylinder, flip, join, lathe, pairs, patch, place, sphere, transform, tube

LENGTH, HEIGHT, WIDTH = 12.0, 3.1, 7.6
X, Z = LENGTH / 2, WIDTH / 2
TABLE_X, TABLE_Z, TABLE_Y = 3.7, 1.15, 0.75  # half length, half width and height of the table
SEED = 284


def geometry() -> Geometry:
    """The room and all that stands in it."""
    parts = (_shell, _panelling, _ceiling, _windows, _doors_and_boards, _table, _chairs, _table_things)
    shrub = place(furniture.shrub(SEED + 3), 5.4, 0.0, -3.2)
    return Geometry.static(*join([*(part() for part in parts), _sideboard(), shrub, _cables()]))


def _shell() -> Mesh:
    """Floor, ceiling and four walls: twelve triangles that face inwards."""
    return flip(box((-X, 0.0, -Z), (X, HEIGHT, Z)))


def _panelling() -> Mesh:
    """Wooden panels with a raised field around the lower wall, long skirting and rails, fabric panels above."""
    panel = join([box((0.03, 0.14, 0.0), (0.77, 0.86, 0.02)), raised_field((0.09, 0.2), (0.71, 0.8), 0.02, 0.045)])
    fabric = box((0.04, 1.1, 0.0), (1.56, 2.7, 0.03))
    parts = []
    for half, other, turn in ((X, Z, 0.0), (X, Z, 180.0), (Z, X, 90.0), (Z, X, 270.0)):
        count = round(2 * half / 0.8)
        step = 2 * half / count
        wall = [place(panel, -half + k * step, 0.0, -other) for k in range(count)]
        wall += [
            box((-half, 0.0, -other), (half, 0.12, -other + 0.05)),
            box((-half, 0.89, -other), (half, 0.97, -other + 0.06)),
            box((-half, 2.82, -other), (half, 2.9, -other + 0.07)),
        ]
        if turn in (180.0, 90.0):
            wall += [place(fabric, -half + 0.1 + 1.65 * k, 0.0, -other) for k in range(int((2 * half - 0.2) / 1.65))]
        parts.append(place(join(wall), 0.0, 0.0, 0.0, turn))
    return join(parts)


def _ceiling() -> Mesh:
    """Thin bars that divide the ceiling into tiles, 24 downlights, four louvred lamps, sprinklers."""
    parts = [box((-X, HEIGHT - 0.012, z - 0.015), (X, HEIGHT, z + 0.015)) for z in np.arange(-3.6, 3.7, 0.6)]
    parts += [box((x - 0.015, HEIGHT - 0.01, -Z), (x + 0.015, HEIGHT, Z)) for x in np.arange(-5.4, 5.5, 0.6)]
    spot, lamp = furniture.downlight(), furniture.louvred_lamp()
    spots = [(x, z) for x in (-4.5, -2.7, -0.9, 0.9, 2.7, 4.5) for z in (-2.7, -1.5, 1.5, 2.7)]
    parts += [place(spot, x, HEIGHT - 0.001, z) for x, z in spots]
    parts += [place(lamp, x, HEIGHT - 0.015, z) for x in (-2.4, 2.4) for z in (-0.6, 0.6)]
    sprinkler = join([cylinder(0.012, 0.06, 10), place(cylinder(0.035, 0.004, 16), 0.0, -0.004, 0.0)])
    return join(parts + [place(sprinkler, x, HEIGHT - 0.06, 0.0) for x in (-4.2, -1.2, 1.8, 4.2)])


def _windows() -> Mesh:
    """Three windows in the far long wall with frames and half-open venetian blinds: long thin slats on cords."""
    slat = transform(box((-0.95, -0.0006, -0.0125), (0.95, 0.0006, 0.0125)), rotate=(X_AXIS, 35.0))
    frame = [box((x, 1.0, 0.0), (x + 0.06, 2.7, 0.07)) for x in (-1.06, -0.03, 1.0)]
    frame += [box((-1.06, y, 0.0), (1.06, y + 0.06, 0.09)) for y in (1.0, 2.7)]
    blind = [place(slat, 0.0, 1.35 + 0.028 * k, 0.11) for k in range(46)]
    blind += [place(cylinder(0.0015, 1.4, 5), x, 1.3, 0.11 + d) for x in (-0.7, 0.0, 0.7) for d in (-0.014, 0.014)]
    blind += [box((-0.97, 2.65, 0.08), (0.97, 2.7, 0.14)), box((-0.95, 1.32, 0.095), (0.95, 1.335, 0.125))]
    return join([place(join(frame + blind), x, 0.0, -Z) for x in (-3.6, 0.0, 3.6)])


def _doors_and_boards() -> Mesh:
    """A double door with handles and hinges, a whiteboard with its tray and pens, a screen, a clock."""
    turn = np.linspace(0.0, np.pi, 16)
    grip = np.stack([0.09 + 0 * turn, 1.05 + 0.12 * np.cos(turn), 0.06 + 0.06 * np.sin(turn)], axis=-1)
    leaf = [box((0.02, 0.01, 0.0), (0.98, 2.2, 0.06)), tube(grip, 0.012, 12)]
    leaf += [raised_field((0.14, low), (0.86, high), 0.06, 0.08) for low, high in ((0.2, 1.0), (1.15, 2.08))]
    leaf += [place(cylinder(0.012, 0.1, 12), 0.97, y, 0.07) for y in (0.3, 1.1, 1.9)]
    door = [join(leaf), transform(join(leaf), scale=(-1.0, 1.0, 1.0)), box((-1.08, 2.2, 0.0), (1.08, 2.3, 0.1))]
    door += [box((x, 0.0, 0.0), (x + 0.08, 2.2, 0.1)) for x in (-1.08, 1.0)]

    pen = tube([[0.0, 0.0, 0.0], [0.12, 0.0, 0.0]], 0.008, 10)
    board = [box((-1.2, 1.05, 0.0), (1.2, 2.35, 0.03)), box((-1.2, 1.0, 0.0), (1.2, 1.03, 0.1))]
    board += [place(pen, -0.9 + 0.2 * k, 1.04, 0.06) for k in range(5)]
    roller = transform(cylinder(0.06, 2.7, 20), rotate=(Z_AXIS, -90.0), translate=(-1.35, 2.62, 0.08))
    screen = [box((-1.3, 0.95, 0.0), (1.3, 2.55, 0.015)), roller]
    clock = lathe(pairs(0, 0, 0.17, 0, 0.17, 0.03, 0.15, 0.045, 0.14, 0.03, 0, 0.03), 36)
    hung = [place(join(door), X, 0.0, 1.6, -90.0), place(join(board), X - 0.03, 0.0, -1.6, -90.0)]
    hung += [place(join(screen), -X + 0.05, 0.0, 0.0, 90.0)]
    return join([*hung, place(transform(clock, rotate=(X_AXIS, 90.0)), X - 0.03, 2.55, 0.2, -90.0)])


def _table() -> Mesh:
    """A boat-shaped top with a round edge, and two panelled pedestals joined by a beam."""
    turn = 2 * np.pi * np.arange(96) / 96
    along, across = np.sin(turn), np.cos(turn)
    along, across = np.sign(along) * np.abs(along) ** 0.55, np.sign(across) * np.abs(across) ** 0.75
    edge = np.linspace(-np.pi / 2, np.pi / 2, 9)
    # Rings from the underside over the round edge to the top: distance from the outline, height.
    round_edge = [(-0.03 + 0.03 * np.cos(a), -0.025 + 0.025 * np.sin(a)) for a in edge]
    rings = [(-0.6, -0.05), *round_edge, (-0.2, 0.0)]
    level = np.ones(96)
    net = [np.stack([along * (TABLE_X + d), (TABLE_Y + y) * level, across * (TABLE_Z + d)], axis=-1) for d, y in rings]
    rim = patch(np.stack(net, axis=1), wrap_u=True)
    # The top inside the rim is a fan of triangles as long as half the table.
    around = np.arange(96)
    fan = np.stack([around, np.roll(around, -1), np.full(96, 96)], axis=-1).astype(np.int32)
    parts = [rim, Mesh(np.concatenate([net[-1], [[0.0, TABLE_Y, 0.0]]]), fan)]
    for x in (-2.1, 2.1):
        parts.append(box((x - 0.45, 0.06, -0.32), (x + 0.45, 0.71, 0.32)))
        parts.append(box((x - 0.6, 0.0, -0.45), (x + 0.6, 0.06, 0.45)))
        field = raised_field((-0.4, 0.12), (0.4, 0.65), 0.32, 0.35)
        parts += [place(field, x, 0.0, 0.0, side) for side in (0.0, 180.0)]
    return join([*parts, box((-1.65, 0.3, -0.03), (1.65, 0.5, 0.03))])


def _chairs() -> Mesh:
    """Nine chairs on each long side, one at each end, ten along the walls; each a little turned."""
    chair = furniture.chair()
    random = np.random.default_rng(SEED)
    places = [(x, s * 1.42, 90.0 + s * 90.0) for s in (-1.0, 1.0) for x in np.linspace(-3.0, 3.0, 9)]
    places += [(-4.15, 0.0, 90.0), (4.15, 0.0, -90.0)]
    places += [(x, -3.3, 0.0) for x in (-4.9, -1.9, -1.15, 1.15, 1.9, 4.9)]
    places += [(-5.45, z, 90.0) for z in (-2.4, 2.2)] + [(-2.0, 3.3, 180.0), (-1.2, 3.3, 180.0)]
    jitter = random.uniform(-1.0, 1.0, (len(places), 3)) * (0.05, 0.06, 14.0)
    moved = np.array(places) + jitter
    return join(place(chair, x, 0.0, z, turn) for x, z, turn in moved)


def _table_things() -> Mesh:
    """At each seat a cup and a pad or a laptop, at every second one a microphone and a glass; shared things."""
    random = np.random.default_rng(SEED + 1)
    cup, pad, laptop = furniture.cup(), furniture.pad(), furniture.laptop()
    microphone, glass, carafe = furniture.microphone(), furniture.glass(), furniture.carafe()
    parts = []
    for side, face in ((-1.0, 180.0), (1.0, 0.0)):
        for k, x in enumerate(np.linspace(-3.0, 3.0, 9)):
            dx, dz, turn = random.uniform(-1.0, 1.0, 3) * (0.04, 0.03, 20.0)
            seat = [place(cup, 0.2 + dx, 0.0, 0.7, 3 * turn)]
            seat.append(place(laptop if k % 3 == 1 else pad, dx, 0.0, 0.75 + dz, 0.5 * turn))
            if k % 2 == 0:
                seat += [place(microphone, -0.12, 0.0, 0.42, turn), place(glass, 0.24, 0.0, 0.5 + dz)]
            parts.append(place(join(seat), side * x, TABLE_Y, 0.0, face))
    parts += [place(carafe, x, TABLE_Y, z) for x, z in ((-1.6, 0.1), (1.5, -0.12), (2.6, 0.05))]
    parts.append(place(furniture.telephone(), 0.0, TABLE_Y, 0.0))
    lens = transform(cylinder(0.035, 0.05, 24), rotate=(Z_AXIS, 90.0))
    projector = box((-0.9, TABLE_Y + 0.02, -0.14), (-0.55, TABLE_Y + 0.13, 0.14))
    return join([*parts, projector, place(lens, -0.9, TABLE_Y + 0.08, 0.06)])


def _sideboard() -> Mesh:
    """A low cupboard at the near wall with doors and knobs, a row of books, and spare cups."""
    parts = [box((0.6, 0.08, 3.25), (3.4, 0.85, 3.72)), box((0.55, 0.85, 3.22), (3.45, 0.89, 3.74))]
    for x in (0.62, 1.31, 2.0, 2.69):
        parts += [box((x, 0.12, 3.23), (x + 0.66, 0.82, 3.25)), place(sphere(0.018, 14), x + 0.6, 0.5, 3.21)]
    random = np.random.default_rng(SEED + 2)
    x = 0.75
    for thick, tall in random.uniform((0.015, 0.2), (0.05, 0.3), (24, 2)):
        parts.append(box((x, 0.89, 3.42), (x + thick, 0.89 + tall, 3.62)))
        x += thick + 0.002
    cup = furniture.cup()
    parts += [place(cup, 2.2 + 0.18 * (k % 5), 0.89, 3.4 + 0.18 * (k // 5), 40.0 * k) for k in range(10)]
    return join(parts)


def _cables() -> Mesh:
    """Cables of the microphones over the table to its middle, and three that hang down to the floor."""
    s = np.linspace(0.0, 1.0, 40)
    parts = []
    for x, side in itertools.product(np.linspace(-3.0, 3.0, 5), (-1.0, 1.0)):
        wave = 0.02 * np.sin(9.0 * s + x)
        path = np.stack([x * (1 - 0.6 * s) + wave, 0 * s + TABLE_Y + 0.004, side * 0.4 * (1 - s) + wave], axis=-1)
        parts.append(tube(path, 0.003, 6))
    for x, z in ((-2.4, 0.5), (0.2, -0.4), (2.6, 0.45)):
        sag = np.stack([x + 0.25 * np.sin(5.0 * s) * s, 0.006 + 0.69 * (1 - s) ** 2.5, z + 0.4 * s**2], axis=-1)
        parts.append(tube(sag, 0.005, 8))
    return join(parts)
