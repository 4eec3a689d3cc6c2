"""Vector functions for the kernels of the harness and of the methods: casts, largest coordinate, sum."""

import warp as wp


@wp.func
def to_float64(a: wp.vec3f) -> wp.vec3d:
    return wp.vec3d(wp.float64(a[0]), wp.float64(a[1]), wp.float64(a[2]))


@wp.func
def to_float32(a: wp.vec3d) -> wp.vec3f:
    return wp.vec3f(wp.float32(a[0]), wp.float32(a[1]), wp.float32(a[2]))


@wp.func
def largest(a: wp.vec3f) -> wp.float32:
    return wp.max(wp.abs(a[0]), wp.max(wp.abs(a[1]), wp.abs(a[2])))


@wp.func
def largest(a: wp.vec3d) -> wp.float64:
    return wp.max(wp.abs(a[0]), wp.max(wp.abs(a[1]), wp.abs(a[2])))


@wp.func
def total(a: wp.vec3f) -> wp.float32:
    return wp.abs(a[0]) + wp.abs(a[1]) + wp.abs(a[2])


@wp.func
def total(a: wp.vec3d) -> wp.float64:
    return wp.abs(a[0]) + wp.abs(a[1]) + wp.abs(a[2])
