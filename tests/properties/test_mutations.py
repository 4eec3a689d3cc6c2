"""Errors that ray tracers really have, planted one at a time in the real kernels, such as ``ray_queries.py``: a named
hard case catches each.

A function's source is changed by one substitution and put in its place; only the modules that use it are compiled
anew. The same case must pass before and after, so that the case, not the planting, is what shows the error.
"""

import inspect
import sys
import types
from dataclasses import dataclass
from pathlib import Path

import pytest
import warp as wp
from helpers.judged_hard_cases import judged
from shadowbench.harness.frame import session
from shadowbench.harness.frame.registry import make_method
from shadowbench.harness.hardcases.judge import judge_case
from shadowbench.methods import warp_bvh
from shadowbench.methods.common import bounds, box_tree
from shadowbench.methods.exact import hit_point, ray_queries, segment, triangle
from shadowbench.methods.grids import build as grid_build
from shadowbench.methods.grids import grid
from shadowbench.methods.perspective_spherical.camera import tiles as camera_grid
from shadowbench.methods.perspective_spherical.light import bounds as light_bounds
from shadowbench.methods.perspective_spherical.light import rays as light_rays
from shadowbench.methods.perspective_spherical.light import sphere
from shadowbench.methods.rays import kernels as ray_kernels
from shadowbench.methods.streams import eight
from shadowbench.methods.streams.camera import pixels as camera_pixels
from shadowbench.methods.streams.cube import footprint
from shadowbench.methods.streams.occlusion import on_cpu as light_on_cpu
from shadowbench.methods.streams.occlusion import stream as light_stream
from shadowbench.methods.streams.rays import region as light_region

PACKAGE = "shadowbench.methods."


@dataclass(frozen=True)
class Planted:
    """``function`` of ``home`` with ``old`` -> ``new`` in its source takes its place in ``user``; None: at home."""

    home: types.ModuleType
    function: str
    changes: tuple[tuple[str, str], ...]
    user: types.ModuleType | None = None


@dataclass(frozen=True)
class Mutation:
    """An error of a name, the cases that catch it in a method, and where it is planted."""

    name: str
    cases: tuple[str, ...]
    planted: tuple[Planted, ...]
    method: str = "warp_bvh"
    settings: tuple[tuple[str, str], ...] = (("update", "bvh_rebuild"),)


OWN_TRIANGLE = """    if wp.abs(side_h) <= own + rounding * total(ha):
        return False
"""

MAPS = (("clamp", "none"), ("aimed", "false"))

