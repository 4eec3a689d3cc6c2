"""Methods that misbehave, through the command verify: tests/runner/test_run.py has them in runs."""

import json

import pytest
from helpers import misbehaving_methods
from helpers.right_and_wrong_methods import Point
from helpers.tiny_runs import write_scene
from shadowbench.harness.commands.verify import verify
from shadowbench.harness.frame import registry
from shadowbench.harness.frame.warp_init import start_warp

start_warp()


CHANGED = "repeat {} of the same frame gave different answers: {}"


@pytest.mark.parametrize(
    ("method", "limit", "status", "reason"),
    [
        ("steady", 1 << 20, "ok", ""),
        ("once", None, "failed", CHANGED.format(1, "triangle, t, u, v")),
        ("slow_start", None, "failed", CHANGED.format(1, "triangle, t")),
        ("fickle", None, "failed", CHANGED.format(8, "shadowed")),
        ("greedy", 1 << 20, "rejected", "the limit is 1,048,576"),
        ("hoards", 1 << 20, "rejected", "the limit is 1,048,576"),
        ("greedy", None, "ok", ""),
    ],
)
def test_verify_finds_it(monkeypatch, capsys, tmp_path, method, limit, status, reason):
    known = {cls.name: Point(cls) for cls in misbehaving_methods.CLASSES}
    monkeypatch.setattr(registry, "_entry_points", lambda: known)
    away = ("0.2,0.2,5", "0.2,0.2,9")  # every ray misses, as these methods answer
    scene = write_scene(tmp_path / "tetra.obj")
    options = {"size": "8x8", "device": "cpu", "camera": away, "memory_limit": limit, "as_json": True}
    code = verify([scene], [method], **options)
    (row,) = json.loads(capsys.readouterr().out)["scenes"][0]["methods"]
    assert row["status"] == status
    assert row["reason"].endswith(reason)
    assert code == (status == "failed")
