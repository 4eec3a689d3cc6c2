"""The parameters of the ladder: each changes alone how accurate, or how fast, the same tree is."""

from dataclasses import dataclass

from ..common import bounds
from ..common.parameters import check_choices

PADDED_UNITS = {"none": 0.0, "3_ulp": 6.0, "rounding": bounds.PADDED_UNITS}
"""Units of 2^-24 of the largest coordinate of scene and eye."""

TEST_ERRORS = {
    "moller_trumbore": "a float32 triangle test that is not watertight",
    "moller_trumbore_epsilon": "a float32 triangle test with a fixed smallest determinant",
    "woop": "a float32 triangle test (watertight, but its signs are rounded)",
    "woop_float64": "a float32 triangle test (watertight, undecided signs in float64)",
    "edge_planes": "a float32 triangle test (watertight, but its signs are rounded)",
}
ORIGIN_ERRORS = {
    "identity": "shadow rays from the rounded barycentric point, only their own triangle skipped",
    "barycentric": "shadow rays from the rounded barycentric point, nothing skipped",
    "ray": "shadow rays from o + t d in float32, nothing skipped",
    "epsilon_1e-2": "shadow rays moved off by 1e-2 of the scene's radius",
    "epsilon_1e-4": "shadow rays moved off by 1e-4 of the scene's radius",
    "epsilon_1e-6": "shadow rays moved off by 1e-6 of the scene's radius",
    "wachter_binder": "shadow rays moved off by fixed steps of integer and float",
    "error_bound": "shadow rays moved off by a bound on their rounding",
}
PADDING_ERRORS = {
    "none": "boxes that are not padded",
    "3_ulp": "boxes padded by less than the slab test may be wrong by",
}
EXACT_TESTS = ("float64", "exact")
TESTS = (*TEST_ERRORS, *EXACT_TESTS)
SHEARED_TESTS = ("woop", "woop_float64")
ORIGINS = ("hit_point", *ORIGIN_ERRORS)


@dataclass(frozen=True)
class Build:
    """How the tree is made and the kernels compiled.

    padding    by how much boxes are larger than their triangles: "none", as in most engines; "3_ulp": 3 ulp of the
               largest coordinate, as is commonly advised; "rounding": a bound on the rounding of Warp's slab test, as in
               the exact tree
    leaf_size  triangles per leaf
    fast_math  whether the compiler may reorder, contract and approximate float arithmetic
    """

    padding: str = "rounding"
    leaf_size: int = 1
    fast_math: bool = False

    def __post_init__(self) -> None:
        check_choices(self, padding=PADDED_UNITS)
        if self.leaf_size < 1:
            raise ValueError("leaf_size must be 1 or more")


@dataclass(frozen=True)
class Trace:
    """How rays are tested.

    test    triangle test of primary and shadow rays: "moller_trumbore" (Moeller & Trumbore 1997, float32,
            det != 0), "moller_trumbore_epsilon" (the textbook's |det| > 1e-7), "woop" (Woop, Benthin & Wald 2013,
            float32), "woop_float64" (the same, an edge function of zero decided in float64, as published),
            "edge_planes" (float32, edges in weld order), "float64" (every candidate), "exact" (float32 rejects,
            float64 decides)
    origin  where shadow rays start and which triangles they skip: "hit_point" (the float64 hit point; skips its own triangle
            and, where the test is float64, all that contain the point), "identity" (the float32 barycentric point,
            own triangle skipped), "barycentric" (that point, nothing skipped), "ray" (o + t d in float32, nothing
            skipped), "epsilon_1e-2", "epsilon_1e-4", "epsilon_1e-6" (the barycentric point moved that share of
            the scene's radius along the normal), "wachter_binder" (Ray Tracing Gems, chapter 6), "error_bound"
            (moved by a bound on the rounding, Pharr, Jakob & Humphreys 2023, section 6.8)
    """

    test: str = "exact"
    origin: str = "hit_point"

    def __post_init__(self) -> None:
        check_choices(self, test=TESTS, origin=ORIGINS)


def known_inexact(build: Build, trace: Trace) -> str | None:
    """Why these settings may be wrong, or None where they are exact."""
    reasons = [TEST_ERRORS.get(trace.test), ORIGIN_ERRORS.get(trace.origin), PADDING_ERRORS.get(build.padding)]
    if build.fast_math:
        reasons.append("float arithmetic that the compiler may change")
    return "; ".join(reason for reason in reasons if reason) or None
