"""Meshes that grow and shrink by powers of two: each frame is as right as if its mesh had always had that size."""

import numpy as np
import pytest
from helpers.played_stories import Judging, Player, keeps_still, play, players
from helpers.stories import SIZE, Story, vector
from shadowbench.harness.errors import UserError
from shadowbench.harness.hardcases.shapes import ball, joined, quad
from shadowbench.harness.scene.prepared import SHRUNK, Prepared, prepare
from shadowbench.harness.scene.scene import Camera, Geometry, Light, Scene

FLOOR = quad((-3, 0, -3), (3, 0, -3), (3, 0, 3), (-3, 0, 3))
POINTS, FACES = joined(FLOOR, ball(0.5, (0, 0.6, 0)), ball(0.25, (1, 0.4, 0.5)))

EYE, TARGET = np.array([0.3, 1.7, 3.1]), np.array([0.1, 0.4, 0.0])

WAY = (0.3, 1.0, 0.2)

SUN = Light(WAY, directional=True)

SIZES = (1.0, 2.0**28, 2.0**-27, 2.0**6, 2.0**-9, 1.0)

PLAYERS = [player for player in players("cpu") if not keeps_still(player)]


BESIDE = Camera(vector(EYE), vector(TARGET))

BELOW = Camera((0.025, 0.02, 0.0), (0.026, 5.0, 0.01))
"""From the floor up to the ball, at every size of the mesh."""


def changing(light: Light, sizes: tuple[float, ...] = SIZES, camera: Camera = BESIDE) -> Prepared:
    """A floor and balls that have these sizes one after another."""
    geometry = Geometry(FACES.astype(np.int32), lambda frame: POINTS * sizes[frame], len(sizes))
    scene = Scene("size", "Size", lambda: geometry, camera, (light,))
    return prepare(scene)


def followed(light: Light) -> Story:
    """The camera keeps its place relative to the mesh, so that every frame shows the same."""
    prepared = changing(light)
    views = [Camera(vector(EYE * size), vector(TARGET * size)) for size in SIZES]
    moments = [prepared.moment(frame, *SIZE, view) for frame, view in enumerate(views)]
    return Story(prepared, [f"size {size:g}" for size in SIZES], moments)


def outgrown() -> Story:
    """The camera and a far light stay, and the mesh grows about them."""
    light = Light(vector(np.array([1.0, 0.05, 0.2]) * 2.0**50))
    prepared = changing(light, (1.0, 2.0**33), BELOW)
    return Story(prepared, ["before", "after"], [prepared.moment(frame, *SIZE) for frame in range(2)])


STORIES = {"followed": followed(SUN), "outgrown": outgrown()}
JUDGING = {name: Judging(story) for name, story in STORIES.items()}


@pytest.mark.slow
@pytest.mark.parametrize("player", PLAYERS, ids=lambda player: "-".join([player[0], *player[1].values()]))
@pytest.mark.parametrize("name", STORIES)
def test_shadows_are_right_where_a_mesh_changes_its_size(player: Player, name: str, device: str) -> None:
    if player not in players(device):
        pytest.skip(f"{player[0]} does not run on {device}")
    assert play(player, STORIES[name], device, JUDGING[name]) == []


def test_the_stories_have_shadows_in_every_frame() -> None:
    for name, story in STORIES.items():
        for frame in range(len(story.moments)):
            exact = JUDGING[name].judged(frame).exact
            seen, dark = (exact["triangle"] >= 0).sum(), exact["shadowed"][0].sum()
            assert 5 < dark < seen - 5, (name, frame)


def test_a_directional_light_and_its_post_keep_their_distance_from_the_mesh() -> None:
    for moment in STORIES["followed"].moments:
        size = np.abs(moment.points).max()
        light, post = (np.linalg.norm(place[0].astype(np.float64)) for place in (moment.lights, moment.proxy_positions))
        assert 2.0**55 <= light / size <= 2.0**62
        assert 2.0**23 <= post / size <= 2.0**30
        assert np.abs(moment.points).max() <= moment.max_coordinate[0]
        np.testing.assert_allclose(moment.lights[0] / light, np.array(WAY) / np.linalg.norm(WAY), rtol=1e-6)


def test_light_and_reach_rest_while_a_mesh_keeps_its_size() -> None:
    prepared = changing(SUN, (1.0, 1.2, 2 * SHRUNK, 0.0))
    first, *others = (prepared.moment(frame, *SIZE) for frame in range(4))
    for other in others:
        np.testing.assert_array_equal(other.lights, first.lights)
        assert other.max_coordinate == first.max_coordinate


def test_vertices_that_are_not_finite_have_no_size() -> None:
    prepared = changing(SUN)
    points = POINTS.astype(np.float32)
    expected = prepared.scale(points)
    points[0], points[5, 1] = np.nan, np.inf
    assert prepared.scale(points) == expected


def test_a_mesh_that_grows_too_large_for_a_directional_light_is_refused() -> None:
    prepared = changing(SUN, (1.0, 2.0**80))
    prepared.moment(0, *SIZE)
    with pytest.raises(UserError, match="too large"):
        prepared.moment(1, *SIZE)
