"""Every map with every clamp (``light/rectangle.py``) on whole scenes, lit from within and from up to 1e7 radii away:
answers of an exact BVH.

The stand-ins of the six scenes, and the real meshes of a folder beside the repository where there is one. They take the
pairs of map and clamp in turns, so that each map meets each distance; a small mesh is traced under every combination of
map, clamp, axes and distance. ``make fuzz`` gives every scene every pair, and Buddha, whose million triangles
take half of the time of all six, its own.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from helpers.judged_hard_cases import EVERYTHING
from helpers.real_scenes import MESHES, needs_real
from helpers.small_scenes import assert_same
from numpy.typing import NDArray
from shadowbench.harness.frame.registry import make_method
from shadowbench.harness.frame.session import Session
from shadowbench.harness.scene import catalogue
from shadowbench.harness.scene.effects import Limits
from shadowbench.harness.scene.moment import Moment
from shadowbench.harness.scene.prepared import Prepared, prepare, under
from shadowbench.harness.scene.scene import Light
from shadowbench.methods.perspective_spherical.parameters import CLAMPS, LIGHT_MAPS, TRIANGLE_TESTS

NAME = "perspective_spherical"

SIZE = 16
SMALL = 10_000
"""Triangles up to which every combination is traced."""

TURNS = 4
"""Of how many scenes one has a pair of map and clamp."""

LARGEST = "buddha"
"""A million triangles: half of the time of all six. It is traced where everything is."""

RADII = {0.3: (0.3, 0.8, 0.52), 2.0: (-0.7, 0.2, 0.68), 1e3: (0.1, 0.99, 0.05), 1e7: (0.48, 0.6, 0.64)}
"""A light's distance from the scene's middle in radii: inside, outside, far, and as far as aimed maps go; its way."""

COARSE = {"light_tiles": "16", "slices": "8", "light_slices": "8"}
OTHERS = {"light_tiles": "9", "tile": "5", "k": "2", "r": "7", "depth_lists": "spans"}
"""Few cells, as there are few rays; and other settings, that must change no answer."""


class Lit:
    """A scene lit from one distance at a time, and what is exact of each."""

    def __init__(self, whole: Prepared):
        lights = []
        for radii, way in RADII.items():
            ahead = np.array(way) / np.linalg.norm(way) * radii * whole.radius
            x, y, z = (whole.middle + whole.centre + ahead).tolist()
            lights.append(Light((x, y, z)))
        self.lights = dict(zip(RADII, lights, strict=True))
        self.prepared = under(whole, replace(whole.scene, lights=tuple(lights), light_path=None))
        exact = self.traced("warp_bvh", {"update": "bvh_rebuild"}, self.prepared.moment(0, SIZE, SIZE))
        self.exact = {radii: {**exact, "shadowed": exact["shadowed"][i : i + 1]} for i, radii in enumerate(RADII)}

    def answers(self, settings: dict[str, str], radii: float) -> dict[str, NDArray]:
        light = (self.lights[radii],)
        self.prepared = under(self.prepared, replace(self.prepared.scene, lights=light))
        return self.traced(NAME, settings, self.prepared.moment(0, SIZE, SIZE))

    def traced(self, name: str, settings: dict[str, str], moment: Moment) -> dict[str, NDArray]:
        limits = Limits(memory=2 << 30)
        session = Session(make_method(name, settings), self.prepared, SIZE, SIZE, "cpu", limits=limits)
        return session.answers(moment)


def combinations(small: bool, turn: int | None) -> Iterator[tuple[str, str, str, float]]:
    """(map, clamp, aimed, radii): all of them, or three of the twelve pairs of map and clamp; beyond 1e3 radii aimed only.

    ``turn``: whole scenes take the pairs in turns. None: this one has all twelve.
    """
    distances = list(RADII)
    for i, light_map in enumerate(LIGHT_MAPS):
        for j, clamp in enumerate(CLAMPS):
            if not small:
                if turn is not None and (i + j + turn) % TURNS:
                    continue
                radii = distances[(i + j if turn is None else 2 * i + turn) % len(distances)]
                yield light_map, clamp, "true" if radii > 1e3 or (i + j // 2) % 2 else "false", radii
                continue
            for radii in distances:
                for aimed in ("true",) if radii > 1e3 else ("true", "false"):
                    yield light_map, clamp, aimed, radii


def check(name: str, turn: int) -> None:
    lit = Lit(prepare(catalogue.resolve(name)))
    count = lit.prepared.triangle_count
    hits = int((lit.exact[2.0]["triangle"] >= 0).sum())
    assert hits > 0.05 * SIZE**2
    assert any(exact["shadowed"].sum() > 0 for exact in lit.exact.values()), "nothing casts a shadow"
    for light_map, clamp, aimed, radii in combinations(count <= SMALL, None if EVERYTHING else turn):
        settings = {**COARSE, "light_map": light_map, "clamp": clamp, "aimed": aimed}
        assert_same(lit.answers(settings, radii), lit.exact[radii], (light_map, clamp, aimed, radii))
    assert_same(lit.answers({**COARSE, "precision": "float32-centred"}, 1e7), lit.exact[1e7], "float32-centred")
    others = TRIANGLE_TESTS[1:]
    for test in others if EVERYTHING else others[turn % len(others) :][:1]:
        settings = {**COARSE, "triangle_test": test}
        assert_same(lit.answers({**settings, **OTHERS}, 2.0), lit.answers(settings, 2.0), test)


STAND_INS = [name for name in catalogue.NAMES if EVERYTHING or name != LARGEST]


@pytest.mark.slow
@pytest.mark.parametrize("name", STAND_INS)
def test_a_stand_in_has_no_error_under_any_map_and_clamp(name):
    check(name, STAND_INS.index(name))


@pytest.mark.slow
@needs_real
@pytest.mark.parametrize("path", MESHES, ids=lambda path: path.stem)
def test_a_real_mesh_has_no_error_under_any_map_and_clamp(path):
    check(str(path), MESHES.index(path))


@pytest.mark.parametrize("small", [False, True])
def test_every_combination_that_is_named_is_traced(small):
    """Of the small and of the whole scenes together, the real ones not counted."""
    every = [one for turn in range(len(STAND_INS)) for one in combinations(small, turn)]
    assert len(set(every)) == (3 * 4 * (4 + 3) if small else len(set(every)))
    assert {(light_map, clamp) for light_map, clamp, _, _ in every} == {(m, c) for m in LIGHT_MAPS for c in CLAMPS}
    assert {(light_map, radii) for light_map, _, _, radii in every} == {(m, r) for m in LIGHT_MAPS for r in RADII}
    for light_map in LIGHT_MAPS:
        assert {aimed for m, _, aimed, radii in every if m == light_map and radii <= 1e3} == {"true", "false"}
    assert len({(clamp, radii) for _, clamp, _, radii in every}) >= 12
    assert len(list(combinations(small, 0))) == (3 * 4 * (4 + 3) if small else 3)
    assert len(list(combinations(small, None))) == (3 * 4 * (4 + 3) if small else 3 * 4)
