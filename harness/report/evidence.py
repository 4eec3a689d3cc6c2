"""What a claim may rest on: measured rows that may be held against each other.

The general rule: a ratio is taken within one run (a folder of records and the environment they were made in), between
records of the same scene, size, lights and frames, and with one version of each method. :class:`Evidence` holds
nothing else, and :func:`ratio` refuses all else, so that a claim cannot mix runs or versions unnoticed.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..errors import UserError
from . import points

Row = dict[str, Any]
Measure = Callable[[Row], Any]


class MixedError(ValueError):
    """Rows of different runs, versions, scenes, sizes, lights or frames were about to be compared."""


def version_of(row: Row) -> str:
    """The hash of the source of a row's method."""
    return row["record"]["method"].get("source_sha256") or ""


def measured_at(row: Row) -> float:
    """When a row's last round began, seconds."""
    return max((max(f["started"]) for f in row["record"]["frames"] if f.get("started")), default=0.0)


def scene_of(row: Row) -> tuple[str, str, str]:
    """What tells a scene from all others: its name, its title, and the hash of its arrays."""
    return row["scene"], row["scene_title"], row["record"]["scene"].get("arrays_sha256") or ""


def ratio(one: Row, other: Row, measure: Measure, sizes: bool = False) -> float | None:
    """``measure`` of one row over that of another, over the frames that both have; None where either has no value.

    ``sizes``: the two may differ in the size of the image. Raises :class:`MixedError` where they differ in anything that
    would make it no comparison.
    """
    same: dict[str, Measure] = {
        "run": lambda r: r["run"],
        "scene": scene_of,
        "lights": lambda r: (r["light_label"], r["light_count"]),
        "device": lambda r: r["device"],
    }
    if not sizes:
        same["size"] = lambda r: (r["width"], r["height"])
    if one["method"] == other["method"]:
        same["version"] = version_of
    for name, of in same.items():
        if of(one) != of(other):
            raise MixedError(f"another {name}: {of(one)} and {of(other)}")
    common = set(one["frame_numbers"]) & set(other["frame_numbers"])
    if not common:
        raise MixedError(f"other frames: {one['frame_numbers']} and {other['frame_numbers']}")
    a, b = (measure(points.of_frames(r, common)) for r in (one, other))
    return a / b if a and b else None


@dataclass(frozen=True, eq=False)
class Evidence:
    """Rows of one experiment: those of each scene from one run, and one version of each method throughout.

    Raises :class:`MixedError` for any others.
    """

    experiment: str
    made: tuple[Row, ...]

    def __post_init__(self) -> None:
        if any(len({r["run"] for r in self.made if scene_of(r) == s}) > 1 for s in map(scene_of, self.made)):
            raise MixedError(f"{self.experiment}: a scene's rows are of several runs")
        for method in {r["method"] for r in self.made}:
            if len({version_of(r) for r in self.made if r["method"] == method}) > 1:
                raise MixedError(f"{self.experiment}: {method} has several versions")

    @property
    def versions(self) -> dict[str, str]:
        """The version of each method."""
        return {r["method"]: version_of(r) for r in self.made}

    @property
    def folders(self) -> list[str]:
        """The folders that the rows come from."""
        return points.in_order(r["run"][0] for r in self.made)

    def rows(self, **wanted: Any) -> list[Row]:
        """Rows whose columns have these values, of the largest image size unless a width is named."""
        widest = max(r["width"] for r in self.made)
        return [r for r in self.made if all(r.get(k) == v for k, v in {"width": widest, **wanted}.items())]

    def by_scene(self, **wanted: Any) -> dict[str, Row]:
        """One row a scene, by its name; a scene of the same name as a stand-in goes by its title."""
        rows = sorted(self.rows(**wanted), key=measured_at)
        titles = {r["scene"]: {x["scene_title"] for x in rows if x["scene"] == r["scene"]} for r in rows}
        return {
            r["scene"] if len(titles[r["scene"]]) == 1 or r["stand_in"] else r["scene_title"]: r for r in rows
        }

    def ratios(self, one: Row, other: Row, measure: Measure) -> dict[str, float]:
        """Measure of the rows with the columns of ``one`` over that of those with ``other``'s, by scene."""
        first, second = self.by_scene(**one), self.by_scene(**other)
        known = {s: ratio(first[s], second[s], measure) for s in sorted(first.keys() & second.keys())}
        return {scene: value for scene, value in known.items() if value is not None}

    def sizes(self) -> list[int]:
        """Image widths, smallest first."""
        return points.in_order(r["width"] for r in self.made)

    def described(self) -> str:
        """Where it is from, and what others must agree with: sizes, frames and versions."""
        sizes = ", ".join(dict.fromkeys(f"{r['width']}x{r['height']}" for r in self.made))
        counts = points.in_order(len(r["frame_numbers"]) for r in self.made)
        frames = " or ".join(map(str, counts)) + f" frame{'s' * (counts != [1])}"
        versions = ", ".join(f"{m} {v[:8]}" if v else m for m, v in sorted(self.versions.items()))
        return f"{' and '.join(self.folders)} ({sizes}; {frames} a scene; {versions})"


