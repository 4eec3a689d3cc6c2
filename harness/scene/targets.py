"""Targets: the points of a light that shadow rays are traced to. A point light has one, a light with an area several.

A method sees targets, as many point lights; the share of them that a surface sees is its share of the light's area. They
are the first points of a scrambled Sobol sequence, so that a light's first 2^k targets are as even as 2^k points can be. The
seed is the light's place in the scene: all methods, the reference and the judge get the same targets, in each frame.
"""

import functools
import itertools
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..arrays import F64
from ..errors import UserError
from .scene import FARTHEST, Light, Vector

SHAPE, SAMPLES = "sphere", 16  # shape and number of targets of a light of which only the size is given


def with_area(light: Light, shape: str | None, size: float | None, samples: int | None) -> Light:
    """A light with another area; what is None stays as it is. Raises :class:`UserError` for an area that it cannot have."""
    if shape is None and size is None and samples is None:
        return light
    options = "--light-size, --light-samples, --light-shape"
    if size is None and not light.shape:
        raise UserError(f"{options}: a light at {light.position} is a point; give its --light-size")
    if size is not None and FARTHEST < size < np.inf:
        raise UserError(f"{options}: size {size:g} is outside the range of float32")
    try:
        return replace(
            light,
            shape=shape if shape is not None else light.shape or SHAPE,
            size=light.size if size is None else size,
            samples=samples if samples is not None else light.samples if light.shape else SAMPLES,
        )
    except ValueError as error:
        raise UserError(f"{options}: {error}") from error


def per_target(lights: Sequence[Light]) -> tuple[Light, ...]:
    """A point light for each target, all at the middle of their light, each with an equal part of its intensity."""
    return tuple(
        one if one.samples == 1 else replace(one, intensity=one.intensity / one.samples, shape="", size=0.0, samples=1)
        for one in lights
        for _ in range(one.samples)
    )


def numbers_of(lights: Sequence[Light]) -> list[range]:
    """For each light the numbers of its targets, by which methods know them as lights."""
    ends = itertools.accumulate((light.samples for light in lights), initial=0)
    return [range(first, end) for first, end in itertools.pairwise(ends)]


def targets_of(lights: Sequence[Light], middle: F64, up: Vector) -> tuple[Light, ...]:
    """The targets of lights, as point lights in their places, those of one light in a row.

    middle  float64 [3], what areas face by default      up  what the height of a rectangle is measured along
    """
    places = [place for seed, light in enumerate(lights) for place in target_places(light, seed, middle, up)]
    return tuple(one.moved(place) for one, place in zip(per_target(lights), places, strict=True))


def target_places(light: Light, seed: int, middle: F64, up: Vector) -> list[Vector]:
    """The positions of a light's targets; a single one is in the middle of its area."""
    if light.samples == 1:
        return [light.position]
    u, v = unit_points(light.samples, seed).T
    width, height = light.extent
    if light.shape == "sphere":
        z, angle = 1.0 - 2.0 * u, 2.0 * np.pi * v
        ring = np.sqrt(1.0 - z * z)
        offsets = np.stack([ring * np.cos(angle), ring * np.sin(angle), z], axis=1) * (width / 2)
    else:
        x, y = u - 0.5, v - 0.5
        if light.shape == "disc":
            ring, angle = np.sqrt(u) / 2, 2.0 * np.pi * v
            x, y = ring * np.cos(angle), ring * np.sin(angle)
        right, top = plane_axes(light, middle, up)
        offsets = x[:, None] * (width * right) + y[:, None] * (height * top)
    return [(x, y, z) for x, y, z in (np.asarray(light.position) + offsets).tolist()]


def plane_axes(light: Light, middle: F64, up: Vector) -> tuple[F64, F64]:
    """The unit vectors along the width and the height of a rectangle or a disc."""
    normal = middle - light.position if light.towards is None else np.asarray(light.towards, dtype=np.float64)
    size = np.abs(normal).max()
    normal = np.asarray(up, dtype=np.float64) if not 0.0 < size < np.inf else normal / size
    upwards = up if light.across is None else np.cross(light.across, normal)
    right = np.cross(normal, upwards)
    if np.linalg.norm(right) <= 1e-9 * np.linalg.norm(upwards) * np.linalg.norm(normal):
        right = np.cross(normal, np.eye(3)[np.abs(normal).argmin()])
    top = np.cross(right, normal)
    return right / np.linalg.norm(right), top / np.linalg.norm(top)


@functools.lru_cache(maxsize=64)
def unit_points(count: int, seed: int) -> F64:
    """The first points of a scrambled Sobol sequence in the unit square, float64 [count, 2]. Not to be written to."""
    from scipy.stats import qmc  # slow to import, and only areas need it

    points: F64 = qmc.Sobol(2, scramble=True, seed=np.random.default_rng(seed)).random_base2((count - 1).bit_length())
    points = points[:count]
    points.flags.writeable = False
    return points
