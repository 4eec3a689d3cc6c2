"""The paper's claims: their verdicts follow from the records of all experiments."""

import shutil

import pandas as pd
import pytest
from helpers.experiment_records import record_of, write_records
from shadowbench.experiments import claims as judges
from shadowbench.experiments import figure2, figure11, key_bits, reflection
from shadowbench.experiments.ablation import BASE, CULLED, EXACT
from shadowbench.experiments.claims import CLAIMS
from shadowbench.harness.commands.show import show
from shadowbench.harness.errors import UserError
from shadowbench.harness.report import claims
from shadowbench.harness.report.claims import collect
from shadowbench.harness.runner.planning.experiment import Entry, Lighting, find_experiment

pytestmark = pytest.mark.usefixtures("unpainted")

SIX = (*judges.LARGE, *judges.SMALL)
JUDGED = (
    BASE, "direct mapping, 16x16 tiles", "direct mapping, 8x8 tiles", "4x4 of 4x4 tiles", EXACT, CULLED, "cube map",
    "light not clamped", "all of ours", "Warp's tree rebuilt",
)  # fmt: skip
"""The points of the ablation that claims ask for."""


def judged(folder):
    """What ``show claims`` wrote of each claim."""
    show("claims", folder, quiet=True)
    table = pd.read_csv(folder / "claims.csv", keep_default_na=False)
    return {row["claim"]: row for row in table.to_dict("records")}


def starting(folder, text):
    """The row of the claim that begins so: what :func:`judged` gives of it, without judging the others."""
    (claim,) = [one for one in CLAIMS if one.text.startswith(text)]
    (row,) = claims.judge_all([claim], collect(folder)).to_dict("records")
    return row


def entries(name):
    return {e.label or e.method: e for e in find_experiment(name).presets["paper"].methods}


def ablated(label, ms, scene="cloth", **counters):
    return record_of("ablation", entries("ablation")[label], scene, ms=ms, counters=counters)


def unbalanced(clamp="none"):
    like = next(e for e in figure11.entries(128, ("64",)) if e.settings["clamp"] == clamp and
                e.settings["aimed"] == "true" and e.settings["precision"] == "float64")  # fmt: skip
    return [Entry(like.method, {**like.settings, "r": r}, f"{clamp} r = {r}") for r in ("32", "64", "65536")]


def moved(times, clamp="none", scene="cloth"):
    """Records of figure11: milliseconds of r = 32, 64 and 65536, by the light's distance."""
    lights = {x.distance: x for x in figure11.distances(*times)}
    return [
        record_of("figure11", e, scene, lights[d], ms=ms, passes=[("light 0: shadow rays", "shadow", ms)])
        for d, all_ms in times.items()
        for e, ms in zip(unbalanced(clamp), all_ms, strict=True)
    ]


def sorted_pairs(size, times):
    records = []
    for bits, ms in zip(key_bits.BITS, times, strict=True):
        record = record_of("key_bits", Entry("sort", {"bits": str(bits)}, f"{bits} bits"), "random pairs", size=size,
                      passes=[("copy pairs", "build", 0.1), ("sort pairs", "build", ms)])  # fmt: skip
        record["point"].update(bits=bits, pairs=size * size)
        records.append(record)
    return records


def everything():
    """Records that decide every claim."""
    compared, methods = entries("frame_time"), entries("two_lights")
    two = find_experiment("two_lights").presets["paper"].lightings[1]
    faithful = entries("figure10")[BASE]
    passes = [("build", "build", 2.0), ("primary rays", "trace", 3.0), ("light 0: map rays", "shadow", 1.0),
              ("light 0: shadow rays", "shadow", 4.0)]  # fmt: skip
    small = [(name, part, ms * 0.5) for name, part, ms in passes]
    return [
        *(record_of("figure2", e, "buddha", ms=ms, counters={"primary tests, most": most})
          for e, ms, most in zip(figure2.METHODS[:2], (14.0, 10.0), (9, 4), strict=True)),
        *(record_of("figure10", faithful, scene, passes=passes, size=64) for scene in SIX),
        *(record_of("figure10", faithful, scene, passes=small, size=32) for scene in SIX),
        *(ablated(label, 10.0 + i, scene, **{"camera pairs": 100 - i})
          for i, label in enumerate(JUDGED) for scene in SIX),
        *(record_of("frame_time", compared[label], scene, ms=ms) for scene in SIX for label, ms in
          (("ray grids", 0.5), ("the paper's grids", 1.0), (BASE, 1.5), ("mesh rebuilt", 2.0), ("uniform grid", 3.0))),
        *(record_of("two_lights", methods[label], "fairy", two, ms=ms)
          for label, ms in ((BASE, 4.0), ("the paper's grids", 2.0), ("mesh rebuilt", 3.0))),
        *(record_of("reflection", e, scene, reflection.LIGHTINGS[2], ms=10.0, passes=[*passes, (BOUNCE, "trace", ms)])
          for e, ms in ((reflection.GRIDS[0], 4.0), (reflection.TREES[0], 2.0)) for scene in SIX),
        *moved({1.0: (2.0, 3.0, 3.0), 100.0: (2.0, 3.0, 9.0)}),
        *sorted_pairs(64, (1.0, 2.0, 2.0, 3.0, 3.0, 3.0, 4.0)),
    ]  # fmt: skip


