"""Numbers, colours and axes that every table and drawing shares."""

import pytest
from helpers.table1_records import METHODS
from matplotlib.figure import Figure
from shadowbench.harness.frame.registry import method_names
from shadowbench.harness.report import numbers, style
from shadowbench.harness.runner.planning.experiment import experiment_names, find_experiment
from shadowbench.methods import LOOKS


def test_a_method_keeps_its_colour_whoever_else_is_drawn():
    alone, together = style.colours(["warp_bvh"]), style.colours([*METHODS, "somebodys"])
    assert alone["warp_bvh"] == together["warp_bvh"]
    assert len({together[name] for name in METHODS}) == len(METHODS)


def test_every_method_has_a_look_of_its_own():
    """A colour that no other has; a marker, too, among those that an experiment draws together."""
    assert set(method_names()) == set(LOOKS)
    assert len({style.look(name)["color"] for name in LOOKS}) == len(LOOKS)
    for experiment in map(find_experiment, experiment_names()):
        for preset in experiment.presets.values():
            drawn = {entry.method for entry in preset.methods}
            assert len({style.look(name)["marker"] for name in drawn}) == len(drawn), experiment.name
    assert style.look("somebodys")["color"] in style.COLOURS


@pytest.mark.parametrize(
    ("value", "text"), [(None, "-"), (float("nan"), "-"), (0.01234, "0.012"), (1.234, "1.23"), (1234.5, "1,234")]
)
def test_numbers_have_no_exponents(value, text):
    assert numbers.carried(value) == text


@pytest.mark.parametrize(
    ("low", "high", "labels"),
    [
        (0.3, 6.0, ["0.5", "1", "2", "5"]),
        (0.3, 40.0, ["0.5", "1", "2", "5", "10", "20", "50"]),
        (0.2, 400.0, ["1", "10", "100"]),
        (2e-7, 5e-4, ["0.000001", "0.00001", "0.0001"]),
        (0.0, 0.0, None),
    ],
)
def test_logarithmic_axes_have_plain_numbers(low: float, high: float, labels: list[str] | None) -> None:
    axes = Figure().subplots()
    axes.plot([1, 2], [low, high])
    style.plain_log(axes)
    bottom, top = axes.get_ylim()
    assert axes.get_yscale() == ("log" if labels else "linear")
    if not labels:
        return
    shown = [label.get_text() for label in axes.get_yticklabels() if bottom <= label.get_position()[1] <= top]
    assert shown == labels
