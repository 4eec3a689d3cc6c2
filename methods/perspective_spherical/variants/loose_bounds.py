"""Bounds of azimuth and elevation that lose shadows: of the vertices instead of great arcs; to show how many."""

import warp as wp

from ..light.mapping import box_of
from ..light.sphere import angles, wrapped


@wp.func
def vertex_bounds(a: wp.vec3d, b: wp.vec3d, c: wp.vec3d, pad: wp.float64) -> wp.vec4d:
    """Azimuth and elevation of the three vertices as they are: wrong across the seam, at poles and for large arcs."""
    pa = angles(a)
    pb = angles(b)
    pc = angles(c)
    return box_of(wp.vec3d(pa[0], pb[0], pc[0]), wp.vec3d(pa[1], pb[1], pc[1]), pad)


@wp.func
def seam_bounds(a: wp.vec3d, b: wp.vec3d, c: wp.vec3d, pad: wp.float64) -> wp.vec4d:
    """The same with azimuths unwrapped from vertex to vertex: wrong at poles and for large arcs."""
    pa = angles(a)
    pb = angles(b)
    pc = angles(c)
    second = pa[0] + wrapped(pb[0] - pa[0])
    third = second + wrapped(pc[0] - pb[0])
    return box_of(wp.vec3d(pa[0], second, third), wp.vec3d(pa[1], pb[1], pc[1]), pad)