BOUNCE = "bounce 1: mirrored rays"


def test_every_claim_has_a_verdict_and_says_what_is_missing(tmp_path):
    write_records(tmp_path / "a", [record_of("figure2", figure2.METHODS[0], "buddha")])
    found = judged(tmp_path)
    assert (len(found), {r["verdict"] for r in found.values()}) == (len(CLAIMS), {claims.UNMEASURED})
    assert all("run " in r["numbers"] for r in found.values())
    text = (tmp_path / "claims.md").read_text()
    assert text.count("**not measured**") == len(CLAIMS)
    assert (
        f"Verdicts on {len(CLAIMS)} claims: holds 0, does not hold 0, can't tell 0, not measured {len(CLAIMS)}." in text
    )
    with pytest.raises(UserError, match="no records in it"):
        show("claims", tmp_path / "a" / "records", quiet=True)


@pytest.fixture(scope="module")
def together(tmp_path_factory):
    """A folder with the records of :func:`everything`, a run an experiment."""
    folder = tmp_path_factory.mktemp("together")
    for record in everything():
        write_records(folder / record["experiment"], [record])
    return folder


def test_a_claim_that_compares_is_judged_within_one_run_or_not_at_all(together, tmp_path):
    """A run an experiment decides every claim; with a run of its own for each record only those claims are decided that
    look at one record at a time. Then two scenes
    stand for the six in two experiments, and one in the ablation but for three of its methods.
    """
    found = judged(together)
    assert [r["claim"] for r in found.values() if r["verdict"] == claims.UNMEASURED] == []
    assert all(r["judged_from"] in claim.experiments for claim, r in zip(CLAIMS, found.values(), strict=True))
    large, small = SIX[0], SIX[4]
    ablated_twice = {(small, label) for label in (BASE, CULLED, EXACT)}
    kept = {"frame_time": SIX[::4], "reflection": SIX[::4]}
    for i, record in enumerate(everything()):
        experiment, scene, label = record["experiment"], record["scene"]["name"], record["method"]["label"]
        one_of = scene == large or (scene, label) in ablated_twice
        if one_of if experiment == "ablation" else scene in kept.get(experiment, (scene,)):
            write_records(tmp_path / "apart" / f"run{i}", [record])
    alone = ("Interactive rates", "Building the grid", "Shadow traversal", "Rearranging the shadow rays")
    for text, r in judged(tmp_path / "apart").items():
        if text.startswith(alone):
            assert r["judged_from"], text
        else:
            assert r["verdict"] == claims.UNMEASURED, text


def test_culling_is_judged_with_the_exact_test_and_wrong_answers_are_named(tmp_path):
    write_records(tmp_path / "a", [ablated(BASE, 10.0, "buddha", **{"camera pairs": 100})])
    found = starting(tmp_path, "Culling")
    assert found["verdict"] == claims.UNMEASURED
    assert "a closed scene culled with the exact triangle test is not measured; run ablation" in found["numbers"]
    culled = ablated(CULLED, 8.0, "buddha", **{"camera pairs": 48})
    write_records(tmp_path / "a", [culled, ablated(EXACT, 10.0, "buddha", **{"camera pairs": 100})])
    found = starting(tmp_path, "Culling")
    assert found["verdict"] == claims.HOLDS
    assert "pairs buddha 0.48; build time buddha 0.80" in found["numbers"]
    culled["frames"][0]["score"]["true_errors"] = 3
    write_records(tmp_path / "a", [culled])
    found = starting(tmp_path, "Culling")
    assert found["verdict"] == claims.OPEN
    assert "wrong answers: buddha 3" in found["numbers"]


