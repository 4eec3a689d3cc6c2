"""A scene with lights for every method, and what a session launches: for tests of effects."""

from dataclasses import replace

import numpy as np
import pytest
import warp as wp
from helpers.small_scenes import soup
from shadowbench.harness.frame.registry import make_method, method_names
from shadowbench.harness.frame.session import Session
from shadowbench.harness.scene.prepared import Prepared, prepare
from shadowbench.harness.scene.scene import Camera, Geometry, Light, Scene, Spot

SIZE = 40, 32
EYE = Camera((0.0, 0.6, 3.0), (0.0, 0.0, 0.0))
POINT = Light((1.5, 3.0, 1.0))
BEHIND = Light((0.5, -0.2, -4.0))
SPOT = replace(POINT, spot=Spot((-1.5, -3.0, -1.0), 12.0))
FEW_CELLS = {"light_tiles": "32", "light_slices": "8"}

GIVEN = {"hybrid": {"shadows": "tree"}, "shadow_map": {"size": "64"}, "perspective_spherical": FEW_CELLS}
"""Settings of a method whose default may take another way, or long: with a grid the passes of hybrid are those of ray_grids,
and maps and grids of lights are made for larger images.
"""

LAMPS = {
    "bvh rebuilt in place": ("warp_bvh", {"update": "bvh_rebuild"}),
    "grids clamped to the scene": ("perspective_spherical", {"clamp": "scene", **FEW_CELLS}),
    **{name: (name, GIVEN.get(name, {})) for name in method_names()},
}
EXACT = [
    "uniform_grid", "bvh rebuilt in place", "perspective_spherical", "ray_grids", "grids clamped to the scene",
]  # fmt: skip


def scene(lights=(POINT, BEHIND), **changed) -> Prepared:
    """Triangles over a floor, two frames, under ``lights``."""
    vertices, faces = soup(4, 60)
    floor = np.array([[-4, -1.2, -4], [4, -1.2, -4], [4, -1.2, 4], [-4, -1.2, 4]], dtype=np.float64)
    faces = np.concatenate([faces, np.array([[0, 2, 1], [0, 3, 2]]) + len(vertices)])
    vertices = np.concatenate([vertices, floor])
    move = np.linspace(0.0, 0.1, len(vertices))[:, None]
    made = Geometry(faces.astype(np.int32), lambda k: vertices + k * move, 2)
    return prepare(Scene("effects", "effects", lambda: made, EYE, tuple(lights), **changed))


def all_mirrors(geometry: Geometry) -> np.ndarray:
    """For a scene's ``mirror``: every triangle is one."""
    return np.ones(len(geometry.faces), dtype=np.uint8)


def session_of(label: str, prepared: Prepared, device: str = "cpu") -> Session:
    return session_or_skip(*LAMPS[label], prepared, device)


def session_or_skip(
    name: str, settings: dict[str, str], prepared: Prepared, device: str = "cpu", size: tuple[int, int] = SIZE
) -> Session:
    """A session of a method; the test is skipped where the method cannot trace the scene."""
    method = make_method(name, settings)
    reason = method.applies(prepared.scene, device)
    if reason:
        pytest.skip(f"{name}: {reason}")
    return Session(method, prepared, *size, device)


def names(session: Session) -> list[str]:
    return [work.name for work in session.all_passes]


def launches(session: Session, monkeypatch: pytest.MonkeyPatch) -> list[tuple[str | None, str]]:
    """(effect of its pass, kernel) of every kernel launched in one frame, in order."""
    seen: list[tuple[str | None, str]] = []
    at: list[str | None] = [None]

    def counting(launch):
        def counted(kernel, *args, **kwargs):
            seen.append((at[0], kernel.func.__name__))
            return launch(kernel, *args, **kwargs)

        return counted

    with monkeypatch.context() as patch:
        patch.setattr(wp, "launch", counting(wp.launch))
        patch.setattr(wp, "launch_tiled", counting(wp.launch_tiled))
        for work in session.passes:
            at[0] = work.effect
            work.run()
    return seen


def effect_free(kernels: list[tuple[str | None, str]], effects: set[str]) -> list[str]:
    return [kernel for effect, kernel in kernels if effect not in effects]
