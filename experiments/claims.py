"""The paper's claims one by one, judged from the records of the other experiments. It measures nothing itself.

``shadowbench show claims DIR`` reads every results folder in DIR. Thresholds stand with each claim in ``_judges``: a
comparison of times that differ by less than 3 % is left open. A ratio is taken within one run.
"""

from __future__ import annotations

from pathlib import Path

from ..harness.report import claims
from ..harness.report.claims import Claim
from ..harness.runner.experiment import Experiment
from . import _judges as judge

CLAIMS = (
    Claim(
        "Interactive rates (below 200 ms per frame here) on moderately large models",
        "1, 5",
        ("figure10",),
        judge.interactive,
    ),
    Claim("Indirect mapping makes Buddha 30-50 % faster", "3", ("figure2",), judge.indirect_speed),
    Claim(
        "... because the most triangles checked for a pixel drop by more than half",
        "3",
        ("figure2",),
        judge.indirect_most,
        counted=True,
    ),
    Claim("2x2 sorting tiles in a tracing tile are best", "3", ("ablation",), judge.two_by_two),
    Claim("Building the grid is cheap against tracing", "1, 3", ("figure10",), judge.build_cheap),
    Claim("Culling back faces makes lists shorter and the build faster", "3", ("ablation",), judge.culling),
    Claim(
        "Rearranging the shadow rays takes about the same time for all models",
        "5",
        ("figure10",),
        judge.rearrangement,
    ),
    Claim("... and depends on the resolution", "5", ("figure10",), judge.resolution),
    Claim(
        "Shadow traversal is almost always slower than primary traversal",
        "5",
        ("figure10",),
        judge.shadow_slower,
    ),
    Claim("Load balancing compensates for the light's position", "5", ("figure11",), judge.balancing),
    Claim("A spherical map is better than a cube map", "4.1", ("ablation",), judge.spherical),
    Claim("Clamping the light's rectangle to the view helps", "4.1", ("ablation",), judge.clamping),
    Claim(
        "Large triangles hurt grids more than trees (20 % at least)",
        "5",
        ("ablation", "frame_time", "table1"),
        judge.large_triangles,
    ),
    Claim(
        "Far faster (1.5 times at least) than a grid on Conference and Sibenik, slightly on Fairy",
        "5",
        ("frame_time", "table1"),
        judge.architecture,
    ),
    Claim("Two lights on Fairy: faster than a tree built each frame", "5", ("two_lights",), judge.two_lights),
    Claim("Sorting costs less the fewer bits the key has; 18 here", "5", ("key_bits",), judge.key_bits),
    Claim(
        "Where the SIMD width is large, a tree does no better than a grid on reflected rays",
        "6",
        ("reflection",),
        judge.reflected,
    ),
    Claim("Smaller cells win where sorting is fast", "6", ("ablation",), judge.small_cells),
    Claim(
        "Ours: ray grids take less time than the fastest exact rival that is rebuilt each frame, on every scene",
        "-",
        ("frame_time",),
        judge.against_rivals,
    ),
)


def draw(folder: Path, quiet: bool = False) -> list[Path]:
    """Every claim with its verdict and numbers, as markdown and CSV."""
    return claims.draw(folder, quiet, CLAIMS)


EXPERIMENT = Experiment(name="claims", title="The paper's claims, one by one", presets={}, draw=draw)
