"""The exact answers to a moment, and a ball on a floor to ask about."""

import numpy as np
from shadowbench.harness.hardcases.shapes import ball, joined, quad
from shadowbench.harness.judge.referee import Referee
from shadowbench.harness.judge.reference import exact_reference
from shadowbench.harness.scene.moment import Moment
from shadowbench.harness.scene.prepared import Prepared
from shadowbench.harness.scene.scene import Camera, Geometry, Light, Scene


def static_scene(vertices, faces, camera: Camera, *lights: Light) -> Scene:
    vertices, faces = np.asarray(vertices, dtype=np.float64), np.asarray(faces)
    return Scene("case", "Case", lambda: Geometry.static(vertices, faces), camera, tuple(lights))


def ball_on_floor(lights: int = 1) -> Scene:
    """A ball over a square floor (faces 0 and 1), lights above, the camera to one side, sky behind."""
    mesh = joined(quad((-2, 0, -2), (2, 0, -2), (2, 0, 2), (-2, 0, 2)), ball(0.5, (0.0, 0.6, 0.0)))
    place = [Light((1.0 - 2.0 * i, 2.5, 0.5)) for i in range(lights)]
    return static_scene(*mesh, Camera((0.3, 1.7, 3.1), (0.0, 0.3, 0.0)), *place)


def exact_answers(prepared: Prepared, moment: Moment) -> dict[str, np.ndarray]:
    """The referee's answers of every pixel, in the form of a method's: whatever a spot holds, and on both sides."""
    referee = Referee(moment.points, prepared.faces, moment.valid, mask=prepared.alpha)
    return exact_reference(prepared, moment, referee).answers()


def assert_right(got: dict[str, np.ndarray], exact: dict[str, np.ndarray], what: object = "") -> None:
    """Ids with their ties, misses and every shadow bit are the exact ones; t, u and v are but for a GPU's last bits."""
    for key in ("triangle", "shadowed"):
        np.testing.assert_array_equal(got[key], exact[key], f"{key} {what}")
    np.testing.assert_allclose(got["t"], exact["t"], rtol=2**-22, err_msg=f"t {what}")
    for key in "uv":
        np.testing.assert_allclose(got[key], exact[key], atol=1e-6, err_msg=f"{key} {what}")
