"""What ablation and moving draw and say, from made-up records."""

import dataclasses

from helpers.experiment_records import csv_of, record_of, report_of
from shadowbench.experiments import _paper, ablation
from shadowbench.harness.runner.planning.experiment import find_experiment
from shadowbench.methods.perspective_spherical import parameters


def test_ablation_holds_ours_against_the_tree_and_takes_each_change_back(tmp_path):
    declared = find_experiment("ablation").presets["quick"].methods
    known = {e.label: e for e in declared}
    times = {"paper-faithful": 4.0, "all of ours": 1.0, "Warp's tree rebuilt": 2.0, "ours with radix sort": 1.5}
    records = [record_of("ablation", known[label], "buddha", ms=ms) for label, ms in times.items()]
    slow = {**times, "all of ours": 3.0}
    records += [record_of("ablation", known[label], "cloth", ms=ms) for label, ms in slow.items()]
    text = report_of("ablation", tmp_path, records)
    assert "Over Warp's tree rebuilt, all of ours takes 0.866 times as long and paper-faithful 2.00" in text
    back = text[text.index("## Frame time over that of all of ours") :]
    assert "| ours with radix sort | 0.866 | 0.500 | 1.50 |" in back
    drawn = (tmp_path / "ablation-ours.svg").read_text()
    for word in ("Warp's tree rebuilt", "ours with radix sort", "frame time over that of all of ours"):
        assert word in drawn, word
    records[2]["environment"] = "another run"
    assert "Warp's tree rebuilt was not measured" in report_of("ablation", tmp_path / "old", records[:3])
    assert not (tmp_path / "old" / "ablation-ours.svg").exists()


def test_ablation_takes_back_every_setting_in_which_ours_differs_from_the_papers():
    ours = dataclasses.asdict(parameters.Build()) | dataclasses.asdict(parameters.Trace())
    differ = {key for key, text in _paper.PAPER.items() if str(ours[key]).lower() != text}
    taken = [key for keys in ablation.TAKEN_BACK.values() for key in keys]
    assert sorted(taken) == sorted(differ)
    for entry in ablation.LEFT_OUT:
        assert entry.settings.items() <= _paper.PAPER.items()


def test_moving_has_a_row_a_frame(tmp_path):
    preset = find_experiment("moving").presets["quick"]
    records = [
        record_of("moving", e, s, preset.lightings[0], frames=8) for e in preset.methods for s in ("cloth", "fairy")
    ]
    for i, frame in enumerate(records[0]["frames"]):
        frame["total_ms"] = [10.0 + i] * 2
    assert "| 8 | 10.0 | 13.5 | 17.0 | 17.0 | 17.0 | 1.70 | 0 |" in report_of("moving", tmp_path, records)
    assert len(csv_of("moving", tmp_path)) == 8 * len(records)
    assert "turns of the light" in (tmp_path / "moving.svg").read_text()


def test_moving_counts_what_explains_a_slow_place_and_names_what_has_no_record(tmp_path):
    preset = find_experiment("moving").presets["quick"]
    ours, _, tree, _ = preset.methods
    slow, uncounted = (record_of("moving", e, "sibenik", preset.lightings[0], frames=8) for e in (ours, tree))
    even = record_of("moving", ours, "fairy", preset.lightings[0], frames=8)
    slow["frames"][3]["total_ms"] = [30.0, 30.0]
    for i, frame in enumerate(slow["frames"]):
        frame["counters"] = {"shadow tests a hundred rays": 9000 if i == 3 else 2000,
                             "light 0 tiles with rays": 50 if i == 3 else 120}  # fmt: skip
    text = report_of("moving", tmp_path, [slow, uncounted, even])
    scenes = [line.split(" | ")[0] for line in text.splitlines() if line.startswith("| ") and "---" not in line]
    titles = ["| scene", *["| Fairy (stand-in)"] * 2, *["| Sibenik (stand-in)"] * 2]
    assert scenes == titles, "animated first, and a row for what has no record"
    assert "- mesh rebuilt, one turn: no record (Fairy (stand-in))" in text
    rows = [row for row in csv_of("moving", tmp_path) if row["total_ms"] == "30"]
    tests, tiles = "counter.shadow tests a hundred rays", "counter.light 0 tiles with rays"
    assert [(row["scene"], row[tests], row[tiles]) for row in rows] == [("sibenik", "9000", "50")]


def test_ablation_compares_with_its_base_on_the_same_scene(tmp_path):
    declared = find_experiment("ablation")
    entries = declared.presets["quick"].methods
    records = []
    for scene, base in (("cloth", 10.0), ("buddha", 40.0)):
        for i, e in enumerate(entries):
            lost = "culled" in e.label and scene == "cloth"
            records.append(record_of("ablation", e, scene, ms=base * (1 + 0.1 * i), status="skipped" if lost else "ok"))
    text = report_of("ablation", tmp_path, records)
    assert "| direct mapping, 16x16 tiles | 1.10 | 1.10 | 1.10 |" in text
    assert "| exact test, back faces culled | 1.90 | - | 1.90 |" in text
    assert "Not measured" in text
    # Neither the tree nor what is taken back from ours is a change to the paper's configuration.
    changes = text[text.index("## Frame time over that of paper") : text.index("## Frame time over that of all")]
    assert "Warp's tree" not in changes
    assert "ours with" not in changes
    assert len(csv_of("ablation", tmp_path)) == len(records)
