"""The points of a scene are measured in turn, whatever their method and lighting."""

from types import SimpleNamespace

import pytest
from helpers.tiny_runs import options, write_scene
from shadowbench.harness.runner.planning.experiment import Entry
from shadowbench.harness.runner.progress import Silent
from shadowbench.harness.runner.run import Run
from shadowbench.harness.runner.workers import pool as workers
from shadowbench.harness.scene.overrides import Lighting

LIGHTINGS = (Lighting("one", count=1), Lighting("two", count=2), Lighting("moved", count=1, moved="all"))
ENTRIES = [Entry("warp_bvh", {}, "a"), Entry("warp_bvh", {"leaf_size": "8"}, "b")]


@pytest.fixture
def chosen(tmp_path):
    scene = write_scene(tmp_path / "scene-1.obj")
    return options(tmp_path / "out", [scene], ENTRIES, frames=1, lightings=LIGHTINGS, score=True)


class Stops(Silent):
    """Stops the run, as Ctrl-C does, at the given step; keeps the estimates of the remaining time."""

    def __init__(self, step: int = -1):
        self.step, self.measured = step, 0
        self.given: list[float] = []

    def left(self, seconds):
        self.given.append(seconds)

    def doing(self, what, who=""):
        self.measured += "measuring" in what
        if self.measured == self.step:
            raise KeyboardInterrupt


def order(records):
    """The lighting of each round of each point in the order of time, as pairs of round and label."""
    rounds = [(r["started"], r["round"], one.scene["lighting"]["label"]) for one in records for r in one.rounds]
    return [(number, label) for _, number, label in sorted(rounds)]


def test_every_lighting_has_its_first_round_before_any_has_its_second(chosen, monkeypatch):
    """Also where memory is short, so that a worker holds one point at a time."""
    held, report, command = [], Stops(), workers.Workers.command

    def watched(self, worker, **sent):
        held.extend([len(self._held)] if sent["do"] == "round" else [])
        return command(self, worker, **sent)

    monkeypatch.setattr(workers.Workers, "command", watched)
    monkeypatch.setattr(workers, "ROOM", 2.0)
    records = Run(chosen, report).go()
    assert report.given[-2:] == [0.0, 0.0], "after the last round of the only scene there is nothing left"
    assert held == [1] * 12
    taken = order(records)
    assert [number for number, _ in taken] == [0] * 6 + [1] * 6
    assert {label for _, label in taken[:6]} == {"one", "two", "moved"}
    labels = [label for _, label in taken]
    assert labels[:6] == labels[6:][::-1]
    assert [one.scene["lighting"]["label"] for one in records] == ["one"] * 2 + ["two"] * 2 + ["moved"] * 2
    assert all(one.frames[0].score for one in records)
    assert list((chosen.out / "journal").iterdir()) == []


@pytest.mark.slow
def test_an_interrupted_run_of_lightings_takes_only_the_missing_rounds(chosen):
    with pytest.raises(KeyboardInterrupt):
        Run(chosen, Stops(8)).go()
    again = Stops()
    records = Run(chosen, again).go()
    assert again.measured == 12 - 7
    assert [(one.status, len(one.rounds)) for one in records] == [("ok", 2)] * 6
    assert all(one.frames[0].score for one in records)
    assert list((chosen.out / "journal").iterdir()) == []


@pytest.mark.parametrize(("seconds", "spent"), [(3.0, False), (3.3, True)])
def test_rounds_are_left_out_where_the_budget_is_exceeded_by_more_than_a_quarter(chosen, seconds, spent):
    """Each round may take half of the budget of 5 s."""
    taken = SimpleNamespace(journal=SimpleNamespace(rounds=lambda: {0: {"spent_s": seconds}}))
    assert Run(chosen, Silent())._spent(taken) == spent
