"""The time of a sort by the number of bits of its keys, at equal numbers of pairs: the sort that builds the paper's
grids.

The paper (section 5): sorting is fast because a cell's number has fewer than 32 bits, 18 in its case. As many pairs as
pixels, as its shadow rays are; in the paper preset also four times as many, so that the cost of launching does not
matter. A trial is a frame of two passes: the unsorted pairs are copied in, and sorted. So
:mod:`.runner.measuring.timing` measures it by its own rules (whole frames, passes apart, graphs on a GPU), in interleaved
rounds; the order is checked against NumPy's.
"""

import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import warp as wp

from ..harness.errors import UserError
from ..harness.files import digest
from ..harness.frame.devices import device_title
from ..harness.frame.schedule.passes import Pass
from ..harness.frame.schedule.runner import PassRunner
from ..harness.report import compare, document, numbers, panels
from ..harness.results.folder import ResultsFolder
from ..harness.results.record import SCHEMA, Record
from ..harness.results.table import stage_ms
from ..harness.runner.measuring.timing import Sampling, sample_frame
from ..harness.runner.planning.experiment import Experiment, Preset
from ..harness.runner.planning.planned_point import Options
from ..harness.runner.progress import Silent
from ..harness.runner.source.closure import SAMPLING, closure_hash, hash_of
from ._paper import large, small
from ._rounds import Rounds, judged, results

BITS = (8, 12, 16, 18, 20, 24, 32)
HERE = 18  # the paper's
NAME, SORT = "radix_sort_pairs", "sort pairs"
PASS = ("build", SORT)
COLUMNS = [*document.COMMON, "pairs", "bits", "sort_ms", "copy_ms", "ns_a_pair"]


class Trial(PassRunner):
    """``pairs`` int32 keys of ``bits`` random bits and their int32 places, sorted by those bits."""

    def __init__(self, pairs: int, bits: int, device: str, seed: int):
        copy = Pass("copy pairs", "build", (), ("pairs",), self._copy)
        sort = Pass(SORT, "build", ("pairs",), ("sorted",), self._sort, scratch=True)
        super().__init__(device, [copy, sort])
        self.pairs, self.bits = pairs, bits
        random = np.random.default_rng(seed).integers(0, 2**32, pairs, dtype=np.uint32)
        self.unsorted = (random >> np.uint32(32 - bits)).view(np.int32)
        with wp.ScopedDevice(device):
            self._given = wp.array(self.unsorted, dtype=wp.int32), wp.array(np.arange(pairs), dtype=wp.int32)
            # The sort takes the second half as its scratch.
            self._sorted = wp.zeros(2 * pairs, dtype=wp.int32), wp.zeros(2 * pairs, dtype=wp.int32)

    def _copy(self) -> None:
        for target, source in zip(self._sorted, self._given, strict=True):
            wp.copy(target, source, count=self.pairs)

    def _sort(self) -> None:
        wp.utils.radix_sort_pairs(*self._sorted, self.pairs, 0, self.bits)

    def wrong(self) -> int:
        """The number of places of the last order that differ from a stable sort."""
        wp.synchronize_device(self.device)
        places = self._sorted[1].numpy()[: self.pairs]
        return int((places != np.argsort(self.unsorted, kind="stable")).sum())


def measure(options: Options, report: Silent) -> list[Record]:
    """The record of each number of key bits, at as many pairs as the preset's image has pixels (and those after it).
    Points with a record are not measured again. Raises :class:`UserError` if scenes or methods are given, or if the
    folder cannot be written.
    """
    if options.preset.scenes or options.preset.methods:
        raise UserError(f"{options.experiment.name} sorts random keys; it takes no --scene and no --method")
    parts = options.preset.parts()
    with results(options, report) as (folder, made_in):
        report.steps(len(BITS) * sum(part.rounds for part in parts))
        return [record for part in parts for record in _measured(options, part, report, folder, made_in)]


