"""The cost of accuracy: one safety measure at a time, the sensible combinations, and the shadow maps of engines.

One plain tree (``accuracy_ladder``) has the parameters that any tracer has, so that nothing else changes between two
points: triangle test, start of the shadow rays, padding of boxes, float arithmetic. The paper's grids have parameters of
their own: bounds of a triangle on the light's sphere, the light's frame, culling. Beside them stand the methods as people
use them, and shadow maps from 512 texels upward. Labels read "family: level"; a family has one colour.
"""

from pathlib import Path

from ...harness.report import document
from ...harness.runner.planning.experiment import Entry, Experiment
from ...harness.runner.planning.planned_point import Options
from ...harness.runner.planning.time_estimate import expected_triangles
from ...harness.runner.progress import Silent
from .._paper import REAL, SCENES, large, small
from . import drawing, untimed

QUICK_SCENES = (*(REAL or ("sibenik",)), "conference")


def _tree(label: str, **settings: str) -> Entry:
    return Entry("accuracy_ladder", settings, label)


EXACT = "exact tree: every measure"
LADDER = (  # one parameter at a time away from the exact tree; then all of them in float32, with care and without
    _tree(EXACT),
    _tree("triangle test: Möller-Trumbore", test="moller_trumbore"),
    _tree("triangle test: M.-T., det > 1e-7", test="moller_trumbore_epsilon"),
    _tree("triangle test: Woop", test="woop"),
    _tree("triangle test: Woop, zeros in float64", test="woop_float64"),
    _tree("triangle test: edge planes", test="edge_planes"),
    _tree("triangle test: float64", test="float64"),
    _tree("shadow origin: own triangle skipped", origin="identity"),
    _tree("shadow origin: barycentric, as it is", origin="barycentric"),
    _tree("shadow origin: o + t d, as it is", origin="ray"),
    _tree("shadow origin: 1e-2 radii", origin="epsilon_1e-2"),
    _tree("shadow origin: 1e-4 radii", origin="epsilon_1e-4"),
    _tree("shadow origin: 1e-6 radii", origin="epsilon_1e-6"),
    _tree("shadow origin: Wächter-Binder", origin="wachter_binder"),
    _tree("shadow origin: error bound", origin="error_bound"),
    _tree("tree: boxes not padded", padding="none"),
    _tree("tree: boxes padded by 3 ulp", padding="3_ulp"),
    _tree("tree: fast math", fast_math="true"),
    _tree(
        "tree: all of it float32, careful", test="woop_float64", origin="error_bound", padding="rounding"
    ),
    _tree(
        "tree: all of it float32, careless", test="moller_trumbore_epsilon", origin="epsilon_1e-4", padding="none",
        fast_math="true",
    ),
)  # fmt: skip

GRIDS = "as used: perspective and spherical grids"


def _grids(label: str, **settings: str) -> Entry:
    return Entry("perspective_spherical", settings, f"in the grids: {label}")


IN_GRIDS = (
    _grids("edge planes in float32", triangle_test="edge_planes"),
    _grids("Möller-Trumbore", triangle_test="moller_trumbore"),
    _grids("vertex bounds", light_bounds="vertices"),
    _grids("vertex bounds, seam heeded", light_bounds="seam"),
    _grids("light frame of the world", aimed="false"),
    _grids("light frame in float32", precision="float32"),
    _grids("light frame in float32, centred", precision="float32-centred"),
    _grids("back faces culled", cull="primary"),
    _grids("back faces culled, lights too", cull="primary+light"),
)
"""One parameter at a time away from the grids as they are. Scenes that are not declared closed refuse culling."""

PEERS = (
    Entry("perspective_spherical", {}, GRIDS),
    Entry("ray_grids", {}, "as used: ray grids"),
    Entry("uniform_grid", {}, "as used: uniform grid"),
    Entry("warp_bvh", {}, "as used: Warp mesh"),
    Entry("embree", {"threads": "1"}, "Embree: robust, 1 thread"),
    Entry("embree", {"threads": "1", "robust": "false"}, "Embree: fast, 1 thread"),
)


def _map(size: int, bias: str = "slope", filter: str = "nearest") -> Entry:
    text = f"shadow map: {size}" + (f" {bias}" if bias != "slope" else "") + (" PCF" if filter == "pcf" else "")
    return Entry("shadow_map", {"size": str(size), "bias": bias, "filter": filter}, text)


MAPS = (_map(512), _map(1024), _map(2048), _map(4096))
WAYS = tuple(_map(2048, bias) for bias in ("none", "constant", "normal")) + (_map(2048, filter="pcf"),)
LARGE = (_map(8192), _map(8192, "normal"), _map(4096, "normal"), _map(8192, filter="pcf"))

MEASURES = (  # safety measures of the exact tree: name, the point with it, and the otherwise equal point without it
    ("float64 decides triangle tests", EXACT, "triangle test: Möller-Trumbore"),
    ("float64 hit point, its planes excluded", EXACT, "shadow origin: own triangle skipped"),
    ("padded boxes", EXACT, "tree: boxes not padded"),
    ("strict float arithmetic", EXACT, "tree: fast math"),
)

OTHER_MEASURES = (
    ("robust Embree", "Embree: robust, 1 thread", "Embree: fast, 1 thread"),
    ("float64 decides, in the grids", GRIDS, "in the grids: Möller-Trumbore"),
    ("bounds of great arcs, in the grids", GRIDS, "in the grids: vertex bounds, seam heeded"),
    ("bounds of arcs and seam, in the grids", GRIDS, "in the grids: vertex bounds"),
    ("float64 light frame, in the grids", GRIDS, "in the grids: light frame in float32"),
    ("aimed light frame, in the grids", GRIDS, "in the grids: light frame of the world"),
    ("back faces kept, in the grids", GRIDS, "in the grids: back faces culled"),
)

