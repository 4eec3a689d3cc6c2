"""Hard cases: small named scenes on which ray tracers are known to give wrong answers.

A :class:`.case.HardCase` constructs the scene. The exact referee computes the expected answer; cases whose answer can be
derived by hand also state it. ``shadowbench check METHOD`` runs all cases.
"""

from __future__ import annotations

from ..errors import UserError, did_you_mean
from . import (
    areas,
    closed,
    contact,
    extremes,
    eyes,
    found,
    holes,
    images,
    light_angles,
    light_places,
    meshes,
    mirrors,
    parallel,
    reported,
    structures,
    unlike,
    variants,
)
from .case import Counts, HardCase, Trial

__all__ = ["Counts", "HardCase", "Trial", "all_cases", "find_case"]


def all_cases(large: bool = False) -> tuple[HardCase, ...]:
    """Areas (A), holes (H), mirrors (M), orthographic cameras (O), shadows (S), eyes and meshes (P), then the
    variants of scale, offset and distance (V).

    Those that take long (:attr:`.case.HardCase.large`) only with ``large``.
    """
    single = (
        *areas.CASES,
        *closed.CASES,
        *contact.CASES,
        *light_angles.CASES,
        *light_places.CASES,
        *eyes.CASES,
        *found.CASES,
        *images.CASES,
        *meshes.CASES,
        *holes.CASES,
        *mirrors.CASES,
        *parallel.CASES,
        *reported.CASES,
        *structures.CASES,
        *unlike.CASES,
    )
    ordered = sorted(single, key=lambda case: (case.name[0] == "P", case.name))
    return tuple(case for case in (*ordered, *variants.CASES, *extremes.CASES) if large or not case.large)


def find_case(name: str) -> HardCase:
    """A case by its name. Raises :class:`UserError` for an unknown one."""
    known = {case.name: case for case in all_cases(large=True)}
    if name not in known:
        raise UserError(f"no hard case {name!r}{did_you_mean(name, known)}")
    return known[name]