def _measured(options: Options, preset: Preset, report: Silent, folder: ResultsFolder, made_in: str) -> list[Record]:
    facts = [_facts(options, preset, count) for count in BITS]
    pairs = preset.width * preset.height
    rounds = Rounds(folder, report, preset, facts, [(f"{pairs:,} pairs", f"{count} bits") for count in BITS])
    trials = {i: Trial(pairs, BITS[i], options.device, options.seed) for i in rounds.todo}
    for i, trial in trials.items():
        report.doing(f"{pairs:,} pairs, warming up", f"{BITS[i]} bits")
        start = time.perf_counter()
        trial.run()
        found = judged(0, pairs, trial.wrong(), {"pairs": pairs})
        rounds.prepared(i, time.perf_counter() - start, [found])
    most, budget = max(preset.most, preset.samples), preset.budget_s / preset.rounds
    sampling = Sampling(preset.samples, most, preset.deviation, preset.stage_samples, budget)

    def samples(i: int) -> list[dict[str, Any]]:
        measured = sample_frame(trials[i], sampling).known()
        return [{"frame": 0, **measured, "regrown": 0, "memory_bytes": 6 * 4 * pairs, "memory_source": "arrays"}]

    rounds.measure(options.seed, options.device, samples)
    return rounds.records(made_in)


def _facts(options: Options, preset: Preset, bits: int) -> dict[str, Any]:
    """The facts of a trial for its record: its point, and what takes the place of a scene and of a method."""
    pairs = preset.width * preset.height
    point = {
        "schema": SCHEMA, "experiment": options.experiment.name, "preset": options.preset_name, "bits": bits,
        "pairs": pairs, "width": preset.width, "height": preset.height, "samples": preset.samples, "most": preset.most,
        "deviation": preset.deviation, "stage_samples": preset.stage_samples, "rounds": preset.rounds,
        "budget_s": preset.budget_s, "seed": options.seed, "warp": wp.__version__,
    }  # fmt: skip
    scene = {
        "name": "random pairs", "title": f"{pairs:,} random pairs", "stand_in": None, "triangles": None, "lights": (),
        "source": {"kind": "procedural"},
    }  # fmt: skip
    method = {
        "name": NAME, "title": "Warp's radix sort", "label": f"{bits} bits", "settings": {"bits": str(bits)},
        "parameters": {}, "built": {}, "device": options.device, "device_name": device_title(options.device),
        "source_sha256": digest([hash_of({NAME: Path(__file__)}), closure_hash([SAMPLING])]),
    }  # fmt: skip
    return {"point": point, "scene": scene, "method": method}


def draw(folder: Path, quiet: bool = False) -> list[Path]:
    """Time against bits, CSV, and the gain of 18 bits over 32."""
    frames = document.frames(folder)
    table = document.with_passes(document.named(frames), folder, {"sort": PASS, "copy": ("build", "copy")})
    own, base = compare.pairs(frames, frames["point.bits"].astype(int) == max(BITS))
    bits, pairs = (table[f"point.{name}"].astype(int) for name in ("bits", "pairs"))
    table = table.assign(
        bits=bits, pairs=pairs, share=stage_ms(own, *PASS) / stage_ms(base, *PASS),
        ns_a_pair=1e6 * table["sort_ms"] / pairs, around=1e6 * table["sort_spread"] / pairs,
        heading=bits.map("{} bits".format), count=pairs.map("{:,} pairs".format),
    ).sort_values(["pairs", "bits"])  # fmt: skip
    picture = panels.lines(
        folder / "key_bits.svg", table, "bits", "ns_a_pair", hue="count", whisker="around", ticks=str, log_y=False,
        below=f"bits of the key (the paper's: {HERE})", left="sort, ns per pair",
    )  # fmt: skip
    found = numbers.means(table[table["bits"] == HERE], "share", "count")
    told = [f"{share} times as long for {count}" for count, share in found]
    finding = f"A sort by {HERE} bits, the paper's, takes {numbers.listed(told)} as one by {max(BITS)}."
    finding = finding if told else f"A sort by {HERE} bits was not measured."
    tables = {"Milliseconds of a sort": document.cross_table(table, {"count": "sorted"}, "heading", "sort_text")}
    return document.write(folder, EXPERIMENT, table, COLUMNS, finding, tables, [picture], quiet)


PAPER = large((), (), samples=7, most=30, stage_samples=7, timeout_s=300.0)
EXPERIMENT = Experiment(
    "key_bits", "Key bits: what a sort costs by the bits of its keys",
    {
        "quick": small(512, (), (), 6.0, samples=5, stage_samples=20, rounds=3),
        "paper": replace(PAPER, also=(replace(PAPER, width=2048, height=2048),)),
    },
    draw, measure=measure,
)  # fmt: skip
