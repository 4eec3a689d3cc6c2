"""``shadowbench run``: check the arguments, measure every point that has no record yet, and draw."""

import contextlib
import dataclasses
import json
import math
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from ..errors import UserError, did_you_mean, say, warn
from ..frame.devices import find_device
from ..results.folder import ResultsFolder, require_plain
from ..results.record import Record
from ..results.schema import prefer
from ..runner.machine.lock import MACHINE
from ..runner.planning import survey
from ..runner.planning.experiment import Preset, choose_methods, find_experiment, find_preset, parse_size
from ..runner.planning.planned_point import parse_settings, refuse_own_settings
from ..runner.progress import Bar, Silent
from ..runner.run import Options, Run
from ..scene.catalogue import folder as scene_folder
from ..scene.catalogue import is_of_files
from ..scene.chosen_view import ChosenView
from ..scene.facts import few_hits
from .options import checked_limit, command, number_or_frames
from .show import RESULTS

MOST_ROUNDS = 10_000  # the order of all rounds is made before the first


@command(
    """
    Measure an experiment: every method on every scene.
    shadowbench run table1 --scene cloth --method warp_bvh --method embree

    experiment               Name of an experiment; see shadowbench list experiments.
    --preset NAME            Name of a preset, such as quick or paper. Default: depends on the device.
    --scene SCENE            Name of a scene, or a mesh file. Repeatable. Default: those of the preset.
    --method NAME            Name of a method. Repeatable. Default: those of the preset.
    --out PATH               Results folder; created if missing. A second run measures only missing points. Default:
                             results/local/EXPERIMENT-PRESET.
    --size WxH               Image size, such as 256x256. Default: that of the preset.
    --frames N or A:B:STEP   Number of frames of an animated scene that are measured; 1: the middle frame. Default: the
                             preset's. With colons: of an animated file the first frame, the last and the step, counted
                             from 0.
    --samples N              Minimum number of timing samples per frame and round. Default: the preset's.
    --rounds N               Number of times that each point is measured, in interleaved order. Default: the preset's.
    --budget SECONDS         Time limit for the timing samples of a point. Default: the preset's.
    --timeout SECONDS        Time without a reply after which a point has the status timeout. Default: the preset's.
    --seed N                 Seed of the random order of the points in each round.
    --save-answers           Save the answers of every pixel as arrays.
    --score/--no-score       Compare the answers with the reference.
    --retry                  Measure points again that failed or timed out.
    --with NAME              Untimed work that is not about the scene, such as hard-cases of the experiment accuracy.
                             Repeatable.
    --cluster local|ADDRESS  Measure on several GPUs: those of this machine, or the workers of a Dask scheduler. Needs the
                             extra cluster; see docs/cluster.md.
    --dry-run                Measure nothing: list the points to be measured and those already measured, with the expected
                             time.
    """
)
def run_(
    experiment: str, preset: str | None = None, device: str | None = None, scene: list[str] | None = None,
    method: list[str] | None = None, setting: list[str] | None = None, scene_dir: Path | None = None,
    out: Path | None = None, size: str | None = None, frames: str | None = None, samples: int | None = None,
    rounds: int | None = None, budget: float | None = None, timeout: float | None = None, seed: int = 0,
    memory_limit: int | None = None, save_answers: bool = False, score: bool = True, retry: bool = False,
    extras: list[str] | None = None, cluster: str | None = None, dry_run: bool = False, as_json: bool = False,
    *, view: ChosenView,
) -> int:  # fmt: skip
    """Measure an experiment: every method on every scene. Compare the answers with the reference, then draw tables
    and figures.

    Points that have a record in the results folder are not measured again, so an interrupted run continues where it
    stopped. Exit code 1 if a point failed, or could not be scored.
    """
    count, seen = number_or_frames(frames, view)
    overrides = {"frames": count, "samples": samples, "rounds": rounds, "budget_s": budget, "timeout_s": timeout}

    def planned(elsewhere: str | None = None) -> Options:
        return plan_run(
            experiment, preset, device, scene or (), method or (), setting or (), scene_dir, out, size, overrides, seen,
            elsewhere, seed=seed, save_answers=save_answers, score=score, retry=retry, memory_limit=memory_limit,
            extras=tuple(dict.fromkeys(extras or ())),
        )  # fmt: skip

    if cluster is not None:
        if dry_run:
            raise UserError("--dry-run --cluster: the points are known to the workers alone; leave out one of the two")
        return run_on_cluster(cluster, experiment, device, planned, as_json)
    options = planned()
    return dry(options, as_json) if dry_run else run(options, as_json)


