"""P60, S60-S63, V axis: triangles far larger than the eye's distance, occluders at the very ends of a segment, spots whose
borders touch a contact of two surfaces, and axes of unlike scale.

An edge whose ends are 1e9 and more times as far away as what passes it is decided by digits that float64 does not have.
"""

from collections.abc import Iterator

import numpy as np

from ..scene.light_paths import vector
from .case import Counts, HardCase, Mesh, Trial, case, joined, plane, quad, soup, spot_light, triangles, view
from .variants import ball_on_floor

EDGE, THIRD = np.array([3.0, 2.0, 1.0]), np.array([-5.0, 7.0, 2.0])
NORMAL = np.cross(EDGE, THIRD) / np.linalg.norm(np.cross(EDGE, THIRD))
ALONG = EDGE / np.linalg.norm(EDGE)
ASIDE = np.cross(EDGE, NORMAL) / np.linalg.norm(np.cross(EDGE, NORMAL))
WALL = quad((0, -2, -2), (0, 2, -2), (0, 2, 2), (0, -2, 2))

POWERS = (30, 33, 43, 53, 100)
"""Of two: the sizes of triangles. From 33 on a strip is wider than what is excused, from 53 on it is the whole picture."""


def giant(power: int) -> tuple[np.ndarray, np.ndarray]:
    """A triangle one of whose edges passes exactly through 0."""
    return triangles(*(np.array([-EDGE, 2 * EDGE, THIRD]) * 2.0**power))


def strip(power: int) -> float:
    """Half the width of a picture that shows what float64 leaves open."""
    return float(np.clip(2.0 ** (power - 51), 1e-6, 0.3))


def giant_edge(power: int, turn: int = 0) -> Trial:
    """The border of a giant triangle, seen from a height of 1, in the middle of the picture."""
    eye = NORMAL + 0.013 * ASIDE + 0.021 * EDGE
    return view(
        giant(power), [tuple(2 * NORMAL + 0.1 * ASIDE), tuple(-NORMAL)], eye, -NORMAL - 0.013 * ASIDE, strip(power),
        up=EDGE.tolist(), turn=turn, stated=Counts(128),
    )  # fmt: skip


def giant_shadow(power: int, turn: int = 0) -> Trial:
    """The border of its shadow on a square below it."""
    corners = [-NORMAL + a * ASIDE + b * ALONG for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    light = 1.3 * NORMAL + 0.2 * ASIDE
    eye, border = -2.5 * NORMAL + 0.3 * ASIDE + 0.1 * ALONG, -NORMAL - 0.2 / 1.3 * ASIDE
    return view(
        joined(giant(power), quad(*corners)), [tuple(light)], eye, border - eye, strip(power), up=ALONG, turn=turn,
        stated=Counts(256),
    )  # fmt: skip


def before_the_light(distance: float, share: float, width: float, turn: int = 0) -> Trial:
    """Light that grazes a long triangle and meets it within ``share`` of its way before the light."""
    long = triangles((0.5, 0, share), (2 * distance, width, share), (2 * distance, -width, share))
    return view(
        joined(WALL, long), [(distance, 0, 0)], (-3, 0, 1), (1, 0, 0), 0.125, turn=turn, stated=Counts(256, (256,))
    )  # fmt: skip


def before_the_hit(distance: float, gap: float, turn: int = 0) -> Trial:
    """A sheet so close above a wall: the smallest gap that is promised is 2e-13 of the coordinates."""
    sheet = triangles((gap, -8, -6), (gap, 8, -6), (gap, 0, 9))
    return view(
        joined(WALL, sheet), [(distance, distance / 4, distance / 8)], (-3, 0, 0.25), (1, 0, 0), 0.125, turn=turn,
        stated=Counts(256, (256,)),
    )  # fmt: skip


def spots_at_a_contact(tilted: bool, turn: int = 0) -> Trial:
    """A wall stands on a floor, on which there are spots that light what is above it: every hit of the floor is on their
    border, where rounding of the hit point decides whether it has a shadow ray. A rectangle and a cone of another light
    touch the line of the contact. A plate through the floor shadows both."""
    axes = np.array([(2, -1, 2), (2, 2, -1), (-1, 2, 2)] if tilted else np.eye(3))

    def placed(*p: float) -> tuple[float, float, float]:
        return vector(axes @ p)

    over, above, below, up = placed(0, 0, 1), placed(0.625, -0.25, 0), placed(0, 0, -1), placed(0, 1, 0)
    spots = [
        spot_light(over, below, 45.0, 60.0, up), spot_light(over, below, 45.0, None, up),
        spot_light(above, over, 90.0, None, up), spot_light(above, over, 90.0, 90.0, up),
    ]  # fmt: skip
    plate = quad((0.5, -0.125, -1), (0.75, -0.125, -1), (0.75, 0.125, 1), (0.5, 0.125, 1))
    points, faces = joined(plane(2, 0, 3), plane(0, 1, 3), plate)
    eye, towards = placed(-0.3, -0.9, 1.7), placed(0.93, 1.05, -1.7)
    return view((points @ axes.T, faces), spots, eye, towards, 0.5, up=over, turn=turn)


def thin_axis(power: int, turn: int, mesh: Mesh) -> Trial:
    """A mesh with one axis multiplied by a power of two, as are the lights, the eye and what the picture shows of that axis:
    its columns are all but one."""
    factors = np.array([1.0, 1.0, 2.0**power])
    eye, towards, *lights = (
        vector(np.array(p) * factors) for p in ((0.3, 1.7, 1.5), (-0.2, -1.3, -1.5), (1, 2.5, 0.5), (-0.4, 0.1, 0.7))
    )
    return view((mesh[0] * factors, mesh[1]), lights, eye, towards, 2.0**power, (2, 128), up=(0, 0, 1), turn=turn)


def _cases() -> Iterator[HardCase]:
    digits = "edges decided from corners far away"
    for k, power in enumerate(POWERS):
        yield case(f"P60 {power}", f"a triangle 2^{power} large, seen at its border", digits, giant_edge, power, k % 3)
        yield case(f"S60 {power}", f"the shadow of a triangle 2^{power} large", digits, giant_shadow, power, k % 3)
    for k, distance in enumerate((4.0, 1e3, 1e6)):
        for share in (1e-6, 1e-10, 1e-14):
            yield case(
                f"S61 {distance:g} {share:g}", f"an occluder {share:g} of the way before a light at {distance:g}",
                "a surface near the light taken for one at the light", before_the_light, distance, share,
                distance / 1e3, k,
            )  # fmt: skip
        for gap in (1e-6, 1e-9, 1e-12):
            yield case(
                f"S62 {distance:g} {gap:g}", f"an occluder {gap:g} above the hit point, a light at {distance:g}",
                "a surface near the hit point taken for its own", before_the_hit, distance, gap, k,
            )  # fmt: skip
    for turn in range(4):
        yield case(
            f"S63 {turn}", "spots whose borders touch a contact of two surfaces",
            "rounding of the hit point decides on which side of a spot's border it is", spots_at_a_contact, turn > 0,
            turn % 3,
        )  # fmt: skip
    meshes = (
        ("", "a ball on a floor", ball_on_floor()),
        (" flat", "triangles of which none stays steep", soup(7, 24, 1.0)),
    )
    for suffix, title, mesh in meshes:
        for turn, power in enumerate((-20, -40, -60)):
            yield case(
                f"V axis {power}{suffix}", f"{title}, one axis times 2^{power}", "bounds by the largest coordinate",
                thin_axis, power, turn, mesh,
            )  # fmt: skip


CASES = tuple(_cases())
