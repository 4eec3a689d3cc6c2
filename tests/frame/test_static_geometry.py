"""Lights that move over geometry that does not: static structures are accepted, and only the lights' part is made anew."""

from dataclasses import replace

import pytest
from helpers.answers import answers_in, assert_same
from helpers.effect_scenes import POINT
from helpers.effect_scenes import scene as lit
from shadowbench.harness.commands.plan import declared, frame_plan
from shadowbench.harness.errors import UserError
from shadowbench.harness.frame.registry import make_method
from shadowbench.harness.frame.schedule.needed import stale
from shadowbench.harness.frame.session import Session
from shadowbench.harness.hardcases.shapes import plane
from shadowbench.harness.scene.light_paths import Orbit
from shadowbench.harness.scene.prepared import Prepared, prepare
from shadowbench.harness.scene.scene import Geometry

FRAMES = 3
METHODS = ("bvh2", "hybrid", "warp_bvh", "embree")


def turning(moving: bool = False) -> Prepared:
    """A scene whose light turns; with ``moving``, its mesh moves as well."""
    scene = lit((POINT,)).scene
    base = scene.geometry()

    def geometry() -> Geometry:
        if not moving:
            return Geometry.static(base.positions(0), base.faces).lasting(FRAMES)
        return Geometry(base.faces, lambda frame: base.positions(0) + 0.01 * frame, FRAMES)

    return prepare(replace(scene, geometry=geometry, light_path=Orbit((0.0, 0.0, 0.0), (0.0, 1.0, 0.0), 0.5)))


def session_of(method: str, prepared: Prepared) -> Session:
    if method == "embree":
        pytest.importorskip("embreex", reason="Embree is not installed")
    return Session(make_method(method, {"update": "static"}), prepared, 24, 24, "cpu")


@pytest.mark.parametrize("method", METHODS)
def test_only_the_lights_part_is_made_anew(method: str) -> None:
    prepared = turning()
    moments = [prepared.moment(frame, 24, 24) for frame in range(FRAMES)]
    session = session_of(method, prepared)
    session.answers(moments[0])
    for moment in moments[1:]:
        assert session.advance(moment) == {"light/0"}
        run = stale(session.all_passes, {"light/0"})
        assert run
        assert {one.part for one in run} <= {"light build", "shadow"}
        assert_same(answers_in(session), session_of(method, prepared).answers(moment))


@pytest.mark.parametrize("method", [method for method in METHODS if method != "hybrid"])  # it may take no tree
def test_a_mesh_that_moves_is_refused(method: str) -> None:
    with pytest.raises(UserError, match=r"update=static: .* moves over 3 frames; choose rebuild or refit"):
        session_of(method, turning(moving=True))


def test_plan_says_so(tmp_path) -> None:
    path = tmp_path / "turning.toml"
    orbit = "frames = 3\nturns = 0.5\naxis = [0.0, 1.0, 0.0]\ncentre = [0.0, 0.0, 0.0]\n"
    path.write_text(f'mesh = "balls-1k"\n[orbit]\n{orbit}')
    (row,) = (found := frame_plan(str(path), ["bvh2"], "8x8", "cpu", settings=["bvh2.update=static"]))["methods"]
    assert found["declared"]["geometry"].endswith("triangles, static over 3 frames")
    assert ", moving" in found["declared"]["lights"][0]
    assert row["cannot"] is None
    for one in row["passes"]:
        assert one["after"]["light 0"]["runs"] == (one["part"] in ("light build", "shadow")), one["name"]
    moving = turning(moving=True)
    assert declared(moving.scene, moving)["geometry"].endswith("deforming over 3 frames, all of it")
    still = prepare(replace(moving.scene, geometry=lambda: Geometry.static(*plane(2, 0, 1))))
    assert declared(still.scene, still)["geometry"] == "2 triangles, static"
