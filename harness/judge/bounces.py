"""The rays of bounces, and the check that they were made correctly.

The rays that the harness made are stored with a method's answers and are the definition, so each bounce is judged by
itself: its rays against a numpy version computed from the answers of the bounce before (whatever these were), its hits
and shadow bits against Embree and the exact referee on those very rays, as primary rays are.
"""

from dataclasses import dataclass, field, fields

import numpy as np
from numpy.typing import NDArray

from ..arrays import F32, F64, Bools, Ints
from ..scene.moment import Moment
from ..scene.prepared import Prepared
from .context import Judge
from .reference import ANSWERS

FINE = 2.0**-48  # bound on the float64 rounding of a made ray, 32 units: devices may fuse multiplication and addition
NO_RAY = -77  # stands for a triangle given where there is no ray: never a valid answer


@dataclass(frozen=True, eq=False)
class Mirrored(Moment):
    """A moment whose rays are those of a bounce, one per pixel; a pixel without a ray gets one that leads out of the
    scene.

    ray_origins, ray_directions  float32 [pixels, 3];  active  bool [pixels]
    """

    ray_origins: F32 = field(default_factory=lambda: np.zeros((0, 3), dtype=np.float32))
    ray_directions: F32 = field(default_factory=lambda: np.zeros((0, 3), dtype=np.float32))
    active: Bools = field(default_factory=lambda: np.zeros(0, dtype=bool))

    def origins(self, pixels: Ints) -> F32:
        return self.ray_origins[pixels]

    def directions(self, pixels: Ints) -> F32:
        return self.ray_directions[pixels]


def mirrored(prepared: Prepared, moment: Moment, answers: dict[str, NDArray], bounce: int) -> Mirrored:
    """The moment with the rays of a bounce from 1, as they are in ``answers`` (of ``Answers.to_host``)."""
    active = answers["bounce_active"][bounce - 1] == 1
    corners = moment.points[prepared.faces[moment.valid != 0]]
    # Beyond every vertex along every axis, and leading away: such a ray meets nothing, exactly.
    beyond = min(4.0 * float(np.abs(corners).max(initial=1.0)), float(np.finfo(np.float32).max))
    origins = np.where(active[:, None], answers["bounce_origin"][bounce - 1], np.float32(beyond))
    directions = np.where(active[:, None], answers["bounce_direction"][bounce - 1], np.float32(1.0))
    given = {one.name: getattr(moment, one.name) for one in fields(Moment)}
    return Mirrored(**given, ray_origins=origins, ray_directions=directions, active=active)


def bounce_judge(judge: Judge, answers: dict[str, NDArray], bounce: int) -> Judge:
    """The judge of a bounce's rays. As many rays are sampled as primary rays, or all if there are fewer."""
    rays = mirrored(judge.prepared, judge.moment, answers, bounce)
    count, active = len(rays.active), int(rays.active.sum())
    return judge.of_rays(rays, min(count, judge.random_pixels * count // max(1, active)))


def bounce_answers(answers: dict[str, NDArray], bounce: int) -> dict[str, NDArray]:
    """A method's answers to a bounce, in the form of answers to primary rays; of bounce 0 those themselves."""
    if not bounce:
        return {name: answers[name] for name in ANSWERS}
    result = {name: answers[f"bounce_{name}"][bounce - 1] for name in ANSWERS}
    idle = (answers["bounce_active"][bounce - 1] != 1) & (result["triangle"] != -1)
    return {**result, "triangle": np.where(idle, NO_RAY, result["triangle"])}


def wrong_rays(judge: Judge, answers: dict[str, NDArray], bounce: int) -> Bools:
    """The pixels whose ray of a bounce is not the one that follows from the bounce before. bool [pixels]

    A ray may differ from that of the numpy version by the rounding to float32, and by the float64 rounding, which is
    larger on a thin triangle (by the edges' product over the area) and at a grazing angle (by the inverse of the slope).
    """
    prepared, moment = judge.prepared, judge.moment
    before = mirrored(prepared, moment, answers, bounce - 1) if bounce > 1 else moment
    triangle = bounce_answers(answers, bounce - 1)["triangle"]
    active = answers["bounce_active"][bounce - 1]
    origin, direction = (answers[f"bounce_{name}"][bounce - 1].astype(np.float64) for name in ("origin", "direction"))
    expected = (triangle >= 0) & (triangle < prepared.triangle_count)
    expected[expected] = prepared.mirror[triangle[expected]] == 1
    pixels = np.nonzero(expected)[0]
    corners = moment.points[prepared.faces[triangle[pixels]]].astype(np.float64)
    o, d = (part(pixels).astype(np.float64) for part in (before.origins, before.directions))
    with np.errstate(all="ignore"):
        start, way, thin, slope = reflected(corners, o, d)
        sound = np.isfinite(start).all(axis=1) & np.isfinite(way).all(axis=1)
        size = np.abs(corners).max(axis=(1, 2)) + np.abs(o).max(axis=1) + np.abs(start).max(axis=1)
        slack = (FINE * thin * size / slope)[:, None] + 2.0**-23 * np.abs(start) + 2.0**-140
        turn = (FINE * thin * np.linalg.norm(d, axis=1))[:, None] + 2.0**-23 * np.abs(way) + 2.0**-140
        off = (np.abs(origin[pixels] - start) > slack).any(axis=1)
        off |= (np.abs(direction[pixels] - way) > turn).any(axis=1)
    wrong = np.where(expected, active != 1, (active != 0) | origin.any(axis=1) | direction.any(axis=1))
    wrong[pixels] = sound & (wrong[pixels] | off)
    return wrong


def reflected(corners: F64, o: F64, d: F64) -> tuple[F64, F64, F64, F64]:
    """Start and direction [n, 3] of mirrored rays in float64, before rounding, as :mod:`..frame.effects.mirrors`
    computes them. Also, [n]: the edges' product over the area of each triangle, and the sine of the ray's angle to its
    plane."""
    a = corners[:, 0]
    e, f = corners[:, 1] - a, corners[:, 2] - a
    n = np.cross(e, f)
    slope = _dots(n, d)
    h = o + d * (_dots(n, a - o) / slope)[:, None]
    way = d - n * (2.0 * slope / _dots(n, n))[:, None]
    area = np.linalg.norm(n, axis=1)
    side = n * (np.where(slope > 0.0, -1.0, 1.0) / area)[:, None]
    apart = np.abs(corners - h[:, None])
    gamma = 7.0 * 2.0**-24 / (1.0 - 7.0 * 2.0**-24)
    reach = apart.max(axis=(1, 2))
    step = FINE * (reach + np.abs(h).max(axis=1) + np.abs(o).max(axis=1)) + gamma * (
        _dots(np.abs(side), np.abs(h) + apart.max(axis=1)) + reach * np.abs(_dots(side, way)) / np.abs(way).max(axis=1)
    )
    start = h + step[:, None] * side
    start += np.sign(side) * 2.0**-23 * np.abs(start)
    thin = np.linalg.norm(e, axis=1) * np.linalg.norm(f, axis=1) / area
    return start, way, thin, np.abs(slope) / (area * np.linalg.norm(d, axis=1))


def _dots(p: F64, q: F64) -> F64:
    return np.einsum("ij,ij->i", p, q)
