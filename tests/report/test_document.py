"""What stands below the tables of a report."""

from __future__ import annotations

import pandas as pd
import pytest
from shadowbench.harness.report.document import effort


@pytest.mark.parametrize(
    ("taken", "told"),
    [
        (3, "3 rounds, at most 5 s of samples a point."),
        (
            1,
            "3 rounds, at most 5 s of samples a point. The budget was spent before the last round: Cloth, grid: 1 of 3.",
        ),
    ],
)
def test_points_that_the_budget_left_without_rounds_are_named(taken, told):
    row = {
        "title": "Cloth",
        "label": "grid",
        "rounds": taken,
        "point.rounds": 3,
        "point.budget_s": 5.0,
    }
    assert effort(pd.DataFrame([row])) == told
    assert effort(pd.DataFrame([row]).drop(columns=["point.rounds"])) == ""
