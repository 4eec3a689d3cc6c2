"""The kernels by which cards of a cluster are told apart (``calibration.py``): what they compute; they are timed."""

import numpy as np
import pytest
import warp as wp
from shadowbench.harness.runner.cluster import calibration
from shadowbench.harness.runner.cluster.calibration import Calibration, calibrate, copy_plus_one, multiply_add


def test_all_the_work_is_done():
    few, words = (wp.zeros(count, dtype=wp.float32, device="cpu") for count in (1030, 100))
    wp.launch(multiply_add, 1030, [3], [few], device="cpu")
    wp.launch(copy_plus_one, 100, [wp.array(np.arange(100.0), dtype=wp.float32, device="cpu")], [words], device="cpu")
    expected = np.arange(1030) % 1024 * 0.999**3 + 0.5 * (1 + 0.999 + 0.999**2)
    np.testing.assert_allclose(few.numpy(), expected, rtol=1e-6)
    np.testing.assert_array_equal(words.numpy(), np.arange(1, 101))


def test_both_kernels_are_timed(monkeypatch):
    launched, launch = [], wp.launch

    def noted(kernel, *given):
        launched.append(kernel)
        launch(kernel, *given)

    monkeypatch.setattr(wp, "launch", noted)
    monkeypatch.setattr(calibration, "WARM_S", 0.0)
    monkeypatch.setattr(calibration, "CPU", (16, 4, 16))
    found = calibrate("cpu")
    assert found.arithmetic_ms > 0.0
    assert found.memory_ms > 0.0
    assert [launched.count(kernel) for kernel in (multiply_add, copy_plus_one)] == [len(launched) / 2] * 2
    assert len(launched) >= 2 * calibration.SAMPLES.samples


def test_the_larger_difference_counts_whichever_card_is_faster():
    one, other = Calibration(10.0, 4.0), Calibration(10.1, 3.2)
    assert one.apart(other) == other.apart(one) == pytest.approx(0.25)
    assert one.apart(one) == 0.0
