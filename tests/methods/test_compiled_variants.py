"""Sizes, slices, r, maps and rectangles are run-time values: what is compiled is a short fixed list."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import warp as wp
from helpers.paper_knobs import answers_of, drawn
from helpers.small_scenes import make_scene, soup
from shadowbench.harness.frame.effects import specialise
from shadowbench.harness.scene.overrides import perforated
from shadowbench.harness.scene.prepared import Prepared, prepare
from shadowbench.harness.scene.scene import Light, Spot
from shadowbench.methods.perspective_spherical.camera import grid as camera
from shadowbench.methods.perspective_spherical.camera.trace import make_resolve_kernel, make_trace_kernel
from shadowbench.methods.perspective_spherical.light import grid as light
from shadowbench.methods.perspective_spherical.light import placement as light_places
from shadowbench.methods.perspective_spherical.light.rays import box_kernel
from shadowbench.methods.perspective_spherical.light.rectangle import make_clamp_kernel
from shadowbench.methods.perspective_spherical.light.tiles import make_bound_kernel
from shadowbench.methods.perspective_spherical.light.trace import make_shadow_kernel
from shadowbench.methods.perspective_spherical.lists.staging import BLOCKS, block_for
from shadowbench.methods.perspective_spherical.parameters import LIGHT_BOUNDS, LIGHT_MAPS, TRIANGLE_TESTS

USERS = (camera, light, light_places)
"""The modules that ask for kernels."""

TESTS = tuple((test,) for test in range(len(TRIANGLE_TESTS)))
TESTS_IN_BLOCKS = tuple((*test, block) for test in TESTS for block in (0, *BLOCKS))
MAPS = tuple((map,) for map in LIGHT_MAPS)
BOUNDS = (*MAPS, *((bounds,) for bounds in LIGHT_BOUNDS if bounds != "exact"))
FACTORIES: dict[Callable[..., wp.Kernel], tuple[tuple[tuple[Any, ...], ...], tuple[str, ...]]] = {
    make_trace_kernel: (TESTS_IN_BLOCKS, ("alpha", "wide")),
    make_resolve_kernel: (TESTS, ("wide",)),
    make_shadow_kernel: (TESTS_IN_BLOCKS, ("alpha", "wide")),
    make_bound_kernel: (BOUNDS, ("wide",)),
    make_clamp_kernel: (MAPS, ()),
}
"""By factory: all that it is given, and the effects that its kernels branch on."""

WITHOUT_FACTORY: dict[wp.Kernel, tuple[str, ...]] = {box_kernel: ("receivers", "wide")}
"""The other kernels that branch on effects, and on which. Kernels that are not listed are compiled once."""

LISTED = {factory.__name__: of for factory, of in FACTORIES.items()} | {
    kernel.key: (((),), effects) for kernel, effects in WITHOUT_FACTORY.items()
}
Made = set[tuple[str, tuple[Any, ...], tuple[str, ...]]]
"""Kernels: the name of the factory (or their own), what it was given, and the effects that they are compiled for."""


@pytest.fixture
def made(monkeypatch) -> Made:
    """What is asked for from now on, whatever was made before: every factory starts anew."""
    found: Made = set()
    origin: dict[wp.Kernel, tuple[str, tuple]] = {kernel: (kernel.key, ()) for kernel in WITHOUT_FACTORY}

    def recorded(factory):
        def make(*arguments):
            kernel = factory(*arguments)
            origin[kernel] = (factory.__name__, arguments)
            found.add((*origin[kernel], ()))
            return kernel

        return make

    def specialised(kernel, switches):
        found.add((*origin[kernel], tuple(name for name in specialise.named(kernel) if getattr(switches, name))))
        return specialise.specialised(kernel, switches)

    for factory in FACTORIES:
        factory.cache_clear()
        users = [module for module in USERS if hasattr(module, factory.__name__)]
        assert users, factory.__name__
        for module in users:
            monkeypatch.setattr(module, factory.__name__, recorded(factory))
    for module in USERS:
        monkeypatch.setattr(module, "specialised", specialised)
    return found


def nothing_else_was_made(made: Made) -> None:
    """All are listed, and factories made what was asked for, so that no kernel was made behind the recorder's back."""
    for name, arguments, effects in made:
        assert arguments in LISTED[name][0], name
        assert set(effects) <= set(LISTED[name][1]), name
    for factory in FACTORIES:
        asked = {arguments for name, arguments, _ in made if name == factory.__name__}
        assert factory.cache_info().currsize == len(asked), factory.__name__