def plan_run(
    experiment: str, preset: str | None = None, device: str | None = None, scenes: Sequence[str] = (),
    methods: Sequence[str] = (), settings: Sequence[str] = (), scene_dir: Path | None = None, out: Path | None = None,
    size: str | None = None, overrides: dict[str, Any] | None = None, view: ChosenView | None = None,
    elsewhere: str | None = None, **options: Any,
) -> Options:  # fmt: skip
    """The checked options of a run.

    ``elsewhere``: the device of a cluster's workers, which this machine need not have, in place of ``device``.
    ``overrides``: fields of the preset to replace where not None. If scenes or a size are given, only those are run,
    without the further presets of :attr:`.Preset.also`. ``view``: camera and lights in place of those of every scene.
    Raises :class:`UserError` for a wrong argument.
    """
    taken = [path for path in (out, *out.parents) if path.is_file()] if out else []
    if taken:
        raise UserError(f"--out {out}: {taken[0]} is a file; name a folder")
    declared = find_experiment(experiment)
    place = elsewhere or find_device(device)
    name, chosen = find_preset(declared, preset, place)
    changes = {key: value for key, value in (overrides or {}).items() if value is not None}
    for key, value in changes.items():
        if not (value > 0 and math.isfinite(value)):
            finite = "" if math.isfinite(value) else " and finite"
            raise UserError(f"--{key.removesuffix('_s')} {value:g}: must be more than 0{finite}")
    if changes.get("rounds", 0) > MOST_ROUNDS:
        raise UserError(f"--rounds {changes['rounds']}: must be at most {MOST_ROUNDS:,}")
    # The limit is part of the point's configuration: a method rejected under one limit may pass under another.
    memory = checked_limit(options.pop("memory_limit", None))
    if memory is not None:
        changes["memory"] = memory
    if size:
        changes["width"], changes["height"] = parse_size(size)
    if "samples" in changes:
        changes["most"] = max(chosen.most, changes["samples"])
    for extra in options.get("extras", ()):
        if extra not in declared.extras:
            known = ", ".join(declared.extras) or "nothing"
            raise UserError(f"--with {extra}: {experiment} offers {known}{did_you_mean(extra, declared.extras)}")
    own = tuple(entry for part in chosen.parts() for entry in part.methods)
    refuse_own_settings(declared.name, list(settings), own)
    _refuse_own_areas(declared.name, chosen, view)

    def changed(part: Preset, **more: Any) -> Preset:
        entries = parse_settings(list(settings), choose_methods(part.methods, list(methods)))
        return dataclasses.replace(part, **changes, **more, methods=entries)

    also = () if scenes or size else tuple(changed(part) for part in chosen.also)
    whole = changed(chosen, scenes=tuple(dict.fromkeys(scenes)) or chosen.scenes, also=also)
    where = str(scene_folder(scene_dir)) if scene_folder(scene_dir) else None
    named: dict[str, str] = {}
    seen = view or ChosenView()
    for scene in whole.scenes:
        # Pictures and tables identify a scene by its name.
        other = named.setdefault(seen.resolved(scene, where).name, scene)
        if other != scene:
            raise UserError(f"--scene {scene}: has the same name as {other}; rename one of them, or run it separately")
    return Options(
        experiment=declared, preset_name=name, preset=whole, device=place,
        out=out or RESULTS / f"{experiment}-{name}", scene_dir=where, view=seen, **options,
    )  # fmt: skip


def _refuse_own_areas(experiment: str, preset: Preset, view: ChosenView | None) -> None:
    """Raise :class:`UserError` for the area of a light where every lighting of the experiment has its own."""
    names = ("light_size", "light_samples", "light_shape")
    named = ", ".join(f"--{name.replace('_', '-')}" for name in names if getattr(view, name, None) is not None)
    if named and all(lighting.samples for part in preset.parts() for lighting in part.lightings):
        raise UserError(f"{named}: {experiment} gives lights their areas itself; leave it out")


def dry(options: Options, as_json: bool = False) -> int:
    """Print what :func:`run` would measure, and how long it may take; measure and write nothing."""
    if options.experiment.measure is not None:
        raise UserError(f"--dry-run: {options.experiment.name} cannot list its points; leave out --dry-run")
    points = survey.survey(options)
    print(json.dumps(survey.as_json(options, points), indent=1) if as_json else survey.as_text(options, points))
    return 0


