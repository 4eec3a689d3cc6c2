"""Checks of an answer without a reference: is it valid, and do t, u and v fit its triangle?

The check of t, u and v runs over every pixel in float64, whose own error is far below the float32 tolerance.
"""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..arrays import F64, Bools
from ..frame.schedule.threads import processors
from ..scene.moment import Moment
from ..scene.prepared import Prepared
from .arithmetic import UNIT, edge_bound
from .distances import plane_numbers
from .receivers import not_receivers

T_UNITS = 64.0  # allowed error of t (relative), u and v, in units of 2^-24, on a triangle seen along its normal


BLOCK = 1 << 15  # rays of a block: its temporary arrays fit into a processor's cache


def in_blocks(count: int, work: Callable[[slice], None]) -> None:
    """Call ``work`` on slices of ``count`` rays, on every processor: numpy and Embree release the interpreter's lock."""
    blocks = [slice(start, min(start + BLOCK, count)) for start in range(0, count, BLOCK)]
    if len(blocks) < 2:  # starting a thread takes longer
        list(map(work, blocks))
        return
    with ThreadPoolExecutor(processors()) as pool:
        list(pool.map(work, blocks))


@dataclass(frozen=True, eq=False)
class Checked:
    """Answers, with a flag or an error for each pixel.

    answers          as a method gives them; ``shadowed`` uint8 [lights, pixels]
    outside          bool [lights, pixels]: hit points that have no shadow ray to the light (:mod:`.judge.receivers`)
    border           bool [lights, pixels]: hit points within rounding of a spot's border
    primary_invalid  bool [pixels]: poison, NaN, an index out of range, a triangle never hit, a miss with other values
    shadow_invalid   bool [lights, pixels]: neither 0 nor 1, or 1 at a miss
    t_wrong, uv_wrong  bool [pixels]: beyond the tolerance for the triangle that was given
    t_error          float64 [pixels]: relative error of t against the triangle given; 0 at a miss
    uv_error         float64 [pixels]: the larger absolute error of u and v
    """

    answers: dict[str, NDArray]
    outside: Bools
    border: Bools
    primary_invalid: Bools
    shadow_invalid: Bools
    t_wrong: Bools
    uv_wrong: Bools
    t_error: F64
    uv_error: F64


def check_consistency(prepared: Prepared, moment: Moment, answers: dict[str, NDArray]) -> Checked:
    """Check the answers of a method (numpy arrays as :meth:`.frame.frame.Answers.to_host` gives them).

    A t is wrong where the point eye + t d lies further from the triangle's plane than the float32 rounding of
    coordinates can move that: |t - t*| |n . d| > 64 * 2^-24 t |n . d| + bound, n the unit normal. For u and v the
    same displacement, divided by the triangle's heights. How thin the triangle is does not excuse a t: rounding turns the
    normal of a sliver, but within the triangle its points move no further than the corners.
    """
    triangle, t = answers["triangle"], answers["t"]
    u, v = answers["u"], answers["v"]
    shadowed = answers["shadowed"][: len(moment.lights)]  # a frame without lights has one unused row
    known = (triangle >= 0) & (triangle < len(prepared.faces))
    never = np.zeros(len(triangle), dtype=bool)
    never[known] = moment.valid[triangle[known]] == 0
    miss = triangle == -1
    with np.errstate(invalid="ignore"):
        sound_hit = known & ~never & np.isfinite(t) & (t > 0) & np.isfinite(u) & np.isfinite(v)
        sound_miss = miss & np.isposinf(t) & (u == 0) & (v == 0)
    shadow_invalid = (shadowed > 1) | ((shadowed != 0) & ~known[None, :])
    result = Checked(
        {**answers, "shadowed": shadowed}, *not_receivers(prepared, moment, triangle), ~(sound_hit | sound_miss),
        shadow_invalid, np.zeros(len(triangle), dtype=bool), np.zeros(len(triangle), dtype=bool),
        np.zeros(len(triangle)), np.zeros(len(triangle)),
    )  # fmt: skip
    pixels = np.nonzero(sound_hit)[0]
    in_blocks(len(pixels), lambda block: _check_hits(prepared, moment, answers, pixels[block], result))
    return result


def _check_hits(
    prepared: Prepared, moment: Moment, answers: dict[str, NDArray], pixels: NDArray[np.intp], result: Checked
) -> None:
    corners = moment.points[prepared.faces[answers["triangle"][pixels]]].astype(np.float64)
    d = moment.directions(pixels).astype(np.float64)
    o = moment.origins(pixels).astype(np.float64)
    exact_t, exact_u, exact_v, slope = plane_numbers(corners, o, d)
    error = np.abs(answers["t"][pixels].astype(np.float64) - exact_t)
    uv_error = np.maximum(
        np.abs(answers["u"][pixels].astype(np.float64) - exact_u),
        np.abs(answers["v"][pixels].astype(np.float64) - exact_v),
    )
    e, f = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    area = np.linalg.norm(np.cross(e, f), axis=1)
    longest = np.max([np.linalg.norm(side, axis=1) for side in (e, f, f - e)], axis=0)
    steep = np.abs(slope)
    with np.errstate(divide="ignore", invalid="ignore"):
        speed = np.linalg.norm(d, axis=1)
        met = o + np.where(np.isfinite(exact_t), exact_t, 0.0)[:, None] * d
        slack = edge_bound(o, met)
        # A coplanar ray has no t on this triangle: the referee judges the triangle, there is nothing to compare.
        real = steep > 2.0**-45 * speed
        result.t_wrong[pixels] = real & ~(error * steep <= T_UNITS * UNIT * exact_t * steep + slack)
        result.uv_wrong[pixels] = real & ~(uv_error <= T_UNITS * UNIT + slack * speed / steep * longest / area)
        result.t_error[pixels] = np.where(real & (exact_t > 0), error / exact_t, 0.0)
    result.uv_error[pixels] = np.where(real, uv_error, 0.0)
