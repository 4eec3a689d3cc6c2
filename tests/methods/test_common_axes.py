"""Axes of vectors (``axes.py``), and their casts, sums and largest coordinates (``vectors.py``), as Python runs them;
and how much room a list (``common/pairs.py``) gets that did not suffice, or only just.
"""

import numpy as np
import pytest
import warp as wp
from shadowbench.harness.errors import CapacityRejected
from shadowbench.harness.frame.vectors import largest, to_float32, to_float64, total
from shadowbench.methods.common.axes import axes_along, brought_nearer, longest_axis
from shadowbench.methods.common.pairs import PAIR_BYTES, SPARE, grown


@pytest.mark.parametrize("kind", [wp.vec3f, wp.vec3d])
@pytest.mark.parametrize("axis", range(3))
def test_the_largest_coordinate_and_the_sum_count_no_sign(kind, axis):
    values = np.roll([-4.0, 1.0, -2.0], axis)
    assert (float(largest(kind(*values))), float(total(kind(*values)))) == (4.0, 7.0)


def test_casts_round_once_and_to_float32_only():
    rounded = np.array([0.1, -0.2, 0.3], dtype=np.float32).tolist()
    assert list(to_float64(wp.vec3f(0.1, -0.2, 0.3))) == rounded
    assert list(to_float32(wp.vec3d(0.1, -0.2, 0.3))) == rounded


@pytest.mark.parametrize(("vector", "axis"), [((1, 2, 2), 1), ((1, 3, 2), 1), ((1, 2, 3), 2), ((2, 2.5, 3), 2)])
def test_the_first_of_the_longest_axes(vector, axis):
    """Axis 0 is left to kernels: Python does not index by Warp's integers."""
    assert longest_axis(wp.vec3f(*vector)) == axis


def test_a_light_is_brought_nearer_along_its_direction():
    place, most = wp.vec3f(3.0e30, -1.0e30, 7.0e20), 1.0e19
    near = brought_nearer(place, most)
    assert most / 4 < float(largest(near)) <= most
    share = np.array(place) / np.array(near)
    assert (len(set(share)), np.log2(share[0]) % 2, brought_nearer(near, most)) == (1, 0, near)
    assert np.isinf(brought_nearer(wp.vec3f(wp.INF, 1.0, 0.0), most)[0])


@pytest.mark.parametrize("seed", range(8))
def test_axes_along_a_direction_are_a_rotation(seed):
    forward = np.eye(3)[seed] if seed < 3 else np.random.default_rng(seed).normal(size=3)
    forward = forward / np.linalg.norm(forward)
    axes = np.array(axes_along(wp.vec3d(*forward))).reshape(3, 3)
    np.testing.assert_array_equal(axes[0], forward)
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-15)
    np.testing.assert_allclose(np.cross(axes[1], axes[0]), axes[2], atol=1e-15)
    assert axes[2, 1] >= 0 or abs(forward[1]) > 0.8, "y points up"


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
