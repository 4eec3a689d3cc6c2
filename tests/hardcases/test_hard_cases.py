"""The catalogue of hard cases: what a hand expects is what exact arithmetic says, and every exact method passes."""

import collections
from dataclasses import replace

import numpy as np
import pytest
import warp as wp
from helpers.exact_method import ExactMethod
from helpers.judged_hard_cases import (
    CASES,
    EVERYTHING,
    LONG,
    cases_of,
    exact_methods,
    families,
    family,
    judged,
    settings_of,
)
from helpers.turns import PARTS
from shadowbench.harness.frame.registry import make_method, method_class
from shadowbench.harness.frame.session import Session
from shadowbench.harness.hardcases import HardCase
from shadowbench.harness.hardcases.case import view
from shadowbench.harness.hardcases.conformance import conformance, counted_allocations
from shadowbench.harness.hardcases.judge import ERROR_NAMES, judge_case, judge_method
from shadowbench.harness.hardcases.shapes import plane

METHODS = exact_methods()
EXACT = [(name, settings) for name, given in METHODS for settings in settings_of(name, given)]

EFFECTS = ("alpha", "mirror", "orthographic", "receivers")
"""What a method may leave out: what its class says that it simulates, it must not."""

EXCUSED = ("V sheet x1e-06", "V sheet x0.001", "V sheet x1e-6 ", "S39 edges", "S63", "O02 tinybvh#168 integers")
"""Where an answer of ours may be excused by rounding: vertices that were rounded anew lie beside their rays; rays of a light
at infinity (:data:`.structures.AT_INFINITY`); hit points on the border of a spot; hits whose t differ by less than 2^-37.
"""


def skip_where_it_cannot_run(name: str, device: str) -> None:
    """Skip the test for a method of another kind of device."""
    if device.split(":")[0] not in make_method(name).devices:
        pytest.skip(f"{name} does not run on {device}")


def setting_of(number: int, settings: int) -> tuple[int, bool]:
    """Of a method's case in turn: the number of its setting, and whether it runs twice."""
    return number % settings, number // settings % 2 == 0


@pytest.mark.parametrize(("name", "given"), METHODS, ids=str)
def test_exact_methods_pass_every_case(name, given, device) -> None:
    """No true error, little excused, and of triangles at one distance the lowest (P06).

    On a CPU the methods take turns over the cases of each family (:func:`.judged_hard_cases.cases_of`), and their settings
    over their cases. Of each setting every second case runs twice, on poisoned answers, and must give the same bits.
    """
    skip_where_it_cannot_run(name, device)
    settings, wrong, outside = settings_of(name, given), {}, collections.Counter[str]()
    everything = EVERYTHING or device != "cpu"
    cases = [case.name for case in CASES] if everything else cases_of(METHODS.index((name, given)))
    for number, case in enumerate(cases):
        ties = case.startswith("P06")
        own, again = setting_of(number, len(settings))
        for turn in settings if everything or ties else (settings[own],):
            twice = everything or (again and not case.startswith(LONG))
            finding = judge_case(judged(case), make_method(name, turn), device, twice=twice)
            excused = set(finding.classes) - (set() if ties else {"tie"})
            if finding.status in ("error", "excused") or (excused and not case.startswith(EXCUSED)):
                wrong[case, str(turn)] = (finding.classes, finding.reason, finding.examples[:1])
            elif finding.status == "outside":
                outside[finding.reason] += 1
    assert wrong == {}
    effects = {reason.partition(":")[0] for reason in outside}
    assert effects <= {*EFFECTS}
    assert not effects & {*method_class(name).simulates}, outside
    assert sum(outside.values()) < 0.25 * len(cases)


def test_methods_in_turn_answer_every_case_and_each_of_them_every_family() -> None:
    for method in range(len(METHODS)):
        assert {family(name) for name in cases_of(method)} == set(families())
    assert {name for method in range(PARTS) for name in cases_of(method)} == {case.name for case in CASES}
    assert len(families()) > 130
    for count in {len(settings_of(*one)) for one in METHODS}:
        assert len({setting_of(number, count) for number in range(2 * count)}) == 2 * count


