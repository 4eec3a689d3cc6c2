"""Every kernel of the paper's method that is compiled in variants: a short fixed list, whatever the sizes and settings.

What is no argument of a factory here, and no switch, is a run-time value: image, tiles, slices, r, k, rectangles, clamp,
chunks. Kernels that are not listed are compiled once.
"""

from collections.abc import Callable, Iterator
from itertools import combinations
from typing import Any, NamedTuple

import warp as wp
from shadowbench.methods.perspective_spherical.camera.trace import make_resolve_kernel, make_trace_kernel
from shadowbench.methods.perspective_spherical.light.rays import box_kernel
from shadowbench.methods.perspective_spherical.light.rectangle import make_clamp_kernel
from shadowbench.methods.perspective_spherical.light.tiles import make_bound_kernel
from shadowbench.methods.perspective_spherical.light.trace import make_shadow_kernel
from shadowbench.methods.perspective_spherical.lists.staging import BLOCKS
from shadowbench.methods.perspective_spherical.parameters import LIGHT_BOUNDS, LIGHT_MAPS, TRIANGLE_TESTS


class Compiled(NamedTuple):
    """A kernel: the name of its factory (or its own), what the factory was given, and the effects it is compiled for."""

    name: str
    arguments: tuple[Any, ...]
    effects: tuple[str, ...] = ()


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
"""The other kernels that branch on effects, and on which."""


def compiled_variants() -> Iterator[Compiled]:
    """All there are; those for plain scenes first, of each factory."""
    for factory, (given, effects) in FACTORIES.items():
        for on in _sets(effects):
            yield from (Compiled(factory.__name__, arguments, on) for arguments in given)
    for kernel, effects in WITHOUT_FACTORY.items():
        yield from (Compiled(kernel.key, (), on) for on in _sets(effects))


def _sets(effects: tuple[str, ...]) -> Iterator[tuple[str, ...]]:
    for count in range(len(effects) + 1):
        yield from combinations(effects, count)
