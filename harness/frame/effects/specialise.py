"""Compile kernels for exactly the effects that a frame needs.

In a kernel, and in the functions that it calls, the code of an effect is in a branch ``if wp.static(effects.NAME):``, where
``effects`` is this module's :data:`effects`, with every switch off. :func:`specialised` makes a variant of the kernel, and
of those functions, with other switches on. Warp does not compile a branch whose condition is false, so an effect that is not
needed costs nothing; ``tests/frame/test_effects_compiled.py`` tests this on the machine code. Variants are made on first use
and cached.
"""

import ast
import dis
import functools
import inspect
import textwrap
import types
from dataclasses import fields
from typing import Any

import warp as wp

from ...scene.effects import Switches

NAMES = tuple(field.name for field in fields(Switches))

effects = Switches()  # the switches of a kernel that is not specialised: all off


@functools.cache
def named(kernel: wp.Kernel) -> tuple[str, ...]:
    """The switches that a kernel or a function that it calls branches on."""
    used = switches_of(kernel.func)
    unknown = used - set(NAMES)
    if unknown:
        raise ValueError(f"{kernel.key} uses an unknown effect: {', '.join(sorted(unknown))}")
    return tuple(name for name in NAMES if name in used)


@functools.cache
def switches_of(function: types.FunctionType) -> frozenset[str]:
    """The same of a function, given as Python's."""
    refuse_hidden(function)
    called = (overload for other in called_by(function).values() for overload in overloads_of(other))
    return own_switches(function).union(*(switches_of(overload.func) for overload in called))


@functools.cache
def own_switches(function: types.FunctionType) -> frozenset[str]:
    """The switches that the source of a kernel or a function itself branches on."""
    if "effects" not in function.__code__.co_names:
        return frozenset()
    nodes = ast.walk(ast.parse(textwrap.dedent(inspect.getsource(function))))
    return frozenset(node.attr for node in nodes if isinstance(node, ast.Attribute) and is_effects(node.value))


def is_effects(node: ast.AST) -> bool:
    """Whether a syntax node is the name ``effects``."""
    return isinstance(node, ast.Name) and node.id == "effects"


def called_by(function: types.FunctionType) -> dict[str, wp.Function]:
    """The functions written in Python that a kernel or a function names, by their names there."""
    named = globals_of(function).items()
    return {name: value for name, value in named if isinstance(value, wp.Function) and value.func}


def globals_of(function: types.FunctionType) -> dict[str, Any]:
    """What a kernel or a function names of its module and of the functions around it."""
    code = function.__code__
    cells = zip(code.co_freevars, function.__closure__ or (), strict=True)
    # Not all of co_names: among these are attributes, which may have the name of a function of the module.
    read = {step.argval for step in dis.get_instructions(code) if step.opname == "LOAD_GLOBAL"}
    return {name: function.__globals__.get(name) for name in read} | {name: cell.cell_contents for name, cell in cells}


def refuse_hidden(function: types.FunctionType) -> None:
    """Raise ValueError for a function with effects that is called through its module, where no variant would replace it."""
    named = globals_of(function)
    for module in (value for value in named.values() if isinstance(value, types.ModuleType)):
        for name in {*function.__code__.co_names} - named.keys():
            value = getattr(module, name, None)
            if isinstance(value, wp.Function) and value.func and switches_of(value.func):
                raise ValueError(f"{function.__name__} must import {name} by its name: it branches on an effect")


def overloads_of(function: wp.Function) -> list[wp.Function]:
    """The overloads of a function as they are written: without the instances that Warp made of generic ones."""
    made = [*function.user_overloads.values(), *function.user_templates.values()]
    return [overload for overload in made if overload.generic_parent is None]


def specialised(kernel: wp.Kernel, switches: Switches) -> wp.Kernel:
    """``kernel`` compiled with ``switches``; the kernel itself if it uses none of the switches that are on."""
    on = tuple(name for name in named(kernel) if getattr(switches, name))
    return _made(kernel, on) if on else kernel


@functools.cache
def _made(kernel: wp.Kernel, on: tuple[str, ...]) -> wp.Kernel:
    return wp.kernel(_switched(kernel.func, on), module="unique", **kernel.options)


@functools.cache
def _function(function: wp.Function, on: tuple[str, ...]) -> wp.Function:
    """A function with switches on, in all its overloads."""
    first, *others = (wp.func(_switched(one.func, on), module="unique") for one in overloads_of(function))
    for other in others:
        first.add_overload(other)
    return first


def _switched(function: types.FunctionType, on: tuple[str, ...]) -> types.FunctionType:
    """A kernel's or function's Python function with switches on, which calls what it calls with these on."""
    names: dict[str, Any] = {"effects": Switches(**dict.fromkeys(on, True))}
    for name, called in called_by(function).items():
        if any(switches_of(overload.func) & set(on) for overload in overloads_of(called)):
            names[name] = _function(called, on)
    return copied(function, names, {})


@functools.cache
def with_type(kernel: wp.Kernel, name: str, kind: type) -> wp.Kernel:
    """``kernel`` with another type for one of its parameters."""
    return wp.kernel(copied(kernel.func, {}, {name: kind}), module="unique", **kernel.options)


def copied(function: types.FunctionType, names: dict[str, Any], annotations: dict[str, type]) -> types.FunctionType:
    """A function with the same code, where ``names`` and ``annotations`` replace its own."""
    space = {**function.__globals__, **names}
    cells = tuple(
        types.CellType(names[name]) if name in names else cell
        for name, cell in zip(function.__code__.co_freevars, function.__closure__ or (), strict=True)
    )
    copy = types.FunctionType(function.__code__, space, function.__name__, function.__defaults__, cells)
    copy.__annotations__ = {**function.__annotations__, **annotations}
    copy.__module__, copy.__qualname__, copy.__doc__ = (function.__module__, function.__qualname__, function.__doc__)
    return copy