@pytest.mark.parametrize("precision", ["float32", "float32-centred"])
def test_a_light_space_in_float32_is_exact_at_the_ends_of_float32(precision) -> None:
    """Only the space is: triangles are widened by its rounding, and lengths near the limits are brought to 1."""
    kinds = ("V scale", "V sun", "V far", "V subnormal", "V mixed")
    names = [case.name for case in CASES if case.name.startswith(kinds)]
    assert len(names) > 30
    wrong = {}
    for name in names:
        finding = judge_case(judged(name), make_method("perspective_spherical", {"precision": precision}), "cpu")
        if finding.status != "ok" or finding.excused:
            wrong[name] = (finding.classes, finding.reason)
    assert wrong == {}


@pytest.mark.parametrize(("name", "settings"), EXACT, ids=str)
def test_rules_of_conduct(name, settings, device) -> None:
    """Frames that follow one another, graph replays, no allocation in a frame after the first."""
    skip_where_it_cannot_run(name, device)
    found = conformance(lambda: make_method(name, settings), device)
    assert [(one.name, one.reason) for one in found if one.status == "error"] == []
    assert {one.name for one in found if one.status == "ok"} >= {"frames", "allocations", "shadows not asked for"}


def test_known_weaknesses_of_others_show() -> None:
    """Warp's Mesh and Embree lose rays and segments through vertices of closed surfaces seen from within; Embree
    loses those in the upper faces of the scene's box, not in the lower; both shadow what touches a vertex.
    """

    def classes(method: str, name: str) -> dict[str, int]:
        return judge_case(judged(name), make_method(method, {}), "cpu").classes

    for method in ("warp_bvh", "embree"):
        for name in ("P29", "S19c"):
            assert classes(method, name)["hole"] > 0
    for suffix in ("", "y", "z"):
        assert classes("embree", f"P08d{suffix}")["hole"] == 17
        assert classes("embree", f"P08e{suffix}").get("hole", 0) == 0
    assert classes("warp_bvh", "P03b")["acne"] > 0


# --- the judge itself, on methods with an error planted ----------------------------------------------------------


class Forger(ExactMethod):
    """Answers a case with the exact answers and one change."""

    def __init__(self, answers, change):
        super().__init__()
        self.answers = {key: value.copy() for key, value in answers.items()}
        change(self.answers)

    def build_structure(self, frame):
        pass


def forged(name: str, change) -> dict[str, int]:
    one = judged(name)
    return judge_case(one, Forger(one.exact, change), "cpu").classes


def test_the_exact_answers_pass() -> None:
    for case in CASES:
        if not case.name.startswith(("S17", "M", "O")):  # mirrors: below
            assert set(forged(case.name, lambda answers: None)) & set(ERROR_NAMES) == set(), case.name


def test_frames_before_the_judged_one_are_run() -> None:
    """A method that takes its bounds from the first frame of a session fails where that frame is of NaN."""
    one = judged("P41 nw")
    shown: list[bool] = []

    class Watches(Forger):
        def trace_primary(self, frame):
            shown.append(bool(np.isnan(frame.points.numpy()).any()))
            super().trace_primary(frame)

    assert judge_case(one, Watches(one.exact, lambda answers: None), "cpu").status == "ok"
    assert shown == [True, False, False]


class MirrorForger(Forger):
    """Answers a case of mirrors with another method's answers and one change."""

    simulates = frozenset({"shadows", "mirror"})

    def trace_bounce(self, frame, bounce):
        for key in ("triangle", "t", "u", "v"):
            getattr(frame.hits(bounce), key).assign(self.answers[f"bounce_{key}"][bounce - 1])

    def trace_bounce_shadow(self, frame, light, bounce):
        frame.bits(bounce)[light].assign(self.answers["bounce_shadowed"][bounce - 1][light])


def test_errors_in_a_mirror_are_found() -> None:
    one = judged("M05")
    moment = one.trial.moment
    session = Session(make_method("uniform_grid"), one.trial.prepared, moment.width, moment.height, "cpu")
    answers = session.answers(moment)
    shadowed = np.nonzero(answers["bounce_shadowed"][0][0])[0]
    assert len(shadowed) > 9

    def found(change):
        return judge_case(one, MirrorForger(answers, change), "cpu").classes

    assert set(found(lambda a: None)) & set(ERROR_NAMES) == set()
    assert found(change("bounce_shadowed", (0, 0, shadowed[:9]), 0))["leak"] == 9
    assert found(change("bounce_triangle", (0, 40), 0))["true"] == 1
    assert found(change("bounce_triangle", (0, 40), 99))["invalid"] >= 1


def change(key: str, index, value):
    def apply(answers):
        answers[key][index] = value

    return apply


def miss(answers):
    answers["triangle"][40], answers["t"][40] = -1, np.inf
    answers["u"][40] = answers["v"][40] = 0
    answers["shadowed"][:, 40] = 0


