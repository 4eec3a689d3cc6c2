"""How much room a list gets that did not suffice, or only just."""

from __future__ import annotations

import pytest
from shadowbench.harness.errors import CapacityRejected
from shadowbench.methods.common.pairs import PAIR_BYTES, SPARE, grown

AMPLE = 1 << 30


@pytest.mark.parametrize(
    ("needed", "capacity", "room"),
    [(0, 0, 0), (1, 1, 1), (1600, 1700, 1700), (1600, 1699, 3157), (1700, 1699, 3290), (322_167, 327_680, 430_580)],
)
def test_what_another_run_of_the_frame_may_need_is_there(needed, capacity, room):
    """A count may differ from run to run: capacity that suffices for one run only just is raised before the next."""
    assert grown(needed, capacity, AMPLE, "pairs") == room
    assert grown(needed, room, AMPLE, "pairs") == room
    assert room >= needed + needed // SPARE


def test_what_fits_is_not_rejected_for_want_of_room_to_spare():
    memory = 1000 * PAIR_BYTES
    assert grown(990, 1000, memory, "pairs") == 1000
    assert grown(990, 500, memory, "pairs") == 1000
    with pytest.raises(CapacityRejected, match="needs 1,001 pairs"):
        grown(1001, 1000, memory, "pairs")