def staged(name: str, arguments: tuple[Any, ...]) -> bool:
    """Whether it is for blocks of more than one thread."""
    return name in ("make_trace_kernel", "make_shadow_kernel") and arguments[1] > 0


def scenes() -> dict[tuple[str, ...], Prepared]:
    """By the effects called for: a plain scene, one with spots, one with holes, one with both."""
    vertices, faces = soup(60, 30)
    spot = Light((2.0, 3.0, 4.0), spot=Spot((-2.0, -3.0, -4.0), 25.0))
    plain = make_scene(vertices, faces, [(2.0, 3.0, 4.0)])
    spotted = make_scene(vertices, faces, [spot])

    def holed(prepared: Prepared) -> Prepared:
        return prepare(replace(prepared.scene, alpha=lambda geometry: perforated(geometry, 2, 2)))

    return {(): plain, ("receivers",): spotted, ("alpha",): holed(plain), ("receivers", "alpha"): holed(spotted)}


def test_every_factory_and_every_kernel_with_effects_is_listed_with_them():
    for factory, (given, effects) in FACTORIES.items():
        assert specialise.named(factory(*given[0])) == effects, factory.__name__
    assert {block_for(threads) for threads in range(1, 70000)} == set(BLOCKS)
    values = [value for module in (*USERS, light_places.rays) for value in vars(module).values()]
    assert {value for value in values if hasattr(value, "cache_info") and value.__name__.startswith("make_")} <= {
        *FACTORIES
    }
    kernels = {value for value in values if isinstance(value, wp.Kernel)}
    assert {kernel: specialise.named(kernel) for kernel in kernels if specialise.named(kernel)} == WITHOUT_FACTORY


def test_plain_kernels_are_those_listed_whatever_is_drawn(made):
    """Some settings call for each of them; twelve more, drawn, for no other."""
    random = np.random.default_rng(77)
    plain = scenes()[()]
    for test in TRIANGLE_TESTS:
        answers_of(plain, 17, 13, drawn(random, triangle_test=test, staging="none", triangle_chunk=3))
    for light_map in LIGHT_MAPS:
        answers_of(plain, 17, 13, {"light_map": light_map, "clamp": "none"})
    for bounds in LIGHT_BOUNDS:
        answers_of(plain, 17, 13, {"light_bounds": bounds})
    for _ in range(12):
        answers_of(plain, 17, 13, drawn(random, triangle_test=random.choice(TRIANGLE_TESTS)))
    assert made == {(name, of, ()) for name, (given, _) in LISTED.items() for of in given if not staged(name, of)}
    nothing_else_was_made(made)


@pytest.mark.slow
def test_effects_and_blocks_make_none_but_those_listed(made, monkeypatch):
    """Also in blocks of more than one thread, on a CPU too: then staged kernels are made, of several sizes."""
    random = np.random.default_rng(78)
    for effects, prepared in scenes().items():
        answers_of(prepared, 17, 13, drawn(random, triangle_test="exact", staging="none"))
        assert effects == () or any(set(on) & set(effects) for _, _, on in made)
    monkeypatch.setattr(wp.config, "enable_cpu_blocks", True)
    # Compiling takes seconds for each block: tracing tiles and chunks of sizes that other tests have as well.
    for sizes in ({"tile": "4", "k": "2", "r": "40"}, {"tile": "9", "k": "2", "r": "200"}):
        settings = drawn(random, triangle_test="exact", staging="shared", triangle_chunk=0, **sizes)
        answers_of(scenes()[()], 17, 13, settings)
    in_blocks = {(name, arguments[1]) for name, arguments, _ in made if staged(name, arguments)}
    assert in_blocks >= {(name, block) for name in ("make_trace_kernel", "make_shadow_kernel") for block in (64, 256)}
    nothing_else_was_made(made)
