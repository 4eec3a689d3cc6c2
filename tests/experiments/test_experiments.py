"""Experiments: what they declare is valid, and each of them is run for real, small."""

import dataclasses

import pytest
from helpers.experiment_records import record_of, report_of
from helpers.tiny_runs import write_scene
from shadowbench.experiments import _paper, ablation, figure2
from shadowbench.experiments.ablation import CULLED, TREE
from shadowbench.harness.commands.run import plan_run
from shadowbench.harness.commands.show import show
from shadowbench.harness.errors import UserError
from shadowbench.harness.frame.registry import label_of
from shadowbench.harness.runner.planning.experiment import experiment_names, find_experiment, find_preset
from shadowbench.harness.runner.planning.planned_point import describe_method
from shadowbench.harness.runner.progress import Silent
from shadowbench.harness.runner.run import Options, Run
from shadowbench.harness.scene.catalogue import scene_names
from shadowbench.methods.perspective_spherical import parameters

OWN = ("figure2", "figure6", "figure9", "figure10", "figure11", "two_lights", "moving", "ablation")


# --- declarations -------------------------------------------------------------------------------------------


def test_every_experiment_of_the_paper_is_there_and_helpers_are_not():
    assert set(OWN) | {"table1", "claims"} <= set(experiment_names())
    assert not [name for name in experiment_names() if name.startswith("_")]


SHARED = "frame_time table1 two_lights effects moving crossover scaling reflection advise costs kept_trees".split()


def test_a_method_with_its_settings_has_one_name_in_all_tables():
    """Also where records have a former one."""
    presets = [preset for name in SHARED for preset in find_experiment(name).presets.values()]
    entries = {(e.method, str(e.settings)): set() for preset in presets for e in preset.methods}
    for preset in presets:
        for e in preset.methods:
            entries[e.method, str(e.settings)].add(e.label)
    assert {key: labels for key, labels in entries.items() if len(labels) > 1} == {}
    known = {"name": "warp_bvh", "title": "BVH (Warp)", "label": "BVH (Warp)"}
    assert label_of(known) == label_of({**known, "label": "Warp mesh"}) == "mesh rebuilt"
    assert label_of({**known, "settings": {"update": "refit"}}) == "BVH (Warp)"


@pytest.mark.parametrize("name", OWN)
def test_declarations_are_valid(name):
    declared = find_experiment(name)
    assert (declared.name, set(declared.presets)) == (name, {"quick", "paper"})
    for preset in declared.presets.values():
        for entry in preset.methods:
            describe_method(entry, "cpu")
        labels = [entry.label or entry.method for entry in preset.methods]
        assert len(set(labels)) == len(labels), "labels tell the lines of a drawing apart"
        assert set(preset.scenes) <= set(scene_names())
        names = [lighting.label for lighting in preset.lightings]
        assert len(set(names)) == len(names)
    assert (declared.presets["paper"].width, declared.presets["paper"].height) == (1024, 1024)


def own_settings() -> list[tuple[str, str, str]]:
    """Experiment, preset and ``method.param`` of every setting that an entry of an experiment has itself."""
    found = {
        (name, preset, f"{entry.method}.{key}"): None
        for name in experiment_names()
        for preset, declared in find_experiment(name).presets.items()
        for part in declared.parts()
        for entry in part.methods
        for key in entry.settings
    }
    return list(found)


def test_a_setting_that_an_experiment_makes_itself_is_refused(tmp_path):
    own = own_settings()
    assert {"coherence", "figure11", "frame_time", "scaling"} <= {name for name, _, _ in own}
    for name, preset, setting in own:
        method = setting.split(".")[0]
        for methods in ((), (method,)):
            with pytest.raises(UserError, match=rf"^--set {setting}: {name} sets it itself \(.+\); leave it out$"):
                plan_run(name, preset, "cpu", methods=methods, settings=[f"{setting}=1"], out=tmp_path)


def test_the_refusal_names_the_values_that_an_experiment_compares(tmp_path):
    for setting, values in (("bvh2.precision", "default, float32"), ("warp_bvh.update", "default, bvh_rebuild, refit")):
        with pytest.raises(UserError, match=rf"^--set {setting}: frame_time sets it itself \({values}\)"):
            plan_run("frame_time", "quick", "cpu", settings=[f"{setting}=x"], out=tmp_path)


def test_other_settings_reach_every_entry_of_their_method(tmp_path):
    preset = plan_run("frame_time", "quick", "cpu", settings=["bvh2.threads=4"], out=tmp_path).preset
    assert {entry.settings.get("threads") for entry in preset.methods if entry.method == "bvh2"} == {"4"}
    assert not [entry for entry in preset.methods if entry.method != "bvh2" and "threads" in entry.settings]


