"""The command ``check``: what fails it, what is excused and how much, and what a method may declare."""

import json

import numpy as np
import pytest
from helpers.exact_method import ExactMethod
from helpers.right_and_wrong_methods import Point
from shadowbench.experiments.accuracy.untimed import hard_rows
from shadowbench.harness.commands.check import check
from shadowbench.harness.errors import UserError
from shadowbench.harness.frame import registry
from shadowbench.harness.hardcases import HardCase, find_case
from shadowbench.harness.hardcases.case import view
from shadowbench.harness.hardcases.judge import Judged, judge_case
from shadowbench.harness.hardcases.shapes import joined, plane
from shadowbench.harness.runner.planning.experiment import Entry


class NoShadows(ExactMethod):
    """Says that everything is lit."""

    name = title = "no_shadows"

    def spoil(self, answers):
        answers["shadowed"][:] = 0


class Declared(NoShadows):
    name = title = "declared"
    known_inexact = "shadows are left out"
    outside = {"shadows": "shadows are left out", "S02": "of no interest here"}  # noqa: RUF012


class LosesPixels(Declared):
    """Its shadows lie outside what it can do, its primary rays do not."""

    name = title = "loses_pixels"

    def spoil(self, answers):
        super().spoil(answers)
        middle = len(answers["triangle"]) // 2
        answers["triangle"][middle], answers["t"][middle] = -1, np.inf
        answers["u"][middle] = answers["v"][middle] = 0


class NoBits(Declared):
    """Writes no shadow bits at all."""

    name = title = "no_bits"

    def trace_shadow(self, frame, light):
        pass


class Misspelt(ExactMethod):
    name = title = "misspelt"
    outside = {"S1": "no such case"}  # noqa: RUF012


class Behind(ExactMethod):
    """Names the second of two sheets."""

    name = title = "behind"

    def spoil(self, answers):
        answers["triangle"][answers["triangle"] >= 0] += 2


SMALL_MAP = ("size=256",)

OWN = (ExactMethod, NoShadows, Declared, LosesPixels, NoBits, Misspelt)


@pytest.fixture(autouse=True)
def wide(monkeypatch):
    """Room enough that no cell is folded."""
    monkeypatch.setenv("COLUMNS", "160")


@pytest.fixture
def own_methods(monkeypatch):
    monkeypatch.setattr(registry, "_entry_points", lambda: {cls.name: Point(cls) for cls in OWN})


def report(capsys, method: str, *cases: str, settings: tuple[str, ...] = ()) -> tuple[int, dict]:
    code = check(method, "cpu", list(settings), list(cases), True)
    return code, json.loads(capsys.readouterr().out)


def test_an_exact_method_passes_and_the_output_says_so(capsys) -> None:
    code, found = report(capsys, "accuracy_ladder", "S05", "S17", "P18")
    assert code == 0
    assert found["passed"]
    assert (found["true_errors"], found["excused"]) == (0, 0)
    assert [case["status"] for case in found["cases"]] == ["ok", "outside", "ok"]
    assert found["cases"][0]["expected"] == found["cases"][0]["got"] == "32 hit, 32 shadowed"
    assert found["cases"][0]["rays"] == found["rays"] - found["cases"][2]["rays"]


def test_a_method_that_says_it_is_inexact_fails_all_the_same(capsys, monkeypatch) -> None:
    """Its ties are shown apart from its errors, in a table that is as wide as asked."""
    for columns, said in (("80", "1 case, 1 with true errors"), ("200", "ERROR: 9 acne; not errors: 9 tie")):
        monkeypatch.setenv("COLUMNS", columns)
        assert check("warp_bvh", "cpu", None, ["P03b"], False) == 1
        shown = capsys.readouterr().out
        assert "warp_bvh declares itself inexact: " in " ".join(shown.split())
        assert said in " ".join(shown.split())
        assert max(map(len, shown.partition("P03b: ")[0].splitlines())) <= int(columns)


def test_a_setting_that_is_inexact_fails(capsys) -> None:
    settings = ["light_bounds=vertices"]
    assert check("perspective_spherical", "cpu", settings, ["S02", "S03"], False) == 1
    assert "perspective_spherical declares itself inexact" in capsys.readouterr().out
    assert check("warp_bvh", "cpu", ["update=bvh_rebuild"], ["P03b"], False) == 0
    assert "inexact" not in capsys.readouterr().out


def test_where_no_case_was_run_it_says_so_in_one_line_and_fails(capsys) -> None:
    assert check("driver", "cpu", None, ["P01", "P02"], False) == 1
    (line,) = capsys.readouterr().out.splitlines()
    assert line.startswith(
        "driver on cpu: nothing was checked: by OptiX it runs on cuda only; try --set driver.api=vulkan"
    )
    code, found = report(capsys, "driver", "P01")
    assert (code, found["passed"], found["unchecked"]) == (1, False, found["cases"][0]["reason"])


