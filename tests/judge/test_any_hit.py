"""A shadow bit is set if and only if the same method's own closest hit lies before the light.

A plane is laid beyond a drawn mesh. From the light as an eye, a method says what each ray meets first: the mesh or
the plane. From an eye beyond the plane it says which points of the plane are shadowed from the light. With an eye as
far behind the plane as the light is before it, both pictures hold the same segments, exactly.
"""

from dataclasses import replace

import numpy as np
from helpers.drawn_examples import EXAMPLES, some
from helpers.lattice_examples import LENGTH, METHODS, Example, answers_of, decode
from hypothesis import given
from shadowbench.harness.scene.scene import Camera

SIDE = 16


def pictures(drawn: Example) -> tuple[Example, Example, int]:
    """The same mesh and plane from the light, and from beyond the plane; the first of the plane's two triangles."""
    camera = drawn.camera
    forward = np.sign(np.asarray(camera.target) - np.asarray(camera.eye))
    up = np.asarray(camera.up, dtype=np.float64)
    right = np.cross(forward, up)
    # Near the mesh, on the lattice: the drawn eye, which sees the mesh before it.
    light = np.asarray(camera.eye, dtype=np.float64)
    ahead = (drawn.points - light) @ forward
    distance = 2.0 ** np.ceil(np.log2(max(ahead.max(), np.abs(drawn.points - light).max()) + 1e-30) + 1)
    half = np.tan(np.radians(camera.fov) / 2)
    corners = [
        light + distance * (forward + 4 * half * (i * right + j * up)) for i, j in ((-1, -1), (1, -1), (1, 1), (-1, 1))
    ]
    count, first = len(drawn.points), len(drawn.faces)
    mesh = drawn.with_geometry(
        np.concatenate([drawn.points, np.array(corners).astype(np.float32)]),
        np.concatenate([drawn.faces, [(count, count + 1, count + 2), (count, count + 2, count + 3)]]),
    )
    mesh = replace(mesh, lights=light[None], size=(SIDE, SIDE))
    beyond = light + 2 * distance * forward
    eyes = [(light, light + distance * forward), (beyond, light + distance * forward)]
    one, other = (
        replace(mesh, camera=Camera(tuple(eye.tolist()), tuple(aim.tolist()), camera.up, camera.fov))
        for eye, aim in eyes
    )
    return one, other, first


@some(60)
@given(EXAMPLES)
def test_shadowed_if_and_only_if_something_is_hit_before_the_light(drawn: Example) -> None:
    from_light, from_beyond, first = pictures(drawn)
    for name in METHODS:
        closest = answers_of(from_light, name)["triangle"].reshape(SIDE, SIDE)
        answers = answers_of(from_beyond, name)
        assert (answers["triangle"] >= first).all(), name
        bits = answers["shadowed"][0].reshape(SIDE, SIDE)[:, ::-1]  # seen from the other side
        np.testing.assert_array_equal(bits, closest < first, name)


def test_both_sides_are_met() -> None:
    """A fair share of the rays is shadowed, in most pictures some and not all; and the segments are the same."""
    random = np.random.default_rng(3)
    shadowed = []
    for _ in range(40):
        one, other, first = pictures(decode(random.bytes(LENGTH)))
        a, b = one.trial().moment, other.trial().moment
        pixels = np.arange(SIDE * SIDE)
        there, back = a.directions(pixels).reshape(SIDE, SIDE, 3), b.directions(pixels).reshape(SIDE, SIDE, 3)
        forward = a.axes[2]
        np.testing.assert_array_equal(there, back[:, ::-1] + 2 * forward)
        shadowed.append((answers_of(one, "warp_bvh")["triangle"] < first).mean())
    assert 0.1 < np.mean(shadowed) < 0.9
    assert np.mean([0 < share < 1 for share in shadowed]) > 0.5
