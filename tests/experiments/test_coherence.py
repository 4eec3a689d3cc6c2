"""Frames in sequence: what comes before a timed frame, and what the experiment makes of it."""

import dataclasses
import re

import numpy as np
import pytest
from helpers.experiment_records import csv_of
from shadowbench.experiments import _played, coherence
from shadowbench.experiments._played import Played, moment_before
from shadowbench.harness.commands.run import plan_run
from shadowbench.harness.commands.show import show
from shadowbench.harness.errors import UserError
from shadowbench.harness.runner.progress import Silent
from shadowbench.harness.scene.catalogue import resolve
from shadowbench.harness.scene.prepared import Prepared, prepare

pytestmark = pytest.mark.usefixtures("unpainted")

SIZE = 48, 40
FRAME = 5


@pytest.fixture(scope="module")
def cloth() -> Prepared:
    return prepare(resolve("cloth", None))


def settled(one: Played) -> int:
    return sum(value for name, value in one.method.counters().items() if "settled" in name)


def tiny(out, **changes):
    options = plan_run("coherence", preset="quick", device="cpu", out=out, size="24x24", scenes=["cloth"])
    return dataclasses.replace(options, preset=dataclasses.replace(options.preset, **changes))


def test_the_moment_before_lies_between_two_frames(cloth):
    this = cloth.moment(FRAME, *SIZE)
    (light,) = this.lights
    camera = cloth.scene.camera
    for share in (0.0, 0.25, 1.0):
        before = moment_before(cloth, FRAME, share, *SIZE)
        mean = (1 - share) * this.points + share * cloth.points(FRAME - 1)[0]
        np.testing.assert_allclose(before.points, mean, atol=1e-5)
        moved = np.linalg.norm(before.lights[0] - light)
        arm = np.subtract(camera.eye, camera.target)
        circle = np.linalg.norm(np.cross(arm, camera.up)) / np.linalg.norm(camera.up)
        way = 2 * circle * np.sin(np.pi * _played.CAMERA_TURN * share)
        assert np.linalg.norm(before.eye - this.eye) == pytest.approx(way, rel=1e-3, abs=1e-9)
        assert (moved > 0.0) == (share > 0.0)
    np.testing.assert_array_equal(moment_before(cloth, FRAME, 0.0, *SIZE).points, this.points)


@pytest.mark.slow
def test_a_timed_frame_finds_what_the_one_before_it_left(cloth, device):
    this = cloth.moment(FRAME, *SIZE)
    counts = {}
    for label in ("at rest", "1/64 step", "1 step"):
        before = moment_before(cloth, FRAME, coherence.STEPS[label], *SIZE)
        plain, kept, first = (
            Played(entry, cloth, SIZE, device, entry is coherence.FIRST) for entry in coherence.METHODS
        )
        expected = plain.answers(before, this)
        for one in (kept, first):
            assert _played.differing(one.answers(before, this), expected) == 0
            pair = one.keep(before), one.keep(this)
            assert (len(one.samples(*pair, 2)), _played.differing(one.timed_answers(*pair), expected)) == (2, 0)
        assert settled(first) == 0
        counts[label] = settled(kept)
    assert counts["at rest"] > counts["1/64 step"] > counts["1 step"]


def test_differing_counts_bits():
    given = {"t": np.array([1.0, -0.0, np.nan], np.float32), "shadowed": np.array([[0, 1]], np.uint8)}
    other = {"t": np.array([1.0, 0.0, np.nan], np.float32), "shadowed": np.array([[1, 1]], np.uint8)}
    assert (_played.differing(given, given), _played.differing(given, other)) == (0, 2)


@pytest.mark.slow
def test_a_timed_frame_knows_only_what_the_frame_before_it_left():
    scene = prepare(resolve("bunny_dragon", None))
    frame = scene.frame_count - 1
    this, before = scene.moment(frame, *SIZE), moment_before(scene, frame, 1.0, *SIZE)
    one = Played(coherence.NEXT, scene, SIZE, "cpu")
    one.forget()
    for moment in (before, this):
        one.session.answers(moment)
    alone = settled(one)
    one.session.answers(before)
    one.session.answers(this)
    assert settled(one) > alone, "pixels without a ray in the frame before keep what an older frame left"
    one.answers(before, this)
    assert settled(one) == alone
    kept = one.keep(before), one.keep(this)
    for _ in range(2):
        one.timed_answers(*kept)
        assert settled(one) == alone