def test_the_resolution_is_judged_between_sizes_of_one_run_and_the_runs_that_there_are_are_told(tmp_path):
    passes = [("light 0: map rays", "shadow", 3.0), ("primary rays", "trace", 1.0)]
    low = record_of("figure10", entries("figure10")[BASE], "cloth", passes=passes, size=32, frames=3)
    high = record_of("figure10", entries("figure10")[BASE], "cloth", passes=[(n, p, 2 * x) for n, p, x in passes])
    high["method"]["source_sha256"] = "0123456789"
    write_records(tmp_path / "one", [high])
    write_records(tmp_path / "two", [low])
    found = starting(tmp_path, "... and depends")
    assert found["verdict"] == claims.UNMEASURED
    for word in ("not to be mixed", "one (64x64; perspective_spherical 01234567)", "two (32x32; ",
                 "run figure10"):  # fmt: skip
        assert word in found["numbers"], word
    lit = Lighting("two", count=2)
    another = record_of("figure10", entries("figure10")[BASE], "cloth", passes=passes, size=32, lighting=lit)
    write_records(tmp_path / "two", [{**another, "rounds": [{"run": "another"}]}])
    assert "2 runs of two (32x32; " in starting(tmp_path, "... and depends")["numbers"]
    shutil.rmtree(tmp_path / "two")
    write_records(tmp_path / "two", [low])
    del high["method"]["source_sha256"]
    write_records(tmp_path / "one", [high, low])
    found = starting(tmp_path, "... and depends")
    assert found["verdict"] == claims.HOLDS
    assert "2.0 times the time for 4 times the pixels (cloth 2.00)" in found["numbers"]


@pytest.mark.parametrize(("times", "verdict", "words"), [
    # Without balancing (the last of three) the far light is 9 times as slow; with it hardly.
    ({1.0: (2.0, 3.0, 2.0), 100.0: (4.0, 2.5, 18.0)}, claims.HOLDS, "1 radius 1.00, 100 radii 7.20"),
    # Balancing helps alike everywhere: where the light stands costs what it did.
    ({1.0: (2.0, 3.0, 4.0), 100.0: (18.0, 19.0, 36.0)}, claims.FAILS, "9.00 without, 9.00 with it"),
    # It helps nowhere.
    ({1.0: (2.0, 3.0, 2.0), 100.0: (18.0, 19.0, 18.0)}, claims.FAILS, "100 radii 1.00"),
    # It helps, and leaves nine times the time: that is no compensation.
    ({1.0: (2.0, 3.0, 2.2), 100.0: (18.0, 19.0, 22.0)}, claims.FAILS, "10.00 without, 9.00 with it"),
])  # fmt: skip
def test_load_balancing_is_held_against_none_at_every_distance(tmp_path, times, verdict, words):
    write_records(tmp_path / "a", moved(times) + moved(times, "hits"))
    found = starting(tmp_path, "Load balancing")
    assert found["verdict"] == verdict
    assert words in found["numbers"]
    assert "clamped to the hits, without balancing" in found["numbers"]


def test_without_an_unbalanced_curve_load_balancing_is_not_measured(tmp_path):
    write_records(
        tmp_path / "a", [r for r in moved({1.0: (2, 3, 4), 9.0: (2, 3, 9)}) if r["method"]["settings"]["r"] != "65536"]
    )
    write_records(tmp_path / "b", [ablated("no load balancing", 15.0), ablated(BASE, 10.0)])
    found = starting(tmp_path, "Load balancing")
    assert found["verdict"] == claims.UNMEASURED
    assert "without load balancing (r = 65536) at two distances is not measured; run figure11" in found["numbers"]


@pytest.mark.parametrize(("times", "verdict"), [
    ((1.0, 2.0, 2.0, 3.0, 3.0, 3.0, 4.0), claims.HOLDS), ((1.0, 2.0, 1.0, 3.0, 3.0, 3.0, 4.0), claims.OPEN),
    ((4.0, 4.0, 4.0, 4.0, 4.0, 4.0, 4.0), claims.FAILS),
])  # fmt: skip
def test_key_bits_are_judged_at_equal_numbers_of_pairs(tmp_path, times, verdict):
    write_records(tmp_path / "a", sorted_pairs(64, times) + sorted_pairs(128, times))
    found = starting(tmp_path, "Sorting costs less")
    assert found["verdict"] == verdict
    assert "4,096 pairs" in found["numbers"]
    assert "16,384 pairs" in found["numbers"]
    assert f"18 {times[3] / 4:.2f}" in found["numbers"]


def test_a_cpu_decides_nothing_about_times(tmp_path):
    records = [record_of("figure2", e, "buddha", ms=ms, counters={"primary tests, most": most})
               for e, ms, most in zip(figure2.METHODS[:2], (14.0, 10.0), (9, 4), strict=True)]  # fmt: skip
    for r in records:
        r["method"].update(device="cpu")
    write_records(tmp_path / "figure2", records)
    found = judged(tmp_path)
    assert found["Indirect mapping makes Buddha 30-50 % faster"]["verdict"] == claims.OPEN
    assert "40% faster" in found["Indirect mapping makes Buddha 30-50 % faster"]["numbers"]
    dropped = next(r for text, r in found.items() if "drop by more than half" in text)
    assert dropped["verdict"] == claims.HOLDS