SHOWN = (  # points whose wrong pixels are shown, where they were run
    "shadow map: 512", "shadow map: 2048", "shadow map: 2048 none", "shadow origin: 1e-2 radii",
    "shadow origin: barycentric, as it is", "in the grids: vertex bounds",
)  # fmt: skip

GRID = (
    _tree("float64 hit point (ours)"),
    _tree("error bound", origin="error_bound"),
    _tree("Wächter-Binder", origin="wachter_binder"),
    _tree("own triangle skipped", origin="identity"),
    _tree("1e-4 radii", origin="epsilon_1e-4"),
    _tree("1e-6 radii", origin="epsilon_1e-6"),
    Entry("perspective_spherical", {}, "grids (ours)"),
    Entry("perspective_spherical", {"light_bounds": "vertices"}, "grids, vertex bounds"),
    Entry("embree", {}, "Embree, robust"),
    Entry("shadow_map", {"size": "1024"}, "shadow map, 1024"),
)
HARD = (*LADDER, *IN_GRIDS, *PEERS[3:])  # on the hard cases too; shadow maps are approximate
VARIANTS = "V "  # prefixes of the names of cases that are scaled and moved copies; the quick preset leaves them out

LONG = ("P17", "P29", "P31", "S16", "S19c", "S31", "S35")
"""Prefixes of cases for which the judge takes a second or more per point: many rays, or many exactly through vertices.
The quick preset leaves them out too.
"""

OF_EFFECTS = ("H", "M")  # prefixes of cases with holes and mirrors: most points support opaque scenes only

DISTANCES = (1e-4, 1e-1, 1.5, 1e1, 1e3, 1e5, 1e7)
OFFSETS = (0.0, 1e1, 1e3, 1e5)
TELLING = ("P29c", "P29d", "P29e", "P31 1e+07", "S31 1000")
"""Cases that the quick preset would leave out, but that are cheap and in which most of the inexact points are wrong."""
GRID_SIZE = {"quick": 48, "paper": 128}

CELL_S, CELL_TRIANGLE_S = 0.07, 1e-6  # seconds of a method in a cell of the grid at 48x48 pixels, and for each triangle
FAR_TRIANGLE_S = 1.2e-4  # more at the largest offset, where float32 tells few triangles apart: the referee decides
HARD_S = 10.0  # seconds of a point on the hard cases of the quick preset

HARD_CASES = "hard-cases"


def after(options: Options, report: Silent) -> None:
    """Untimed: errors over light distance and scene offset on the run's first scene, and, asked for with ``--with``, errors
    on the hard cases. Both are stored as CSV and not made again while they are there.
    """
    untimed.keep_grid(options, report, GRID, DISTANCES, OFFSETS, GRID_SIZE.get(options.preset_name, 48))
    if HARD_CASES in options.extras:
        quick = options.preset_name == "quick"
        left_out = (*OF_EFFECTS, VARIANTS, *LONG) if quick else OF_EFFECTS
        untimed.keep_hard(options, report, HARD, left_out, TELLING)


def after_s(options: Options) -> float:
    """Seconds of :func:`after` on two cores, roughly."""
    seconds = 0.0
    if not untimed.kept(options):
        triangles = expected_triangles(options.preset.scenes[0])
        cells = len(GRID) * len(DISTANCES)
        seconds += cells * (len(OFFSETS) * (CELL_S + CELL_TRIANGLE_S * triangles) + FAR_TRIANGLE_S * triangles)
    if HARD_CASES in options.extras and not (options.out / untimed.HARD).exists():
        seconds += len(HARD) * HARD_S
    return seconds


def draw(folder: Path, quiet: bool = False) -> list[Path]:
    """The Pareto frontier, the costs of measures, wrong pixels and the grid of errors; costs as CSV too."""
    table, hard = drawing.read(folder), untimed.read_hard(folder)
    cost = drawing.costs(folder, [*MEASURES, *OTHER_MEASURES])
    files = [
        document.write_csv(cost, folder / "accuracy_costs.csv", list(cost)),
        drawing.draw_frontier(table, folder / "accuracy_pareto.svg"),
        drawing.draw_costs(cost, EXACT, folder / "accuracy_costs.svg"),
        *drawing.draw_where(folder, table, SHOWN),
        drawing.draw_heat(folder),
    ]
    shown = {drawing.COST: drawing.cost_table(cost, hard)}
    sampled = int((drawing.usable(table).reindex(columns=["primary.unjudged"]) > 0).sum().iloc[0])
    told, notes = (
        drawing.finding(table, cost),
        [drawing.SAMPLED.format(sampled) * bool(sampled), *untimed.described(hard)],
    )
    return document.write(folder, EXPERIMENT, table, drawing.COLUMNS, told, shown, files, quiet, notes)


ALL = LADDER + PEERS + IN_GRIDS + MAPS + WAYS

EXPERIMENT = Experiment(
    "accuracy", "What accuracy costs in time",
    {
        "quick": small(256, QUICK_SCENES, ALL, 6.0, frames=3, rounds=2, timeout_s=180.0, wrong_maps=True),
        "paper": large((*SCENES, *REAL), ALL + LARGE, wrong_maps=True),
    },
    draw, after, after_s, {HARD_CASES: "errors of every point on the hard cases"},
)  # fmt: skip
