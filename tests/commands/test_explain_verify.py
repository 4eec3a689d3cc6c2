"""``explain`` gives the verdict that ``verify`` counts, at any pixel of any declared scene."""

import json
from dataclasses import replace

import numpy as np
import pytest
from shadowbench.harness.commands import answering
from shadowbench.harness.commands.explain import explain
from shadowbench.harness.frame.devices import start_warp
from shadowbench.harness.judge.context import Judge
from shadowbench.harness.judge.score import score_answers
from shadowbench.harness.judge.verdict import RIGHT, Verdict
from shadowbench.harness.scene.catalogue import resolve
from shadowbench.harness.scene.prepared import prepare

start_warp()

WIDTH, HEIGHT = 16, 12
GRAVEST_LAST = ("edge", "invalid", "leak", "acne")


DECLARED = {
    "spots": """facing = true
        lights = [{position = [0.4, 4, 1], spot = {direction = [-0.4, -4, -1], angle = 12}},
                  {position = [2, 3, -1], shadows = false}]
    """,
    "holes": """lights = [{position = [-3, 1, 2], directional = true}]
        alpha = {every = 2, holes = 3}
    """,
    "mirrors": """facing = true
        lights = [{position = [2, 3, -1], spot = {direction = [-2, -3, 1], angle = 30}}, {position = [0.2, -2, 0.1]}]
        mirror = {share = 0.8, bounces = 2}
    """,
}
"""Scenes in TOML with all that shadow rays, hits and bounces depend on."""


def spoil(answers: dict, seed: int) -> dict:
    """The answers with every tenth bit turned over, and some triangles lost or replaced."""
    random = np.random.default_rng(seed)
    spoilt = {name: value.copy() for name, value in answers.items()}
    for name in ("shadowed", "bounce_shadowed"):
        if name in spoilt:
            spoilt[name] ^= (random.random(spoilt[name].shape) < 0.1).astype(np.uint8)
    for name in ("triangle", "bounce_triangle"):
        if name in spoilt:
            spoilt[name][random.random(spoilt[name].shape) < 0.1] = 3
    return spoilt


def printed_class(row: dict, bounced: list[dict]) -> str:
    """The class of a pixel by what ``explain`` prints: that of its primary answer, else of the gravest bit, else of the
    first bounce that is wrong; "ok" for ties too.
    """
    for part in (row, *bounced):
        if part["class"] not in ("ok", "tie"):
            return part["class"]
        found = [kind for kind in GRAVEST_LAST if kind in part["shadow_classes"]]
        if found:
            return found[-1]
    return "ok"


@pytest.mark.parametrize("spoilt", [False, True])
@pytest.mark.parametrize("name", DECLARED)
def test_explain_prints_the_class_that_verify_scored(mesh, tmp_path, capsys, monkeypatch, name, spoilt):
    path, seed = tmp_path / "scene.toml", 7
    path.write_text(f'mesh = "{mesh}"\n' + DECLARED[name])
    prepared = prepare(resolve(str(path)))
    moment = prepared.moment(0, WIDTH, HEIGHT)
    outcome = answering.answer("uniform_grid", {}, prepared, moment, "cpu")
    assert outcome.answers is not None, outcome.reason
    if spoilt:
        outcome = replace(outcome, answers=spoil(outcome.answers, seed))
    judge = Judge.of(prepared, moment)
    as_verified = score_answers(judge, outcome.answers)
    every_pixel = score_answers(judge.with_random_pixels(WIDTH * HEIGHT), outcome.answers)
    random = np.random.default_rng(seed)
    wrong = np.nonzero(every_pixel.classes > Verdict.TIE)[0]
    hit = np.nonzero(outcome.answers["triangle"] >= 0)[0]
    pixels = [int(random.choice(some)) for some in (hit, wrong, wrong, wrong) if len(some)]
    pixels.append(int(random.integers(WIDTH * HEIGHT)))
    for pixel in pixels:
        x, y = pixel % WIDTH, pixel // WIDTH
        with monkeypatch.context() as patched:
            patched.setattr("shadowbench.harness.commands.explain.answer", lambda *arguments: outcome)
            code = explain(str(path), f"{x},{y}", ["uniform_grid"], "cpu", f"{WIDTH}x{HEIGHT}", as_json=True)
        facts = json.loads(capsys.readouterr().out)
        reference, row = facts["answers"]
        assert not reference["wrong"] or every_pixel.score.reference_errors.true_errors
        bounced = [one["answers"][0] for one in facts["bounces"] if one["answers"]]
        scored = Verdict(every_pixel.classes[pixel])
        assert printed_class(row, bounced) == ("ok" if scored in RIGHT else scored.key), (x, y)
        if not reference["wrong"]:  # where the reference is right, the pixels that verify decides make no difference
            assert as_verified.classes[pixel] == scored
        assert code == any(part["wrong"] for part in (row, *bounced))
