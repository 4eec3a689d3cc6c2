"""What takes long takes turns: each run of the tests has a part of it, and a few runs in turn have all.

``SHADOWBENCH_TURN`` is the number of the turn. ``make test`` gives 0, CI what ``.ci/turn`` prints; without it nothing is
left out, as in ``make test-all``.
"""

import os

PLACE = "SHADOWBENCH_TURN"

_given = os.environ.get(PLACE, "all")
TURN = None if _given == "all" else int(_given)
"""The number of the turn; None: of all."""

PARTS = 4
"""Of so many tests that are marked as slow, one has its turn."""


def in_turn(place: int, every: int) -> bool:
    """Whether it is the turn of what has this place in a list, of which every so many-th one has it."""
    return TURN is None or (place + TURN) % every == 0