MUTATIONS = (
    Mutation(
        "naive vertex bounds on the sphere", ("S05z",),
        (Planted(sphere, "triangle_angles",
                 (*((f"    bounds = arc_elevation(bounds, {edge})\n", "") for edge in ("a, b, na", "b, c, nb", "c, a, nc")),
                  ("if reaches >= HALF_PI:", "if False:")), light_bounds),),
        "perspective_spherical", (*MAPS, ("light_tiles", "512")),
    ),
    Mutation(
        "no seam: azimuths are not unwrapped", ("S02z",),
        (Planted(sphere, "triangle_angles",
                 (("wrapped(pb[0] - pa[0])", "pb[0] - pa[0]"), ("wrapped(pc[0] - pb[0])", "pc[0] - pb[0]"),
                  ("    bounds = arc", "    pole = wp.bool(False)\n    bounds = arc"),
                  ("    if pole:", "    if False:")), light_bounds),),
        "perspective_spherical", MAPS,
    ),
    Mutation(
        "an unpadded box", ("P07", "P24"),
        (Planted(bounds, "boxes_kernel",
                 (("(units * U32)", "0.0"), ("wp.vec3f(1.0e-37, 1.0e-37, 1.0e-37)", "wp.vec3f(0.0, 0.0, 0.0)"))),),
    ),
    Mutation(
        "a fixed determinant epsilon", ("V ball x1e-06", "P16"),
        (Planted(triangle, "hit_distance", (("NORMAL_UNITS * sum_of_sizes(products, d64)", "wp.float64(1e-7)"),),
                 ray_queries),),
    ),
    Mutation(
        "a light traced from its far end", ("S10 1e+07",),
        (Planted(box_tree, "walk",
                 (("    limit = result.limit\n    tests",
                   "    if part.end == wp.float64(1.0):\n        part.start = part.start + part.direction\n"
                   "        part.direction = -part.direction\n        result = nothing_found(1.0 - 1.0e-4)\n"
                   "    limit = result.limit\n    tests"),), warp_bvh),),
    ),
    Mutation(
        "no rule for the own triangle", ("S12",),
        (Planted(segment, "plane_crosses_segment", ((OWN_TRIANGLE, ""),)),
         Planted(ray_queries, "any_hit", (("if i == segment.own:", "if i < 0:"),), ray_kernels)),
    ),
    Mutation(
        "edges decided in float32", ("P29", "P29b"),
        (Planted(triangle, "hit_distance",
                 (("    if low < wp.float64(0.0):",
                   "    if not inside32(ray.origin, ray.direction, corners.a, corners.b, corners.c):\n"
                   "        return NO_HIT\n    if low > wp.float64(1.0e300):"),), ray_queries),),
    ),
    Mutation(
        "flat hit points off by their rounding, and along by the angle", ("S35",),
        (Planted(hit_point, "is_flat", (("slope > 0.125", "slope > 0.0"),)),),
    ),
    Mutation(
        "t of a hit at the eye by its sign alone", ("P34 vertex 2",),
        (Planted(triangle, "hit_distance", (("NORMAL_UNITS * sum_of_sizes(products, away)", "wp.float64(-1.0)"),),
                 ray_queries),),
    ),
    Mutation(
        "t of a hit bounded by the largest coordinate", ("V mixed 0", "V mixed 2", "V mixed 3"),
        (Planted(triangle, "hit_distance", (("sum_of_sizes(products, away)", "largest(e1) * largest(e2) * total(away)"),),
                 ray_queries),),
    ),
    Mutation(
        "all that is outside by 2^-30 of the sum is inside", ("V mixed 11", "V mixed 13", "V mixed 36", "V mixed 42"),
        (Planted(triangle, "hit_distance", (("low < -edge", "low + wp.float64(1.0e99) < -edge"),), ray_queries),),
    ),
    Mutation(
        "doubt at an edge is outside", ("P29", "P29b"),
        (Planted(triangle, "hit_distance", (("-CLOSED", "wp.float64(0.0)"),), ray_queries),),
    ),
    Mutation(
        "cells of the uniform grid do not overlap", ("P33",),
        (Planted(grid, "place_grid_kernel",
                 (("wp.min(FINEST_SLACK + ROUNDING * (distance + largest(count)), COARSEST_SLACK)", "wp.float64(0.0)"),),
                 grid_build),),
        "uniform_grid", (("density", "700.0"),),
    ),
    Mutation(
        "tiles of the image without a pad", ("P31 1e+06",),
        (Planted(camera_grid, "slices_in_tile", (("4.0e-6 * (1.0 + wp.max(tx, ty))", "0.0 * tx"),)),
         Planted(camera_grid, "screen_triangle",
                 (("16.0 * U32 * reach\n", "0.0 * reach\n"),
                  ("(32.0 * U32 * reach * edge + 6.0 * reach * slack) + FLOOR32", "(0.0 * reach * edge)")))),
        "perspective_spherical", (("tile", "1"), ("slices", "3"), ("depth_lists", "spans")),
    ),
    Mutation(
        "bounds in the light's map without a pad", ("S32",),
        (Planted(light_rays, "aim_kernel",
                 (("pads[0] = pad\n", "pads[0] = wp.float64(0.0) * pad\n"),
                  ("pads[0] = wp.max(FINEST, wp.float64(2.0) * pad * reach / distance)", "pads[0] = wp.float64(0.0)"))),),
        "perspective_spherical",
        (("light_tiles", "16"), ("light_slices", "3"), ("aimed", "false"), ("precision", "float32")),
    ),
    Mutation(
        "signs of the camera's planes without a bound", ("P29b",),
        (Planted(camera_pixels, "sign_bound",
                 (("24.0 * U32 * 1.7321 * (1.0001 + tangents[0] + tangents[1])", "0.0 * tangents[0]"),)),),
        "ray_grids", (),
    ),
    Mutation(
        "cells of the light without a pad", ("S34", "S34b"),
        (Planted(footprint, "on_bins",
                 (("32.0 * U32 * ((1.0 + widest) * extent * nearness + widest) * wp.max(per_u, per_v) + BIN_SLACK", "0.0"),),
                 light_stream),
         Planted(eight, "boxes_of_eight", (("unit * ((1.0f + wide) * extent / near + wide) * span + w.slack", "0.0f"),),
                 light_on_cpu)),
        "ray_grids", (("trial", "region=rays"),),
    ),
    Mutation(
        "hit points of flat rays from the camera's words", ("P51 2^-42",),
        (Planted(camera_pixels, "edge_planes", (("    planes.steep = ", "    planes.steep = True or "),)),),
        "ray_grids", (("trial", "region=rays"),),
    ),
    Mutation(
        "a light's region that ends before its rays", ("P24",),
        (Planted(light_region, "rectangle_of",
                 (("vec4f(least_u - pad", "vec4f(least_u + 0.3 * (most_u - least_u)"),)),),
        "ray_grids", (("trial", "region=triangles"),),
    ),
)  # fmt: skip

