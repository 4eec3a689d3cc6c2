"""Compile kernels for exactly the effects that a frame needs.

In a kernel, the code of an effect is in a branch ``if wp.static(effects.NAME):``, where ``effects`` is this module's
:data:`effects`, with every switch off. :func:`specialised` makes a variant of the kernel with other switches on. Warp
does not compile a branch whose condition is false, so an effect that is not needed costs nothing;
``tests/frame/test_effects_compiled.py`` tests this on the machine code. Variants are made on first use and cached.
"""

from __future__ import annotations

import ast
import functools
import inspect
import textwrap
import types
from dataclasses import fields
from typing import Any

import warp as wp

from ...scene.effects import Switches

NAMES = tuple(field.name for field in fields(Switches))

effects = Switches()
"""The switches of a kernel that is not specialised: all off."""


@functools.cache
def named(kernel: wp.Kernel) -> tuple[str, ...]:
    """The switches that a kernel's source branches on."""
    tree = ast.parse(textwrap.dedent(inspect.getsource(kernel.func)))
    used = {
        node.attr for node in ast.walk(tree) if isinstance(node, ast.Attribute) and is_effects(node.value)
    }
    unknown = used - set(NAMES)
    if unknown:
        raise ValueError(f"{kernel.key} uses an unknown effect: {', '.join(sorted(unknown))}")
    return tuple(name for name in NAMES if name in used)


def is_effects(node: ast.AST) -> bool:
    """Whether a syntax node is the name ``effects``."""
    return isinstance(node, ast.Name) and node.id == "effects"


def specialised(kernel: wp.Kernel, switches: Switches) -> wp.Kernel:
    """``kernel`` compiled with ``switches``; the kernel itself if it uses none of the switches that are on."""
    on = tuple(name for name in named(kernel) if getattr(switches, name))
    return _made(kernel, on) if on else kernel


@functools.cache
def _made(kernel: wp.Kernel, on: tuple[str, ...]) -> wp.Kernel:
    return _copied(kernel, {"effects": Switches(**dict.fromkeys(on, True))}, {})


@functools.cache
def with_type(kernel: wp.Kernel, name: str, kind: type) -> wp.Kernel:
    """``kernel`` with another type for one of its parameters."""
    return _copied(kernel, {}, {name: kind})


def _copied(kernel: wp.Kernel, names: dict[str, Any], annotations: dict[str, type]) -> wp.Kernel:
    """A kernel with the same code in a module of its own, where ``names`` and ``annotations`` replace its own."""
    function = kernel.func
    space = {**function.__globals__, **names}
    copy = types.FunctionType(
        function.__code__, space, function.__name__, function.__defaults__, function.__closure__
    )
    copy.__annotations__ = {**function.__annotations__, **annotations}
    copy.__module__, copy.__qualname__, copy.__doc__ = (
        function.__module__,
        function.__qualname__,
        function.__doc__,
    )
    return wp.kernel(copy, module="unique", **kernel.options)
