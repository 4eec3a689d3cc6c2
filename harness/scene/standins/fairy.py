"""Stand-in for the Utah Fairy Forest: a fairy and a dragonfly hover in a clearing, a teapot in a stadium.

The ground is 24 m wide and made of few large triangles; in its middle, within a few metres, stand dense models
and thousands of blades and leaves (:mod:`.scene.standins.forest`). Wings beat, limbs swing, blades and leaves sway; the
motion repeats after the last frame. Both figures are modelled looking towards +x, then turned.
"""

import numpy as np

from ...arrays import F64
from ..scene import Geometry
from . import forest
from .bodies import Blob, Body, Point, ball, both, chain, curve, limb
from .motion import Carry, Drift, Motion, Part, Sway, Swing, animated
from .shapes import Mesh, patch, transform

FRAMES = 21
TRIANGLES = 174_117  # triangle count of the original; leaves are added up to this number
GRASS = 4600
FAIRY_SPACING = 0.0101
DRAGONFLY_SPACING = 0.0075
FAIRY_PLACE, FAIRY_TURN = (0.05, 0.30, 0.0), -66.0
DRAGONFLY_PLACE, DRAGONFLY_TURN = (0.93, 1.66, 0.50), 200.0


def geometry() -> Geometry:
    parts = [
        Part(forest.ground()),
        Part(forest.trees()),
        Part(forest.mushrooms()),
        forest.grass(GRASS),
        *_placed(_fairy(), FAIRY_PLACE, FAIRY_TURN, Drift((0.0, 0.03, 0.0), shift=0.1)),
        *_placed(_dragonfly(), DRAGONFLY_PLACE, DRAGONFLY_TURN, Drift((0.10, 0.0, 0.05), (0.0, 0.07, 0.03))),
    ]
    so_far = sum(len(part.mesh.faces) for part in parts)
    parts.append(forest.leaves((TRIANGLES - so_far) // 4))
    return animated(parts, FRAMES)


def _placed(parts: list[Part], place: Point, turn: float, drift: Drift) -> list[Part]:
    """Parts of a figure turned about the vertical and put in their place, after their own motions."""
    stand = Swing((0, 0, 0), (0, 1, 0), reach=0.0, mean=turn)
    return [Part(part.mesh, [*part.motions, stand, Carry(place), drift]) for part in parts]


# Joints of the fairy; her right is +z.
SHOULDER_R, ELBOW_R, WRIST_R = (0.0, 1.375, 0.160), (0.06, 1.45, 0.40), (0.13, 1.66, 0.55)
SHOULDER_L, ELBOW_L, WRIST_L = (0.0, 1.375, -0.160), (0.03, 1.17, -0.33), (0.20, 1.10, -0.48)
HIP_R, KNEE_R, ANKLE_R = (0.0, 0.90, 0.080), (0.03, 0.50, 0.10), (-0.03, 0.12, 0.09)
HIP_L, KNEE_L, ANKLE_L = (0.0, 0.90, -0.080), (0.20, 0.58, -0.12), (-0.03, 0.29, -0.11)
SWINGING = (  # groups of blobs that turn about a joint; a group holds those whose names go on from its own
    *("arm right", "arm right fore", "arm left", "arm left fore", "head"),
    *("leg right", "leg right shin", "leg left", "leg left shin"),
)


def _fairy() -> list[Part]:
    body = fairy_body()
    mesh = body.mesh(FAIRY_SPACING)
    weight = body.shares(mesh.vertices, SWINGING, 0.035)
    loose = np.clip((1.45 - mesh.vertices[:, 1]) / 0.5, 0, 1)
    hair = loose * body.shares(mesh.vertices, ("hair",), 0.01)["hair"]
    motions: list[Motion] = [
        Sway(hair[:, None] * np.array([0.05, 0.0, 0.07]), 1.2 * mesh.vertices[:, 1]),
        Swing(ELBOW_R, (1, 0, 0), 14, weight["arm right fore"], shift=0.1),
        Swing(SHOULDER_R, (1, 0, 0), 11, weight["arm right"]),
        Swing(ELBOW_L, (0, 1, 0.3), 16, weight["arm left fore"], shift=0.35),
        Swing(SHOULDER_L, (1, 0, 0), 9, weight["arm left"], shift=0.25),
        Swing(KNEE_R, (0, 0, 1), 9, weight["leg right shin"], mean=-6, shift=0.2),
        Swing(HIP_R, (0, 0, 1), 6, weight["leg right"], shift=0.4),
        Swing(KNEE_L, (0, 0, 1), 12, weight["leg left shin"], shift=0.7),
        Swing(HIP_L, (0, 0, 1), 8, weight["leg left"], shift=0.9),
        Swing((0, 1.42, 0), (0, 1, 0.4), 7, weight["head"], shift=0.3),
    ]
    parts = [Part(mesh, motions), _dress()]
    for flank in (1.0, -1.0):
        root = (-0.085, 1.32, 0.03 * flank)
        upper = _wing((-0.42, 0.78, 0.80 * flank), (-0.25, -0.72, 0.55 * flank), 1.05, 0.34)
        lower = _wing((-0.38, -0.28, 0.85 * flank), (0.05, -0.80, -0.35 * flank), 0.72, 0.27)
        for mesh, lag in ((upper, 0.0), (lower, 0.1)):
            beat = Swing(root, (0.25, 1.0, 0.0), 24 * flank, beats=3, shift=lag)
            parts.append(Part(transform(mesh, translate=root), [beat]))
    return parts


def fairy_body() -> Body:
    """The fairy without dress and wings, 1.72 m high, looking towards +x, one leg drawn up, an arm raised."""
    middle = [
        ball((0, 0.93, 0), (0.105, 0.12, 0.145)),
        limb((0, 1.00, 0), (0, 1.16, 0), 0.085, 0.090, 0.08),
        ball((0.0, 1.27, 0), (0.092, 0.13, 0.130), blend=0.06),
        limb((0, 1.375, -0.135), (0, 1.375, 0.135), 0.040, 0.040, 0.05),
        limb((0, 1.38, 0), (0.01, 1.49, 0), 0.040, 0.036, 0.03, "head"),
        ball((0.015, 1.60, 0), (0.098, 0.112, 0.083), blend=0.02, group="head"),
        ball((0.045, 1.535, 0), (0.058, 0.048, 0.050), blend=0.03, group="head"),
        ball((0.082, 1.507, 0), 0.020, blend=0.02, group="head"),
        limb((0.100, 1.606, 0), (0.119, 1.568, 0), 0.013, 0.016, 0.02, "head"),
        ball((0.100, 1.537, 0), (0.016, 0.010, 0.024), blend=0.008, group="head"),
        ball((-0.030, 1.640, 0), (0.106, 0.114, 0.104), blend=0.006, group="head hair"),
    ]
    sides = [
        ball((0.072, 1.278, 0.055), 0.044, blend=0.03),
        ball((0.112, 1.612, 0.036), (0.018, 0.014, 0.020), blend=0.012, cut=True),
        ball((0.092, 1.610, 0.035), 0.018, blend=0.003, group="head"),
        limb((0.0, 1.59, 0.078), (-0.05, 1.67, 0.135), 0.022, 0.004, 0.012, "head"),
    ]
    limbs = [
        limb(SHOULDER_R, ELBOW_R, 0.042, 0.032, 0.03, "arm right"),
        limb(ELBOW_R, WRIST_R, 0.033, 0.021, 0.01, "arm right fore"),
        *_hand(WRIST_R, (0.25, 0.80, 0.40), (0.9, -0.3, 0.0), "arm right fore"),
        limb(SHOULDER_L, ELBOW_L, 0.042, 0.032, 0.03, "arm left"),
        limb(ELBOW_L, WRIST_L, 0.033, 0.021, 0.01, "arm left fore"),
        *_hand(WRIST_L, (0.65, -0.10, -0.65), (0.6, 0.3, 0.6), "arm left fore"),
        limb(HIP_R, KNEE_R, 0.084, 0.056, 0.04, "leg right"),
        limb(KNEE_R, ANKLE_R, 0.054, 0.030, 0.02, "leg right shin"),
        ball((-0.022, 0.37, 0.097), (0.046, 0.11, 0.044), blend=0.03, group="leg right shin"),
        *chain([ANKLE_R, (0.05, 0.02, 0.095), (0.09, -0.03, 0.10)], [0.032, 0.028, 0.016], 0.02, "leg right shin"),
        limb(HIP_L, KNEE_L, 0.084, 0.056, 0.04, "leg left"),
        limb(KNEE_L, ANKLE_L, 0.054, 0.030, 0.02, "leg left shin"),
        ball((0.045, 0.45, -0.115), (0.11, 0.046, 0.044), ((0, 0, 1), 52), 0.03, group="leg left shin"),
        *chain([ANKLE_L, (-0.10, 0.18, -0.11), (-0.12, 0.12, -0.11)], [0.032, 0.028, 0.016], 0.02, "leg left shin"),
    ]
    return Body(middle + both(sides) + limbs + _hair())


def _directions(ahead: Point, across: Point) -> tuple[F64, F64]:
    """Unit vectors along ``ahead``, and across it as far as may be along ``across``."""
    forward, side = np.asarray(ahead, dtype=np.float64), np.asarray(across, dtype=np.float64)
    forward = forward / np.sqrt((forward**2).sum())
    side = side - forward * (side * forward).sum()
    return forward, side / np.sqrt((side**2).sum())


def _hand(wrist: Point, ahead: Point, across: Point, group: str) -> list[Blob]:
    """Palm and five fingers, spread a little, from the wrist along ``ahead``."""
    start, (forward, side) = np.asarray(wrist, dtype=np.float64), _directions(ahead, across)
    palm = start + 0.055 * forward
    blobs = [
        limb(start, palm + 0.014 * side, 0.019, 0.016, 0.012, group),
        limb(start, palm - 0.014 * side, 0.019, 0.016, 0.012, group),
    ]
    for i in range(4):
        spread = (i - 1.5) * 0.5
        foot = palm + spread * 0.032 * side
        tip = foot + (0.075 - 0.008 * abs(i - 1.2)) * (forward + 0.45 * spread * side)
        blobs.append(limb(foot, tip, 0.0105, 0.0070, 0.006, group))
    return [*blobs, limb(start + 0.02 * forward, start + 0.055 * forward + 0.05 * side, 0.011, 0.006, 0.01, group)]


def _hair() -> list[Blob]:
    """Wavy strands from the crown, down the back."""
    blobs = []
    for i in range(18):
        angle = np.radians(72 + 216 * i / 17)
        out = np.array([np.cos(angle), 0.0, np.sin(angle)])
        knots = [
            np.array([0.015, 1.745, 0.0]) + 0.020 * out,
            np.array([-0.015, 1.69, 0.0]) + 0.085 * out,
            np.array([-0.035, 1.56, 0.0]) + 0.103 * out,
            np.array([-0.09, 1.37, 0.0]) + (0.115 + 0.015 * (i % 3)) * out,
            np.array([-0.15, 1.20 - 0.02 * (i % 4), 0.02 * (i % 3 - 1)]) + 0.125 * out,
            np.array([-0.21, 1.03 - 0.04 * (i % 5), 0.03 * (i % 3 - 1)]) + 0.135 * out,
        ]
        line = np.concatenate([curve(knots[:3], 2), knots[3:]])
        blobs += chain(line, list(np.linspace(0.021, 0.008, len(line))), 0.012, "hair")
    return blobs


def _dress() -> Part:
    """A dress of petals from the bust to above the knee, with folds that deepen towards the hem."""
    profile = curve(
        [(1.325, 0.156), (1.22, 0.138), (1.10, 0.104), (1.03, 0.122), (0.92, 0.190), (0.79, 0.262), (0.66, 0.330)], 5
    )
    share = np.linspace(0.0, 1.0, len(profile))[None, :]
    angle = (2 * np.pi * np.arange(112) / 112)[:, None]
    fall = share * share
    radius = profile[None, :, 1] * (1.0 + 0.16 * fall * np.cos(8 * angle) + 0.05 * fall * np.cos(19 * angle + 1.0))
    hem = 0.11 * share**4 * np.abs(np.cos(4 * angle))
    net = np.stack([0.94 * radius * np.cos(angle), profile[None, :, 0] - hem, 1.04 * radius * np.sin(angle)], axis=-1)
    mesh = patch(net, wrap_u=True)
    low = np.clip((1.05 - mesh.vertices[:, 1]) / 0.4, 0, 1)[:, None]
    flow = Sway(low * np.array([0.035, 0.01, 0.02]), 1.1 * mesh.vertices[:, 1] + 0.6 * mesh.vertices[:, 2])
    return Part(mesh, [flow])


def _wing(ahead: Point, across: Point, length: float, width: float, cells: tuple[int, int] = (44, 22)) -> Mesh:
    """A wing from the origin: a lobed sheet with raised veins and a slight camber."""
    forward, side = _directions(ahead, across)
    up = np.cross(forward, side)
    s = np.linspace(0.0, 1.0, cells[0] + 1)[:, None]
    t = np.linspace(-0.35, 0.65, cells[1] + 1)[None, :]
    lobe = width * (np.sin(np.pi * s**1.5) ** 0.75 + 0.06 * (1 - s)) * (1.0 + 0.06 * np.cos(14 * np.pi * s) * (t > 0))
    vein = 0.006 * np.cos(2 * np.pi * 5 * t) * np.sin(np.pi * s) + 0.06 * s * s - 0.10 * t * t
    return patch(
        (length * s)[..., None] * forward + (lobe * t)[..., None] * 1.2 * side + (length * vein)[..., None] * up
    )


def _dragonfly() -> list[Part]:
    """A dragonfly as long as the fairy's arm, looking towards +x: body, six legs, four beating wings."""
    segments = [(-0.02 - 0.036 * i, 0.012 - 0.0011 * i * i * 0.4, 0.0) for i in range(14)]
    x, y, _ = segments[-1]
    blobs = [
        ball((0.075, 0.0, 0), (0.060, 0.050, 0.044)),
        ball((0.030, 0.015, 0), (0.065, 0.055, 0.046)),
        ball((0.148, 0.0, 0), (0.026, 0.032, 0.042), blend=0.015),
        *(ball(place, (0.024, *[0.021 - 0.0007 * i] * 2), blend=0.004) for i, place in enumerate(segments)),
        *both([ball((0.158, 0.012, 0.030), (0.028, 0.032, 0.026), blend=0.003)]),
        *both([limb((x, y, 0.006), (x - 0.05, y, 0.015), 0.006, 0.003)]),
    ]
    for i in range(3):
        foot = (0.09 - 0.035 * i, -0.03, 0.025)
        knee = (0.10 - 0.055 * i, -0.05, 0.095)
        toe = (0.11 - 0.075 * i, -0.135, 0.085)
        blobs += both(chain([foot, knee, toe], [0.008, 0.006, 0.004], 0.004))
    parts = [Part(Body(blobs).mesh(DRAGONFLY_SPACING))]
    for flank in (1.0, -1.0):
        for i, x in enumerate((0.075, 0.015)):
            root = (x, 0.055, 0.012 * flank)
            mesh = _wing((0.22 - 0.42 * i, 0.10, flank), (-1.0, 0.0, 0.0), 0.44 - 0.03 * i, 0.095 + 0.015 * i, (24, 10))
            beat = Swing(root, (1, 0, 0), 22 * flank, beats=4, shift=0.22 * i)
            parts.append(Part(transform(mesh, translate=root), [beat]))
    return parts
