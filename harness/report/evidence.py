"""Evidence for a claim: points of one experiment that may be compared, with one version of each method throughout.

A ratio is taken within one run, between points of the same scene, size, lights and frames (:func:`.report.compare.pairs`).
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property, reduce
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..results.schema import folders_with_records
from . import compare, document

if TYPE_CHECKING:
    from pandas import DataFrame, Series

RUN = ["experiment", "folder", "run"]
SCENE = ["scene", "scene_title", "scene_sha256"]
Measure = Callable[["DataFrame"], "Series"]


class Lacking(Exception):
    """The evidence does not have the deciding numbers: what is not measured, and the numbers that exist."""

    def __str__(self) -> str:
        return f"{self.args[0]} is not measured" + "".join(f"; {known}" for known in self.args[1:] if known)


def matching(table: DataFrame, **wanted: Any) -> Series:
    """Which rows have these values in these columns."""
    return reduce(operator.and_, (table[name] == value for name, value in wanted.items()))


def by_scene(points: DataFrame) -> DataFrame:
    """The point of each scene that was measured last, by the scene's name; by its title beside a stand-in of that name."""
    last = points.sort_values("started").drop_duplicates(SCENE[:2], keep="last")
    last = points[points.index.isin(last.index)]
    alone = last.groupby("scene")["scene_title"].transform("nunique") == 1
    return last.set_index(last["scene"].where(alone | (last["stand_in"] != ""), last["scene_title"]))


@dataclass(frozen=True, eq=False)
class Evidence:
    """The measured frames of one experiment: one version of each method, and for each scene those of one run."""

    experiment: str
    frames: DataFrame

    @cached_property
    def versions(self) -> dict[str, str]:
        """The version of each method."""
        return dict(self.frames.groupby("method")["method_sha256"].last())

    @cached_property
    def widths(self) -> list[int]:
        """Image widths, smallest first."""
        return sorted(self.frames["width"].unique())

    def of(self, **wanted: Any) -> DataFrame:
        """Frames whose columns have these values, of the largest image size unless a width is named."""
        return self.frames[matching(self.frames, **{"width": self.widths[-1], **wanted})]

    def by_scene(self, **wanted: Any) -> DataFrame:
        """One point per scene (:func:`by_scene`) of the frames that :meth:`of` gives."""
        return by_scene(document.named(self.of(**wanted)))

    def ratios(
        self, one: dict[str, Any], other: dict[str, Any], measure: Measure, lacks: str = "", *scenes: str
    ) -> dict[str, float]:
        """Measure of the points with the columns of ``one`` over that of those with ``other``'s, by scene.

        ``scenes``: these alone, in this order. ``lacks``: what :class:`Lacking` says where one of them, or all, have none.
        """
        frames, found = self.of(), dict[str, float]()
        base, own = matching(frames, **other), matching(frames, **one)
        if base.any() and own.any():
            points, bases = compare.pairs(frames[base | own], base[base | own])
            known = by_scene(points[matching(points, **one)].reset_index())
            values = measure(known) / measure(bases.loc[known["key"]]).to_numpy()
            found = dict(sorted(values[(values != 0.0) & (values < float("inf"))].items()))
        if lacks and not (set(scenes) <= set(found) and found):
            raise Lacking(lacks)
        return {scene: found[scene] for scene in scenes or found}

    def over_rivals(self, one: dict[str, Any], rivals: Iterable[str], measure: Measure) -> DataFrame:
        """:meth:`ratios` over each other label in place of that of ``one``: a row per scene, a column per label."""
        import pandas as pd

        found = {rival: self.ratios(one, {**one, "label": rival}, measure) for rival in rivals}
        return pd.DataFrame(found, dtype=float).sort_index()

    def described(self) -> str:
        """Its folders, sizes and versions of methods."""
        sizes = ", ".join(dict.fromkeys(f"{w}x{h}" for w, h in self.frames[["width", "height"]].to_numpy()))
        versions = ", ".join(f"{m} {v[:8]}".strip() for m, v in sorted(self.versions.items()))
        return f"{' and '.join(sorted(self.frames['folder'].unique()))} ({sizes}; {versions})"


@dataclass(frozen=True, eq=False)
class Data:
    """The measured frames of every experiment below a folder. What may be compared comes from :meth:`evidence` alone."""

    frames: DataFrame

    @property
    def gpu(self) -> bool:
        """Whether anything was measured on a GPU; then CPU points are left out."""
        return bool(self.frames["device"].str.startswith("cuda").any())

    @cached_property
    def newest(self) -> dict[str, str]:
        """The version of each method that was measured last."""
        return dict(self.frames.sort_values("started").groupby("method")["method_sha256"].last())

    def evidence(self, *experiments: str) -> list[Evidence]:
        """What there is of these experiments, the last versions of the methods first, then as they are named."""
        last = self.frames.groupby(["method", "method_sha256"])["started"].max()
        found = [e for name in experiments for e in self.runs.get(name, [])]
        # Two that share a version are equally recent, whichever of them was measured later.
        return sorted(found, key=lambda e: -max(last[item] for item in e.versions.items()))

    @cached_property
    def runs(self) -> dict[str, list[Evidence]]:
        """Evidence by experiment. Where a method has several versions in one run, its last one counts.

        Runs are joined where they have other scenes and the same versions.
        """
        import pandas as pd

        own = self.frames.sort_values("started", kind="stable")
        own = own[own["method_sha256"] == own.groupby([*RUN, "method"])["method_sha256"].transform("last")]
        runs = sorted((run for _, run in own.groupby(RUN)), key=lambda run: -run["started"].max())
        found: dict[str, list[Evidence]] = {}
        for frames in runs:
            # What other experiments count and set are columns of this one too, all empty.
            run = Evidence(frames["experiment"].iloc[0], frames.dropna(axis=1, how="all"))
            before = found.setdefault(run.experiment, [])
            for i, other in enumerate(before):
                shared = other.versions.items() & run.versions.items()
                agree = shared and len(shared) == len(other.versions.keys() & run.versions.keys())
                if agree and not run.frames.merge(other.frames[SCENE]).size:
                    before[i] = Evidence(run.experiment, pd.concat([other.frames, run.frames]).sort_index())
                    break
            else:
                before.append(run)
        return found


def collect(folder: Path) -> Data:
    """Every record in the folder and the folders in it. Raises :class:`.errors.UserError` where there is none."""
    return together([document.frames(place) for place in folders_with_records(folder)])


def together(tables: Sequence[DataFrame]) -> Data:
    """The measured frames of several folders (:func:`.report.document.frames`)."""
    import pandas as pd

    frames = pd.concat(tables, ignore_index=True)
    frames["key"] = frames["folder"] + "/" + frames["key"]  # the same point may be in several folders
    frames = frames[(frames["status"] == "ok") & frames["total_ms"].notna()]
    on_gpu = frames["device"].str.startswith("cuda")
    return Data(frames[on_gpu] if on_gpu.any() else frames)
