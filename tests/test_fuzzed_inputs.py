"""A few hundred fuzzed inputs; tests/tools/fuzz_inputs.py tries as many as are asked for."""

from random import Random

import pytest
from helpers.fuzzed_inputs import READ, REFUSED, STOPPED, at_most, families
from shadowbench.harness.scene.readers import apart

FAMILIES = {name: family for name, (family, _) in families().items()}
CASES = {"files": 150, "records": 25}


@pytest.mark.parametrize("name", FAMILIES)
def test_every_input_ends_in_an_answer_or_in_one_line(tmp_path, monkeypatch, capfd, name):
    monkeypatch.setenv(apart.TIME, "20")
    found = set()
    for number in range(CASES.get(name, 40)):
        place = tmp_path / str(number)
        place.mkdir()
        with at_most(300):
            found.add(FAMILIES[name](Random(f"suite {name} {number}"), place))
    assert found <= {READ, REFUSED, STOPPED}
    assert found
    assert "\x1b" not in capfd.readouterr().err