def test_shadows_that_are_declared_are_shown_and_not_held_against_a_method(own_methods, capsys) -> None:
    assert report(capsys, "no_shadows", "S01")[0] == 1
    code, found = report(capsys, "declared", "S01", "S02")
    assert (code, [case["status"] for case in found["cases"]]) == (0, ["ok", "outside"])
    assert (found["cases"][0]["bits_outside"], found["cases"][1]["reason"]) == (256, "of no interest here")
    assert check("declared", "cpu", None, ["S01", "S02"], False) == 0
    shown = capsys.readouterr().out
    assert "256 shadow bits outside" in shown
    assert "256 wrong shadow bits are outside what declared can do: shadows are left out" in shown
    assert "S02: of no interest here" in shown
    assert "declares itself inexact" not in shown


@pytest.mark.parametrize(("method", "kind"), [("loses_pixels", "true"), ("no_bits", "invalid")])
def test_what_is_not_declared_counts(own_methods, capsys, method, kind) -> None:
    code, found = report(capsys, method, "S01")
    assert code == 1
    assert found["cases"][0]["classes"][kind] > 0


def test_a_rasterised_shadow_map_declares_its_shadows(capsys) -> None:
    code, found = report(capsys, "shadow_map", "S12", "P12", "P16", settings=SMALL_MAP)
    assert code == 0
    assert all(case["bits_outside"] > 0 for case in found["cases"])
    assert found["outside"]["shadows"] == found["known_inexact"]
    assert report(capsys, "shadow_map", "P18", settings=SMALL_MAP)[0] == 0


def test_the_table_of_an_experiment_counts_every_bit(capsys) -> None:
    """Those bits too that ``check`` does not hold against the method."""
    (row,) = hard_rows(
        [Entry("shadow_map", {"size": "256"}, "map")], "cpu", without=("A", "H", "M", "O", "V", "P", "S"), but=("S12",)
    )
    _, found = report(capsys, "shadow_map", "S12", settings=SMALL_MAP)
    assert found["true_errors"] == 0
    assert 50 < row["true_errors"] <= found["cases"][0]["bits_outside"]


def test_a_case_that_does_not_exist_cannot_be_declared(own_methods) -> None:
    with pytest.raises(UserError, match="misspelt: its attribute 'outside' names 'S1', which is not a hard case"):
        check("misspelt", "cpu", None, ["S01"], True)


# --- what is excused ---------------------------------------------------------------------------------------------


def two_sheets(excusable: float | None = None) -> Judged:
    """Two sheets a hair apart: naming the one behind is a near tie, at every one of 256 pixels."""
    sheets = joined(plane(2, 0.0, 4.0), plane(2, -(2.0**-22), 4.0))
    limit = {} if excusable is None else {"excusable": excusable}
    case = HardCase("X", "two sheets", "", lambda: view(sheets, [(0, 0, 3.0)], (0, 0, 1), (0, 0, -1)), **limit)
    return Judged(case, case.make())


def test_too_much_excused_fails_a_case_that_does_not_allow_it() -> None:
    found = judge_case(two_sheets(), Behind(), "cpu")
    assert (found.status, found.excused, found.rays, found.true_errors) == ("excused", 256, 512, 0)
    assert found.reason == "50.0% of its rays are excused, more than the 2.0% allowed"
    assert judge_case(two_sheets(), ExactMethod(), "cpu").status == "ok"
    assert [judge_case(two_sheets(limit), Behind(), "cpu").status for limit in (0.5, 0.49)] == ["ok", "excused"]


def test_the_command_fails_on_too_much_excused_and_shows_how_much(monkeypatch, capsys) -> None:
    monkeypatch.setattr(registry, "_entry_points", lambda: {"behind": Point(Behind)})
    monkeypatch.setattr("shadowbench.harness.commands.check.find_case", lambda name: two_sheets().case)
    assert check("behind", "cpu", None, ["X"], False) == 1
    shown = capsys.readouterr().out
    assert "256 of 512" in shown
    assert "TOO MANY EXCUSED: 256 near-tie" in shown
    assert "1 case, 0 with true errors, 1 with too many excused; 256 of 512 answers excused" in shown
    code, found = report(capsys, "behind", "X")
    assert (code, found["passed"], found["excused"], found["cases"][0]["status"]) == (1, False, 256, "excused")


def test_vertices_at_scales_that_are_no_power_of_two_need_a_little_excusing(capsys) -> None:
    """Our own triangle test takes a ray within 2^-30 of an edge to meet both triangles: the exact one may lie beyond."""
    code, found = report(capsys, "uniform_grid", "V sheet x1e-06")
    assert code == 0
    (case,) = found["cases"]
    assert 0 < case["excused"] <= find_case(case["case"]).excusable * case["rays"]


@pytest.mark.parametrize(("arguments", "message"), [
    (("uniform_grd", "cpu", None, None, False), "did you mean uniform_grid"),
    (("uniform_grid", "cpu", ["density"], None, False), "param=value"),
    (("uniform_grid", "cpu", ["densty=1"], None, False), "did you mean density"),
    (("uniform_grid", "cpu", None, ["S1"], False), "no hard case 'S1'"),
    (("uniform_grid", "tpu:0", None, None, False), "no device"),
])  # fmt: skip
def test_a_wrong_call_is_refused(arguments, message) -> None:
    with pytest.raises(UserError, match=message):
        check(*arguments)