@MACHINE.restored()
def run(options: Options, as_json: bool = False) -> int:
    """Run and draw. Return 0 if every point was measured or skipped with a reason, else 1."""
    MACHINE.share()
    require_plain(options.out)
    # Methods that run in this process, not in a worker, may go to another folder.
    whole = dataclasses.replace(options, out=options.out.absolute())
    with Silent() if as_json else Bar() as report, contextlib.chdir("."):
        measure, after = options.experiment.measure, options.experiment.after
        report.more = "then untimed counts" * (after is not None)
        records = measure(whole, report) if measure is not None else Run(options, report).go()
        if after is not None:
            report.more = ""
            after(whole, report)
    return shown(options, records, as_json)


def run_on_cluster(
    cluster: str, experiment: str, device: str | None, planned: Callable[[str], Options], as_json: bool = False
) -> int:
    """Run on the workers of ``cluster`` and draw. ``planned``: the options for the device that its workers have."""
    from ..runner.cluster.head import ClusterRun
    from ..runner.cluster.pool import LOCAL, connected, kind_of

    if find_experiment(experiment).measure is not None:
        raise UserError(f"--cluster: {experiment} runs on this machine alone; leave out --cluster")
    with connected(cluster, kind_of(device)) as pool:
        options = planned(pool.device)
        if cluster != LOCAL:
            options = with_whole_paths(options)
        with Silent() if as_json else Bar() as report:
            records = ClusterRun(pool, options, report).go()
    if options.experiment.after is not None:
        warn(
            f"{options.experiment.name}: its untimed counts are not made on a cluster; "
            "the same command without --cluster makes them"
        )
    return shown(options, records, as_json)


def with_whole_paths(options: Options) -> Options:
    """The options with files named from the root, as workers in other folders, and on other machines, need them."""

    def whole(preset: Preset) -> Preset:
        scenes = tuple(str(Path(name).absolute()) if is_of_files(name) else name for name in preset.scenes)
        return dataclasses.replace(preset, scenes=scenes, also=tuple(whole(part) for part in preset.also))

    folder = options.scene_dir and str(Path(options.scene_dir).resolve())
    return dataclasses.replace(options, preset=whole(options.preset), scene_dir=folder)


def shown(options: Options, records: list[Record], as_json: bool) -> int:
    """Draw, and print what a run has made. Return 1 if a point failed, or the scoring of its answers, else 0."""
    files: list[Path] = []
    if options.experiment.draw is not None:
        with ResultsFolder(options.out).writing():
            prefer(options.out, records)
            files = list(options.experiment.draw(options.out, as_json))  # type: ignore[call-arg]
    bad = [record for record in records if record.says_nothing]
    for text in warnings_of(records):
        warn(text)
    if as_json:
        print(json.dumps(report_json(options, records, files), indent=1))
    else:
        for file in files:
            say(f"written: {file}")
        say(f"records: {options.out / 'records'}")
        for record in bad:
            who = f"{record.scene['name']}, {record.method['label']}"
            unscored = next((frame.unscored for frame in record.frames if frame.unscored), "")
            say(f"{who}: {unscored if record.status == 'ok' else f'{record.status}: {record.reason}'}")
        if bad:
            print(f"{len(bad)} of {len(records)} points failed; --retry measures them again", file=sys.stderr)
    return 1 if bad else 0


def warnings_of(records: list[Record]) -> list[str]:
    """A warning for each scene on which fewer than a hundredth of the rays of any method hit something."""
    seen: dict[str, tuple[int, int]] = {}
    for record in records:
        frames = [frame.hits for frame in record.frames if frame.hits is not None]
        rays = len(frames) * record.point["width"] * record.point["height"]
        seen[record.scene["name"]] = max(seen.get(record.scene["name"], (0, 0)), (sum(frames), rays))
    notices = ((name, few_hits(hits, rays)) for name, (hits, rays) in seen.items())
    return [f"{name}: {notice.text}" for name, notice in notices if notice]


def report_json(options: Options, records: list[Record], files: list[Path]) -> dict[str, Any]:
    """What ``--json`` prints: a row per point, the files written, and the experiment's own ``answer``."""
    from ..results.means import point_rows

    said = [file for file in files if file.name == f"{options.experiment.name}.json"]
    built = {record.key: record.method.get("built") for record in records}
    return {
        "experiment": options.experiment.name, "preset": options.preset_name, "device": options.device,
        "out": str(options.out), "files": [str(file) for file in files], "warnings": warnings_of(records),
        **({"answer": json.loads(said[0].read_text(encoding="utf-8"))} if said else {}),
        "points": [{**row, "built": built[row["key"]]} for row in point_rows(records)],
    }  # fmt: skip