INSIDE32 = '''
@wp.func
def inside32(o: wp.vec3f, d: wp.vec3f, a: wp.vec3f, b: wp.vec3f, c: wp.vec3f) -> wp.bool:
    """Moller and Trumbore in float32."""
    p = wp.cross(d, c - a)
    det = wp.dot(b - a, p)
    u = wp.dot(o - a, p) / det
    v = wp.dot(d, wp.cross(o - a, b - a)) / det
    return u >= 0.0 and v >= 0.0 and u + v <= 1.0

'''


def plant(planted: Planted, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    user, function = planted.user or planted.home, planted.function
    source = inspect.getsource(getattr(planted.home, function).func)
    for old, new in planted.changes:
        assert old in source, f"{function} no longer says {old!r}: plant the error anew"
        source = source.replace(old, new)
    path = folder / f"{function}.py"
    path.write_text((INSIDE32 if "inside32" in source else "") + source)
    # The same names as at home, in a module of its own: Warp compiles a changed kernel apart from the real ones.
    names = {**vars(planted.home), **vars(user), "__name__": f"planted_{folder.name}_{function}"}
    monkeypatch.setitem(sys.modules, names["__name__"], types.ModuleType(names["__name__"]))
    exec(compile(path.read_text(), str(path), "exec"), names)
    monkeypatch.setattr(user, function, names[function])


def rebuild() -> None:
    """Let Warp look at the methods' functions again; what has not changed comes from its cache."""
    for name, module in list(sys.modules.items()):
        if name.startswith(PACKAGE):
            wp.get_module(name).mark_modified()
            for factory in vars(module).values():
                if hasattr(factory, "cache_clear"):  # factories of specialised kernels keep what they made
                    factory.cache_clear()


def wrong_cases(mutation: Mutation, device: str) -> list[str]:
    """The mutation's cases on which the method errs. What is exact is worked out on the first call, with nothing planted."""
    wrong = []
    for name in mutation.cases:
        finding = judge_case(judged(name), make_method(mutation.method, dict(mutation.settings)), device)
        assert "failed" not in finding.classes, finding.reason
        if set(finding.classes) - {"tie"}:  # what rounding would excuse in others: ours have none
            wrong.append(name)
    return wrong


@pytest.mark.parametrize("mutation", MUTATIONS, ids=lambda mutation: mutation.name.replace(" ", "-"))
def test_a_named_case_catches_it(
    mutation: Mutation, tmp_path: Path, device: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In the kernels of ordinary frames, however unlike the sizes in a case are."""
    monkeypatch.setattr(session, "is_wide", lambda *_: False)
    assert wrong_cases(mutation, device) == [], "the method as it is must pass"
    with pytest.MonkeyPatch.context() as patch:
        for planted in mutation.planted:
            plant(planted, tmp_path, patch)
        rebuild()
        caught = wrong_cases(mutation, device)
    rebuild()
    assert caught == list(mutation.cases)
    assert wrong_cases(mutation, device) == [], "the error must be gone again"
