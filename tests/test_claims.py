"""The paper's claims: their verdicts follow from the records of all experiments."""

from __future__ import annotations

import pytest
from made_records import keep, made
from shadowbench.experiments import _paper, figure2
from shadowbench.experiments.claims import CLAIMS
from shadowbench.harness.commands.show import show
from shadowbench.harness.errors import UserError
from shadowbench.harness.figures import claims
from shadowbench.harness.plan import find_experiment


def judged(folder):
    show("claims", folder, quiet=True)
    return {r["claim"]: r for r in claims.judge_all(CLAIMS, claims.collect(folder))}


def test_every_claim_has_a_verdict_and_says_what_is_missing(tmp_path):
    keep(tmp_path / "a", [made("figure2", figure2.METHODS[0], "buddha")])
    found = judged(tmp_path)
    assert len(found) == len(CLAIMS)
    assert {r["verdict"] for r in found.values()} == {claims.OPEN}
    assert all("run " in r["numbers"] for r in found.values())
    assert (tmp_path / "claims.md").read_text().count("**can't tell**") == len(CLAIMS)
    with pytest.raises(UserError, match="no records in it"):
        show("claims", tmp_path / "a" / "records", quiet=True)


def test_claims_follow_the_records(tmp_path):
    entries = {e.label: e for e in find_experiment("ablation").presets["paper"].methods}

    def ablated(label, ms, scene="cloth", **counters):
        return made("ablation", entries[label], scene, ms=ms, counters=counters)

    base = "paper-faithful"
    keep(tmp_path / "ablation", [ablated(base, 10.0), ablated("light not clamped", 20.0), ablated("cube map", 8.0),
                                 ablated("two-angle map", 11.0), ablated("direct mapping, 16x16 tiles", 10.1),
                                 ablated("4x4 of 4x4 tiles", 10.2)])  # fmt: skip
    keep(tmp_path / "figure2", [made("figure2", e, "buddha", ms=ms, counters={"primary tests, most": most})
                                for e, ms, most in zip(figure2.METHODS[:2], (14.0, 10.0), (9, 5), strict=True)])  # fmt: skip
    found = judged(tmp_path)
    assert found["Clamping the light's rectangle to the view helps"]["verdict"] == claims.HOLDS
    assert found["A spherical map is better than a cube map"]["verdict"] == claims.FAILS
    assert found["2x2 sorting tiles in a tracing tile are best"]["verdict"] == claims.OPEN
    assert found["Indirect mapping makes Buddha 30-50 % faster"]["verdict"] == claims.HOLDS
    dropped = next(r for text, r in found.items() if "drop by more than half" in text)
    assert dropped["verdict"] == claims.FAILS
    assert "56%" in dropped["numbers"]


def test_our_own_claim_is_judged_within_one_run(tmp_path):
    entries = {e.label: e for e in find_experiment("frame_time").presets["paper"].methods}
    ours = next(e for e in entries.values() if e.method == _paper.METHOD)
    scenes = (("cloth", 1.5), ("fairy", 2.5))
    records = [made("frame_time", ours, scene, ms=ms) for scene, ms in scenes]
    records += [made("frame_time", entries["mesh rebuilt"], scene, ms=2.0) for scene, _ in scenes]
    (found,) = [
        r for text, r in judged(keep(tmp_path / "a", records).parent).items() if text.startswith("Ours")
    ]
    assert found["verdict"] == claims.FAILS
    assert "1 of 2 scenes; our time over the tree's: cloth 0.75, fairy 1.25" in found["numbers"]


def test_scenes_of_one_name_are_told_apart_and_the_run_of_more_frames_is_taken(tmp_path):
    """A real mesh beside the stand-in of its name; another run of fewer frames, though it came later."""
    entries = {e.label: e for e in find_experiment("frame_time").presets["paper"].methods}
    ours = next(e for e in entries.values() if e.method == _paper.METHOD)

    def pair(ms, scene="cloth", title="", frames=1, started=0.0):
        records = [
            made("frame_time", entry, scene, ms=m)
            for entry, m in ((ours, ms), (entries["mesh rebuilt"], 2.0))
        ]
        for record in records:
            record["scene"]["title"] = title or record["scene"]["title"]
            record["frames"][0]["started"] = [started]
            record["frames"] = [{**record["frames"][0], "frame": k} for k in range(frames)]
        return records

    keep(tmp_path / "a", [*pair(1.0, frames=2, started=1.0), *pair(1.2, "sibenik")])
    keep(tmp_path / "b", pair(1.6, started=2.0))
    keep(tmp_path / "c", pair(1.8, "sibenik", "sibenik.ply"))
    (found,) = [r for text, r in judged(tmp_path).items() if text.startswith("Ours")]
    assert "Sibenik (stand-in) 0.60, cloth 0.50, sibenik.ply 0.90" in found["numbers"]


def test_records_of_a_later_version_of_ours_stand_in_and_the_older_are_named(tmp_path):
    entries = {e.label: e for e in find_experiment("frame_time").presets["paper"].methods}
    ours = next(e for e in entries.values() if e.method == _paper.METHOD)
    best = find_experiment("ablation").presets["paper"].methods[-1]

    def version(record, source, started):
        record["method"]["source_sha256"] = source
        record["frames"][0]["started"] = [started]
        return record

    old = version(made("frame_time", ours, "cloth", ms=3.0), "old", 1.0)
    keep(tmp_path / "a", [old, made("frame_time", entries["mesh rebuilt"], "cloth", ms=2.0)])
    keep(tmp_path / "b", [version(made("ablation", best, "cloth", ms=1.0), "new", 2.0)])
    (found,) = [r for text, r in judged(tmp_path).items() if text.startswith("Ours")]
    assert found["verdict"] == claims.HOLDS
    assert (
        "cloth 0.50; ours of ablation, a later version than in frame_time and not of one run"
        in found["numbers"]
    )
    text = (tmp_path / "claims.md").read_text()
    assert f"Records of an earlier version of {_paper.METHOD}: frame_time." in text


def test_a_cpu_decides_nothing_about_times(tmp_path):
    records = [made("figure2", e, "buddha", ms=ms, counters={"primary tests, most": most})
               for e, ms, most in zip(figure2.METHODS[:2], (14.0, 10.0), (9, 4), strict=True)]  # fmt: skip
    for r in records:
        r["method"].update(device="cpu")
    keep(tmp_path / "figure2", records)
    found = judged(tmp_path)
    assert found["Indirect mapping makes Buddha 30-50 % faster"]["verdict"] == claims.OPEN
    assert "40% faster" in found["Indirect mapping makes Buddha 30-50 % faster"]["numbers"]
    dropped = next(r for text, r in found.items() if "drop by more than half" in text)
    assert dropped["verdict"] == claims.HOLDS