def test_direct_and_indirect_mapping_trace_with_blocks_of_one_size():
    tiles = {e.label: (int(e.settings["tile"]), int(e.settings["k"])) for e in figure2.METHODS}
    assert {tile * k for label, (tile, k) in tiles.items() if label != figure2.DIRECT_SMALL} == {16}
    assert tiles[figure2.DIRECT][1] == tiles[figure2.DIRECT_SMALL][1] == 1
    # The other reading of direct mapping: the same sorting tiles, each of them a block.
    assert (tiles[figure2.DIRECT_SMALL][0], tiles[figure2.INDIRECT][1]) == (tiles[figure2.INDIRECT][0], 2)


def test_ablation_takes_back_every_setting_in_which_ours_differs_from_the_papers():
    ours = dataclasses.asdict(parameters.Build()) | dataclasses.asdict(parameters.Trace())
    differ = {key for key, text in _paper.PAPER.items() if str(ours[key]).lower() != text}
    taken = [key for keys in ablation.TAKEN_BACK.values() for key in keys]
    assert sorted(taken) == sorted(differ)
    for entry in ablation.LEFT_OUT:
        assert entry.settings.items() <= _paper.PAPER.items()


def test_an_experiment_without_presets_says_what_to_do():
    with pytest.raises(UserError, match="claims measures nothing; run other experiments"):
        find_preset(find_experiment("claims"), None, "cpu")


# --- the experiments themselves, at 16 x 16 -----------------------------------------------------------------

CUT = {
    "figure10": (lambda e: True, 1),
    "figure11": (lambda e: e.settings["r"] == "64" and e.settings["clamp"] == "none", 2),
    "ablation": (lambda e: e.label in ("paper-faithful", "cube map", CULLED, TREE), 1),
    "two_lights": (lambda e: e.label in ("the paper's grids", "mesh rebuilt"), 2),
    "moving": (lambda e: e.method in (_paper.METHOD, "warp_bvh"), 1),
}
"""Which entries and how many lightings are run of an experiment that has many."""


@pytest.mark.slow
@pytest.mark.parametrize("name", OWN)
def test_each_experiment_runs_and_draws(name, tmp_path):
    declared = find_experiment(name)
    wanted, count = CUT.get(name, (lambda e: True, 99))
    quick = declared.presets["quick"]
    tiny = dataclasses.replace(
        quick, width=16, height=16, scenes=(write_scene(tmp_path / "tetra.obj"),), samples=1, most=1, stage_samples=1,
        rounds=1, methods=tuple(e for e in quick.methods if wanted(e)), lightings=quick.lightings[:count],
    )  # fmt: skip
    out = tmp_path / "out"
    tiny = dataclasses.replace(
        tiny, also=tuple(dataclasses.replace(tiny, width=8, height=8, also=()) for _ in quick.also)
    )
    records = Run(Options(declared, "quick", tiny, "cpu", out, score=False), Silent()).go()
    assert len(records) == len(tiny.methods) * len(tiny.lightings) * len(tiny.parts())
    assert {r.status for r in records} <= {"ok", "skipped"}, [r.reason for r in records]
    assert sum(r.status == "ok" for r in records) >= len(records) - 2
    files = show(name, out, quiet=True)
    assert {f"{name}.csv", f"{name}.md"} <= {file.name for file in files}
    assert any(file.suffix in (".svg", ".png") for file in files) or name == "figure2"
    assert all(file.stat().st_size > 0 for file in files)
    if name == "figure2":
        assert len(list((out / "maps").glob("*.png"))) == len(records)
    if name == "figure6":
        rays = {r.scene["lighting"].get("label", ""): r.frames[0].counters["light 0 rays"] for r in records}
        assert rays[""] > 0
        assert {rays[name] < rays[""] for name in ("cone", "rectangle")} == {True}, "the spots look elsewhere"
    if name == "moving":
        assert all(len(r.frames) == 8 for r in records)


@pytest.mark.parametrize(("name", "said"), [
    ("scaling", "was not measured along a sweep"), ("crossover", "Nothing was measured."),
    ("kept_trees", "Nothing was measured."), ("costs", "No energy was measured."),
    ("reflection", "No grid and tree were measured with mirrors."), ("figure10", "Nothing was measured."),
    ("soft_shadows", "Nothing was measured."), ("moving", "No place of the light was measured"),
    ("ablation", "No change to paper-faithful was measured"), ("accuracy", "No point has both a time and a score."),
    ("frame_time", "Nothing was measured."), ("two_lights", "Two lights were not measured"),
    ("effects", "No effect was measured"), ("figure6", "No spot was measured"),
])  # fmt: skip
def test_nothing_measured_is_said_and_not_drawn(name, said, tmp_path):
    preset = find_experiment(name).presets["quick"]
    made = record_of(name, preset.methods[0], preset.scenes[0], preset.lightings[0], status="rejected")
    text = report_of(name, tmp_path, [made])
    assert said in text
    assert "needs 9 pairs" in text, "and why"
    assert not list(tmp_path.glob("*.svg"))