@dataclass(frozen=True, eq=False)
class Data:
    """The measured rows of every experiment below a folder. What may be compared comes from :meth:`evidence` alone."""

    made: tuple[Row, ...]

    @property
    def gpu(self) -> bool:
        """Whether anything was measured on a GPU; then CPU rows are left out."""
        return any(str(r["device"]).startswith("cuda") for r in self.made)

    def versions(self, method: str) -> list[str]:
        """Versions of a method among the records, in the order in which each was last measured."""
        own = sorted((r for r in self.made if r["method"] == method), key=measured_at)
        return list(dict.fromkeys(version_of(r) for r in reversed(own)))[::-1]

    def earlier(self, method: str) -> list[str]:
        """Folders whose records of a method are not all of its last version."""
        last = self.versions(method)[-1:]
        own = [r for r in self.made if r["method"] == method]
        return points.in_order(r["run"][0] for r in own if [version_of(r)] != last)

    def evidence(self, *experiments: str) -> list[Evidence]:
        """What there is of these experiments, the last versions of the methods first, then as they are named.

        Runs are joined where they have other scenes and the same versions. Where a method has several versions in one
        run, its last one counts.
        """
        found = [e for name in experiments for e in self._joined(name)]
        last: dict[tuple[str, str], float] = {}
        for r in self.made:
            key = (r["method"], version_of(r))
            last[key] = max(last.get(key, 0.0), measured_at(r))
        # Two that share a version are equally recent, whichever of them was measured later.
        return sorted(found, key=lambda e: -max(last[item] for item in e.versions.items()))

    def _joined(self, experiment: str) -> list[Evidence]:
        groups: list[list[Row]] = []
        for rows in sorted(self._runs(experiment), key=lambda rows: -max(map(measured_at, rows))):
            for group in groups:
                ones, others = _versions(group), _versions(rows)
                shared = ones.keys() & others.keys()
                agree = shared and all(ones[method] == others[method] for method in shared)
                if agree and not {scene_of(r) for r in group} & {scene_of(r) for r in rows}:
                    group += rows
                    break
            else:
                groups.append(rows)
        return [Evidence(experiment, tuple(rows)) for rows in groups]

    def _runs(self, experiment: str) -> list[list[Row]]:
        """The rows of each run of an experiment."""
        runs: dict[Any, list[Row]] = {}
        for r in self.made:
            if r["experiment"] == experiment:
                runs.setdefault(r["run"], []).append(r)
        last = {run: _versions(rows) for run, rows in runs.items()}
        return [[r for r in rows if version_of(r) == last[run][r["method"]]] for run, rows in runs.items()]


def _versions(rows: Sequence[Row]) -> dict[str, str]:
    """The last version of each method among rows of a run."""
    return {r["method"]: version_of(r) for r in sorted(rows, key=measured_at)}


def collect(folder: Path) -> Data:
    """Every record in the folder and the folders in it. Raises :class:`UserError` where there is none."""
    places = [path.parent for path in sorted([*folder.glob("records"), *folder.glob("*/records")])]
    made = []
    for place in places:
        if any((place / "records").glob("*.json*")):
            rows = points.measured(points.rows(place))
            made += [{**r, "run": (place.name, r["environment"])} for r in rows]
    if not made:
        raise UserError(f"{folder}: no records in it or in its folders; name a folder of results")
    on_gpu = [r for r in made if str(r["device"]).startswith("cuda")]
    return Data(tuple(on_gpu or made))
