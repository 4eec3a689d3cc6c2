"""Ratios of the frame-time experiment, from made-up rows."""

from __future__ import annotations

import pytest
from shadowbench.harness.figures import frame_time


def row(label: str, scene: str, total: float, between: float = 0.0) -> dict:
    return {
        "label": label, "scene": scene, "scene_title": scene.title(), "stand_in": None, "total_ms": total,
        "between_ms": between, "status": "ok", "key": label + scene,
    }  # fmt: skip


def test_ratio_is_to_the_fastest_of_its_kind_and_carries_the_rounds_range():
    rows = [
        row("ours", "a", 2.0, 0.2),
        row("slow", "a", 10.0),
        row("fast", "a", 6.0, 0.4),
        row("ours", "b", 1.0),
        row("fast", "b", 3.0),
        {**row("slow", "b", 1.0), "status": "failed", "total_ms": None},
    ]
    frame_time.add(rows, "ours")
    best = frame_time.fastest(rows, "a", ["slow", "fast"])
    assert best is not None
    assert best["label"] == "fast"
    assert best["times_slower"] == pytest.approx(3.0)
    assert (best["low"], best["high"]) == (pytest.approx(5.8 / 2.1), pytest.approx(6.2 / 1.9))
    said = " ".join(frame_time.sentences(rows, "ours", {"rebuild": ["slow", "fast"], "refit": ["none"]}))
    assert "Least 3.00, geometric mean 3.00" in said
    assert "refit" not in said


def test_without_our_method_nothing_is_claimed():
    rows = [row("fast", "a", 3.0)]
    frame_time.add(rows, "ours")
    assert frame_time.sentences(rows, "ours", {"rebuild": ["fast"]}) == ["ours was not measured."]