@pytest.mark.parametrize(
    ("name", "apply", "kind"),
    [
        ("S01", change("shadowed", (0, 9), 0), "leak"),
        ("S12", change("shadowed", (0, 300), 1), "acne"),
        ("S01", change("shadowed", (0, 9), 77), "invalid"),
        ("P16", change("triangle", 300, 3), "true"),
        ("P16", change("t", 300, 1.0), "true"),
        ("P12", miss, "hole"),
        ("S15", change("shadowed", (2, 2), 1), "differs"),
        ("P16", change("triangle", 300, -77), "invalid"),
    ],
)
def test_a_planted_error_is_found(name, apply, kind) -> None:
    assert forged(name, apply).get(kind, 0) >= 1


def test_a_bit_outside_a_spot_is_found() -> None:
    class SpotForger(Forger):
        simulates = frozenset({"shadows", "receivers", "directional"})

    one = judged("S17")
    good = judge_case(one, SpotForger(one.exact, lambda answers: None), "cpu")
    assert good.status == "ok"
    lit = int(np.nonzero((one.exact["shadowed"][0] == 0) & (one.judge.reference.shadowed[0] == 1))[0][0])
    bad = judge_case(one, SpotForger(one.exact, change("shadowed", (0, lit), 1)), "cpu")
    assert bad.classes.get("acne") == 1


def test_crashes_and_declared_cases() -> None:
    class Crashes(Forger):
        outside = {"S01": "needs more than three lights"}  # noqa: RUF012

        def trace_primary(self, frame):
            raise ArithmeticError("no answer")

    one = judged("S02")
    crashed = judge_case(one, Crashes(one.exact, lambda answers: None), "cpu")
    assert (crashed.status, crashed.classes) == ("error", {"failed": 1})
    declared = judge_case(judged("S01"), Crashes(one.exact, lambda answers: None), "cpu")
    assert (declared.status, declared.reason) == ("outside", "needs more than three lights")


def faults(make) -> dict[str, str]:
    return {one.name: one.reason for one in conformance(make, "cpu") if one.status == "error"}


def test_stale_frames_and_allocations_are_found() -> None:
    class Stale(type(make_method("warp_bvh", {}))):  # type: ignore[misc]
        """Builds its tree once only, and allocates in every frame."""

        def plan(self, frame, effects, limits):
            self.capturable = True
            passes = super().plan(frame, effects, limits)
            first = passes[0].launch
            done: list[bool] = []

            def once():
                self.waste = wp.zeros(100, device=frame.device)
                if not done:
                    done.append(True)
                    first()

            return [type(passes[0])(passes[0].name, "build", (), ("mesh",), once), *passes[1:]]

    assert "differs from a fresh session" in faults(Stale)["frames"]
    assert "allocations in a frame" in faults(Stale)["allocations"]


def test_passes_that_hide_what_they_read_are_found() -> None:
    class Hides(type(make_method("uniform_grid", {}))):  # type: ignore[misc]
        """Does not say that its shadow rays go to a light."""

        def plan(self, frame, effects, limits):
            passes = super().plan(frame, effects, limits)
            kept = [tuple(name for name in one.reads if not name.startswith("light/")) for one in passes]
            return [replace(one, reads=reads) for one, reads in zip(passes, kept, strict=True)]

    assert "light 0 moved: shadowed" in faults(Hides)["partial frames"]


def test_a_structure_that_was_skipped_and_forgotten_is_found(monkeypatch) -> None:
    monkeypatch.setattr(Session, "_outdated_inputs", lambda self, passes: set())
    found = faults(lambda: make_method("shadow_map", {"size": "64"}))
    assert "the camera looked back" in found["partial frames"]


def test_allocations_are_counted() -> None:
    kept: list[wp.array] = []
    assert counted_allocations(lambda: None)[0] == 0
    assert counted_allocations(lambda: kept.append(wp.zeros(10, device="cpu")))[0] == 1
    assert counted_allocations(lambda: wp.zeros(10, device="cpu").fill_(1.0))[0] == 1  # freed again at once


def test_refused_cases_count_when_they_are_made_after_all() -> None:
    case = HardCase("X", "x", "y", lambda: view(plane(2, 0, 1), [], (0, 0, 4), (0, 0, -1)), refused=True)
    (finding,) = judge_method(lambda: make_method("uniform_grid", {}), "cpu", [case], {})
    assert finding.status == "error"
