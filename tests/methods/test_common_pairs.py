"""How much room a list gets that did not suffice, or only just."""

import pytest
from shadowbench.harness.errors import CapacityRejected
from shadowbench.methods.common.pairs import PAIR_BYTES, SPARE, grown

AMPLE = 1 << 30


@pytest.mark.parametrize(("needed", "capacity", "room"), [(0, 0, 0), (1, 1, 1), (1600, 1600, 1600), (1600, 1599, 3157)])
def test_a_list_whose_need_is_always_the_same_has_room_for_it(needed, capacity, room):
    assert grown(needed, capacity, AMPLE, "pairs") == room


@pytest.mark.parametrize(
    ("needed", "capacity", "room"),
    [(0, 0, 0), (1, 1, 1), (1600, 2400, 2400), (1600, 2399, 4624), (1_325_773, 1_756_272, 2_984_012)],
)
def test_what_another_run_of_the_frame_may_need_is_there(needed, capacity, room):
    """The last: 1,970,326 pairs were seen after 1,325,773. A run that needs so much more asks for no more room."""
    assert grown(needed, capacity, AMPLE, "pairs", varies=True) == room
    assert room >= needed + needed // SPARE
    if room > capacity:
        assert grown(needed + needed // SPARE, room, AMPLE, "pairs", varies=True) == room


def test_what_fits_is_not_rejected_for_want_of_room_to_spare():
    memory = 1000 * PAIR_BYTES
    assert grown(990, 1000, memory, "pairs", varies=True) == 1000
    assert grown(990, 500, memory, "pairs", varies=True) == 1000
    with pytest.raises(CapacityRejected, match="needs 1,001 pairs"):
        grown(1001, 1000, memory, "pairs", varies=True)
