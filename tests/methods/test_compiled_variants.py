"""Sizes, slices, r, maps and rectangles are run-time values: what is compiled is a short fixed list."""

from dataclasses import replace

import numpy as np
import pytest
import warp as wp
from helpers.compiled_variants import FACTORIES, WITHOUT_FACTORY, Compiled, compiled_variants
from helpers.paper_knobs import answers_of, drawn
from helpers.small_scenes import make_scene, soup
from shadowbench.harness.frame.effects import specialise
from shadowbench.harness.scene.overrides import perforated
from shadowbench.harness.scene.prepared import Prepared, prepare
from shadowbench.harness.scene.scene import Light, Spot
from shadowbench.methods.perspective_spherical.camera import grid as camera
from shadowbench.methods.perspective_spherical.light import grid as light
from shadowbench.methods.perspective_spherical.light import placement as light_places
from shadowbench.methods.perspective_spherical.lists.staging import BLOCKS, block_for
from shadowbench.methods.perspective_spherical.parameters import LIGHT_BOUNDS, LIGHT_MAPS, TRIANGLE_TESTS

USERS = (camera, light, light_places)
"""The modules that ask for kernels."""


@pytest.fixture
def made(monkeypatch) -> set[Compiled]:
    """What is asked for from now on, whatever was made before: every factory starts anew."""
    found: set[Compiled] = set()
    origin: dict[wp.Kernel, tuple[str, tuple]] = {kernel: (kernel.key, ()) for kernel in WITHOUT_FACTORY}

    def recorded(factory):
        def make(*arguments):
            kernel = factory(*arguments)
            origin[kernel] = (factory.__name__, arguments)
            found.add(Compiled(*origin[kernel]))
            return kernel

        return make

    def specialised(kernel, switches):
        on = tuple(name for name in specialise.named(kernel) if getattr(switches, name))
        found.add(Compiled(*origin[kernel], on))
        return specialise.specialised(kernel, switches)

    for factory in FACTORIES:
        factory.cache_clear()
        users = [module for module in USERS if hasattr(module, factory.__name__)]
        assert users, factory.__name__
        for module in users:
            monkeypatch.setattr(module, factory.__name__, recorded(factory))
    for module in USERS:
        assert hasattr(module, "specialised")
        monkeypatch.setattr(module, "specialised", specialised)
    return found


def nothing_else_was_made(made: set[Compiled]) -> None:
    """Factories made what was asked for, so that no kernel was made behind the recorder's back."""
    for factory in FACTORIES:
        asked = {one.arguments for one in made if one.name == factory.__name__}
        assert factory.cache_info().currsize == len(asked), factory.__name__


def staged(one: Compiled) -> bool:
    """Whether it is for blocks of more than one thread."""
    return one.name in ("make_trace_kernel", "make_shadow_kernel") and one.arguments[1] > 0


def scenes() -> dict[tuple[str, ...], Prepared]:
    """By the effects called for: a plain scene, one with spots, one with holes, one with both."""
    vertices, faces = soup(60, 30)
    spot = Light((2.0, 3.0, 4.0), spot=Spot((-2.0, -3.0, -4.0), 25.0))
    plain = make_scene(vertices, faces, [(2.0, 3.0, 4.0)])
    spotted = make_scene(vertices, faces, [spot])

    def holed(prepared: Prepared) -> Prepared:
        return prepare(replace(prepared.scene, alpha=lambda geometry: perforated(geometry, 2, 2)))

    return {(): plain, ("receivers",): spotted, ("alpha",): holed(plain), ("receivers", "alpha"): holed(spotted)}


def test_the_list_is_short_and_names_every_effect_that_kernels_branch_on():
    every = list(compiled_variants())
    assert len(set(every)) == len(every)
    tests, blocks, maps = len(TRIANGLE_TESTS), 1 + len(BLOCKS), len(LIGHT_MAPS)
    bounds = maps + len(LIGHT_BOUNDS) - 1
    assert (tests, blocks, maps, bounds) == (3, 5, 3, 5)
    plain = tests + 2 * tests * blocks + maps + bounds + 1
    assert sum(one.effects == () for one in every) == plain == 42
    assert len(every) == 4 * 2 * tests * blocks + 2 * (tests + bounds) + 4 + maps == 143
    for factory, (given, effects) in FACTORIES.items():
        assert specialise.named(factory(*given[0])) == effects, factory.__name__
    for kernel, effects in WITHOUT_FACTORY.items():
        assert specialise.named(kernel) == effects
    assert {block_for(threads) for threads in range(1, 70000)} == set(BLOCKS)


def test_every_factory_and_every_kernel_with_effects_is_listed():
    for module in USERS:
        for name, value in vars(module).items():
            if hasattr(value, "cache_info") and name.startswith("make_"):
                assert value in FACTORIES, name
            if isinstance(value, wp.Kernel):
                assert value in WITHOUT_FACTORY or not specialise.named(value), name
    for value in vars(light_places.rays).values():
        if isinstance(value, wp.Kernel):
            assert value in WITHOUT_FACTORY or not specialise.named(value), value.key


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
    assert made == {one for one in compiled_variants() if not one.effects and not staged(one)}
    nothing_else_was_made(made)


@pytest.mark.slow
def test_effects_and_blocks_make_none_but_those_listed(made, monkeypatch):
    """Also in blocks of more than one thread, on a CPU too: then staged kernels are made, of several sizes."""
    random = np.random.default_rng(78)
    for effects, prepared in scenes().items():
        answers_of(prepared, 17, 13, drawn(random, triangle_test="exact", staging="none"))
        assert effects == () or any(set(one.effects) & set(effects) for one in made)
    monkeypatch.setattr(wp.config, "enable_cpu_blocks", True)
    # Compiling takes seconds for each block: tracing tiles and chunks of sizes that other tests have as well.
    for sizes in ({"tile": "4", "k": "2", "r": "40"}, {"tile": "9", "k": "2", "r": "200"}):
        settings = drawn(random, triangle_test="exact", staging="shared", triangle_chunk=0, **sizes)
        answers_of(scenes()[()], 17, 13, settings)
    in_blocks = {(one.name, one.arguments[1]) for one in made if staged(one)}
    assert in_blocks >= {(name, block) for name in ("make_trace_kernel", "make_shadow_kernel") for block in (64, 256)}
    assert made <= set(compiled_variants())
    nothing_else_was_made(made)
