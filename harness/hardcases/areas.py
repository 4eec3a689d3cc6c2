"""A: lights with an area that touches, crosses or lies in a surface, of extreme size, with targets on vertices.

What is judged are the shadow bits of the targets; a surface exactly at a target does not count.
"""

import numpy as np

from ..scene.scene import Light, Vector
from ..scene.targets import target_places
from .case import ORIGIN, Counts, Trial, hard, view
from .shapes import ball, box, joined, plane, triangles

DOWN = (0.0, 0.0, -1.0)


def area(shape: str, size: float | tuple[float, float], samples: int = 4, at: Vector = ORIGIN) -> Light:
    """An area at a place, its plane perpendicular to z."""
    return Light(at, shape=shape, size=size, samples=samples, towards=DOWN)


@hard("A01", "area in the plane of a surface", "a surface at the light, and planes through it")
def in_surface() -> Trial:
    """A rectangle in the plane of a ceiling, which shadows nothing, and a disc in the plane of a triangle it overlaps."""
    lights = [area("rectangle", (2, 1)), area("disc", 1.5, at=(0.5, 0.25, -1))]
    mesh = joined(plane(2, 0, 8), triangles((0, 0, -1), (2, 0, -1), (0, 2, -1)), plane(2, -3, 8))
    stated = Counts(64, (*[None] * 4, *[0] * 4))
    return view(mesh, lights, (0, 0, -7), (0, 0, 1), 0.25, (8, 8), stated=stated)


@hard("A02", "area crossed by a surface", "one side taken for all targets of a light", height=0.0)
@hard("A03", "area that stands on a surface", "an offset from the light", height=0.25)
def across_surface(height: float) -> Trial:
    """A sphere that a sheet crosses, with targets on both sides; or that stands on it. Receivers beyond the sheet."""
    lamp = area("sphere", 0.5, 8, (0.0, 0.0, height))
    return view(joined(plane(2, 0, 1), plane(2, -2, 8)), [lamp], (0, 0, -6), (0, 0, 1), 0.5, (8, 8))


@hard("A04", "area around a box", "targets inside and outside one surface")
def around_surface() -> Trial:
    """A sphere of targets on the corners' radius of a box: nearly in its surface everywhere."""
    lamp = area("sphere", 2.0 * 3.0**0.5, 8)
    return view(joined(box(-1, 1), plane(2, -3, 8)), [lamp], (0, 0, -8), (0, 0, 1), 0.5, (8, 8))


@hard("A05", "area of size 0", "division by the size of a light", size=0.0)
@hard("A06", "area of size 1e-30", "division by the size of a light", size=1e-30)
@hard("A07", "area of 1e6 radii", "one region for all targets of a light", size=4e6)
@hard("A08", "rectangle of 1e6 radii", "one region for all targets of a light", size=4e6, shape="rectangle")
def of_size(size: float, shape: str = "sphere") -> Trial:
    """A light over a ball, its targets in one place or far outside the scene."""
    equal = tuple((0, i) for i in range(1, 4)) if size < 1e-20 else ()
    mesh, lamp = joined(ball(0.75, ORIGIN), plane(2, -1, 4)), area(shape, size, at=(0.5, 0.75, 3.0))
    return view(mesh, [lamp], (0, 0, -5), (0, 0, 1), 0.75, (8, 8), same_lights=equal)


@hard("A09", "targets on vertices", "a surface at the light counts")
def at_vertices() -> Trial:
    """A triangle hangs at each target by a corner, so that each target is a vertex and the others look past or at it."""
    lamp = area("rectangle", 2.0)
    hung = [(p, (p[0] + 0.5, p[1], -1.0), (p[0], p[1] + 0.5, -1.0)) for p in target_places(lamp, 0, np.zeros(3), DOWN)]
    return view(joined(triangles(*hung), plane(2, -3, 8)), [lamp], (0, 0, -7), (0, 0, 1), 0.5, (8, 8))


@hard("A10", "256 targets", "a fixed number of lights", large=True, lights=1, samples=256)
@hard("A11", "64 lights with areas", "a fixed number of lights", large=True, lights=64, samples=2)
def many(lights: int, samples: int) -> Trial:
    """Many lights, or one with many targets, over a ball."""
    lamps = [area("disc", 1.0, samples, (float(x), 0.5, 2.5)) for x in np.linspace(-1, 1, lights)]
    return view(joined(ball(0.75, ORIGIN), plane(2, -1, 4)), lamps, (0, 0, -5), (0, 0, 1), 0.75, (4, 4))
