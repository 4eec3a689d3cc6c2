"""A scene that is handed from one worker to others: the frames that are asked for, and always the first."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from shadowbench.harness.commands.run import plan_run
from shadowbench.harness.errors import UserError
from shadowbench.harness.moment import Prepared
from shadowbench.harness.plan import Entry
from shadowbench.harness.progress import Silent
from shadowbench.harness.run import Run
from shadowbench.harness.scenes.catalogue import resolve
from shadowbench.harness.share import Stored, store


def test_the_first_frame_is_always_there(tmp_path: Path) -> None:
    prepared = Prepared(resolve("cloth", None))
    middle = prepared.frame_count // 2
    store(tmp_path / "scene.npz", prepared, [middle])
    stored = Stored(tmp_path / "scene.npz", prepared.scene)
    for frame in (0, middle):
        np.testing.assert_array_equal(stored.points(frame)[0], prepared.points(frame)[0])
    with pytest.raises(UserError, match=rf"frame 1 was not stored; there are \[0, {middle}\]"):
        stored.points(1)


def test_every_tree_is_measured_where_only_a_middle_frame_is_asked_for(tmp_path: Path) -> None:
    """Found on a GPU: with one frame of an animation, trees that begin with its first frame did not find that."""
    entries = [
        Entry("accuracy_ladder", {}, "ladder"), Entry("bvh", {}, "rebuilt"),
        Entry("bvh", {"update": "refit"}, "refitted"), Entry("bvh", {"update": "bvh_rebuild"}, "in place"),
    ]  # fmt: skip
    options = plan_run(
        "table1", "quick", "cpu", ["cloth"], out=tmp_path / "out", size="24x24",
        overrides={"frames": 1, "rounds": 1, "samples": 1, "budget_s": 1.0}, score=False,
    )  # fmt: skip
    options = dataclasses.replace(options, preset=dataclasses.replace(options.preset, methods=tuple(entries)))
    records = Run(options, Silent()).go()
    assert [(record["method"]["label"], record["status"]) for record in records] == [
        (entry.label, "ok") for entry in entries
    ]
    assert all(record["frames"][0]["frame"] > 0 for record in records)
