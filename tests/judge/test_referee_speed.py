"""The script that measures the referee runs, and what it times is the deciding of wrong answers. Nothing here times."""

import re

import pytest
from shadowbench.harness.judge.reference import embree_installed
from tools import referee_speed


@pytest.mark.skipif(not embree_installed(), reason="Embree finds the pixels")
def test_the_pixels_measured_are_decided(monkeypatch, capsys):
    monkeypatch.setattr(referee_speed, "SIDE", 96)
    referee_speed.report("bunny", 60)
    shown = capsys.readouterr().out
    assert re.search(r"bunny: [\d,]+ triangles, 96x96, 1 lights", shown)
    assert re.search(r"60 disputed pixels +\d+\.\d\d s", shown)
    triangles, bits = map(int, re.findall(r"(\d+) triangles and (\d+) bits are wrong", shown)[0])
    # Most answers planted are wrong, and are found to be; misses have no bit, some pixels no triangle.
    assert 40 < triangles <= 60
    assert 20 < bits <= 60
