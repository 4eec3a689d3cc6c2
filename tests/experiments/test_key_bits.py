"""Sorting by so many bits of a key: measured as frames are, in records that the claims can read."""

import dataclasses
import re

import numpy as np
import pytest
from helpers.tiny_runs import write_scene
from shadowbench.experiments.key_bits import BITS, EXPERIMENT, Trial
from shadowbench.harness.commands.run import plan_run
from shadowbench.harness.commands.show import show
from shadowbench.harness.errors import UserError
from shadowbench.harness.report.claims import collect
from shadowbench.harness.runner.measuring.timing import Sampling, sample_frame
from shadowbench.harness.runner.progress import Silent

pytestmark = pytest.mark.usefixtures("unpainted")


def tiny(out, **changes):
    options = plan_run("key_bits", preset="quick", device="cpu", out=out, size="16x16")
    return dataclasses.replace(options, preset=dataclasses.replace(options.preset, **changes))


@pytest.mark.parametrize("bits", BITS)
def test_a_trial_sorts_unsorted_keys_again_in_every_sample(bits, device):
    trial = Trial(3000, bits, device, seed=1)
    keys = trial.unsorted.view(np.uint32).astype(np.uint64)
    assert keys.max() < 2**bits
    assert keys.max() >= 2 ** (bits - 1), "the highest bit is used too"
    assert trial.wrong() > 0, "nothing is sorted yet"
    found = sample_frame(trial, Sampling(samples=3, most=3, stage_samples=2, budget_s=5.0))
    assert trial.wrong() == 0
    assert len(found.total_ms) == 3
    assert [(p["name"], len(p["ms"])) for p in found.passes] == [("copy pairs", 2), ("sort pairs", 2)]
    trial.passes[0].run()  # the copy puts the unsorted pairs back: no sample sorts what is sorted
    assert trial.wrong() > 0


def test_the_same_random_keys_and_pairs_for_all_numbers_of_bits():
    trials = [Trial(500, bits, "cpu", seed=2) for bits in (8, 18, 32)]
    whole = trials[2].unsorted.view(np.uint32)
    for trial in trials:
        assert (trial.unsorted.view(np.uint32) == whole >> np.uint32(32 - trial.bits)).all()


def test_key_bits_runs_draws_goes_on_and_is_read(tmp_path):
    options = tiny(tmp_path / "out", samples=2, most=2, stage_samples=1, rounds=2)
    measure = EXPERIMENT.measure
    records = measure(options, Silent())
    assert [r.point["bits"] for r in records] == list(BITS)
    assert {r.point["pairs"] for r in records} == {256}
    assert all(len(r.frames[0].total_ms) == 4 for r in records), "two rounds of two samples"
    orders = [[r.rounds[k]["place"] for r in records] for k in range(2)]
    assert orders[0] != orders[1], "rounds are interleaved in another order each"
    assert [r.key for r in measure(options, Silent())] == [r.key for r in records]
    assert len(list((tmp_path / "out" / "records").glob("*.json"))) == len(BITS), "nothing was measured again"
    files = show("key_bits", tmp_path / "out", quiet=True)
    assert {f.name for f in files} == {"key_bits.csv", "key_bits.svg", "key_bits.md"}
    text = (tmp_path / "out" / "key_bits.md").read_text()
    assert "| sorted | 8 bits | 12 bits | 16 bits | 18 bits | 20 bits | 24 bits | 32 bits |" in text
    assert "| 256 pairs | " in text
    assert re.search(r"A sort by 18 bits, the paper's, takes \S+ times as long for 256 pairs as one by 32\.", text)
    assert "Every answer behind these times was found right" in text
    assert len((tmp_path / "out" / "key_bits.csv").read_text().splitlines()) == 1 + len(BITS)
    (evidence,) = collect(tmp_path).evidence("key_bits")
    assert len(evidence.frames) == len(BITS)


def test_key_bits_takes_no_scene_and_no_method(tmp_path):
    for asked in ({"scenes": [write_scene(tmp_path / "tetra.obj")]}, {"methods": ["warp_bvh"]}):
        options = plan_run("key_bits", preset="quick", device="cpu", out=tmp_path / "out", **asked)
        with pytest.raises(UserError, match="takes no --scene and no --method"):
            EXPERIMENT.measure(options, Silent())