@pytest.mark.slow
def test_coherence_runs_draws_goes_on_and_tells(tmp_path):
    options = tiny(tmp_path / "out", samples=2, rounds=2)
    measure = coherence.EXPERIMENT.measure
    records = measure(options, Silent())
    assert len(records) == len(coherence.STEPS) * len(coherence.METHODS)
    assert {record.status for record in records} == {"ok"}
    assert all(len(record.frames[0].total_ms) == 4 for record in records), "two rounds of two samples"
    assert all(record.frames[0].score.true_errors == 0 for record in records)
    assert [record.key for record in measure(options, Silent())] == [record.key for record in records]
    files = show("coherence", tmp_path / "out", quiet=True)
    assert {file.name for file in files} == {"coherence.csv", "coherence.svg", "coherence.md"}
    text = (tmp_path / "out" / "coherence.md").read_text()
    assert "| scene | setting | at rest | 1/64 step | 1/16 step | 1/4 step | 1 step |" in text
    assert "| Cloth (stand-in) | last occluders first |" in text
    assert "Every answer behind these times was found right" in text
    assert re.search(r"a frame takes ~?[\d.]+ times as long \(at rest\) and ~?[\d.]+ times as long \(1 step\)\.", text)
    rows = {(row["label"], row["light_label"]): row for row in csv_of("coherence", tmp_path / "out")}
    assert rows[coherence.NONE.label, "1 step"]["ratio"] == "1"
    shares, none = (
        [float(rows[entry.label, step]["settled"]) for step in coherence.STEPS] for entry in coherence.METHODS[1:]
    )
    assert shares[0] > 0.8
    assert (shares, none) == (sorted(shares, reverse=True), [0.0] * len(coherence.STEPS))


@pytest.mark.parametrize(("wrong", "said"), [
    ({"methods": ["ray_grids", "bvh2"]}, "--method bvh2: coherence measures ray_grids alone"),
    ({"scenes": ["mirrored.toml"]}, "mirrored.toml: ray_grids cannot trace it: mirror: "),
])  # fmt: skip
def test_what_coherence_cannot_compare_is_refused_before_it_runs(tmp_path, monkeypatch, wrong, said):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mirrored.toml").write_text('mesh = "cloth"\n[mirror]\nshare = 0.5\n')
    options = plan_run("coherence", preset="quick", device="cpu", out=tmp_path / "out", **wrong)
    with pytest.raises(UserError, match=said):
        coherence.EXPERIMENT.measure(options, Silent())
    assert not (tmp_path / "out").exists()


def test_where_nothing_is_shadowed_no_share_is_told(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "dark.toml").write_text('mesh = "cloth"\nlights = []\n')
    options = plan_run(
        "coherence", preset="quick", device="cpu", out=tmp_path / "out", size="24x24", scenes=["dark.toml"]
    )
    preset = dataclasses.replace(options.preset, samples=1, rounds=1)
    coherence.EXPERIMENT.measure(dataclasses.replace(options, preset=preset), Silent())
    show("coherence", tmp_path / "out", quiet=True)
    text = (tmp_path / "out" / "coherence.md").read_text()
    assert "nan" not in text
    assert "last occluders first" in text


def test_a_timed_frame_with_other_answers_is_an_error(tmp_path, monkeypatch):
    options = tiny(tmp_path / "out", samples=1, rounds=1)
    right = Played.timed_answers

    def wrong(self, *kept):
        answers = right(self, *kept)
        answers["triangle"][0] += 1
        return answers

    monkeypatch.setattr(Played, "timed_answers", wrong)
    with pytest.raises(RuntimeError, match="1 timed answers of frame"):
        coherence.EXPERIMENT.measure(options, Silent())
