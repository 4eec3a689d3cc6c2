"""An effect that is off costs nothing (``specialise.py``): a kernel compiles to the code of its twin, which never
heard of the effect.
"""

from __future__ import annotations

import ast
import functools
import itertools
import re
from dataclasses import replace
from pathlib import Path

import pytest
import shadowbench.methods
from helpers.compiled_twins import (
    Cut,
    compiled,
    effect_of,
    functions_of,
    generated,
    generated_together,
    kernels_with_effects,
    own,
    source_of,
    source_without,
    with_source,
    without,
)
from shadowbench.harness.frame.effects import specialise
from shadowbench.harness.frame.effects.specialise import NAMES, called_by, named, overloads_of, specialised
from shadowbench.harness.scene.effects import Switches
from shadowbench.methods.exact import hit_point

kernels = functools.cache(kernels_with_effects)
"""Every kernel that branches on an effect, by its name. Made in the test that asks first: it takes seconds."""

SMALL = "methods.perspective_spherical.light.rays.box_kernel"
"""A kernel that branches on receivers and calls little: compiled in a quarter of a second."""

ROOT = Path(shadowbench.methods.__path__[0]).parent


def others(kernel, effect):
    """Switches with ``effect`` off: all others off, and all others on where there are any."""
    rest = {name: True for name in own(kernel) if name != effect}
    return [Switches(), Switches(**rest)] if rest else [Switches()]


def generated_variants(kernel):
    """The code of a kernel and of its twins, by the switches and the effect that is cut out, "" for none."""
    variants = {}
    for effect in own(kernel):
        for switches in others(kernel, effect):
            variants[switches, ""] = source_of(kernel), switches
            variants[switches, effect] = source_without(kernel, effect), switches
        left_on = replace(switches, **{effect: True})
        variants[left_on, ""] = source_of(kernel), left_on
    return generated_together(kernel, variants, "cpu")


def test_off_generates_the_code_of_the_twin_and_on_does_not():
    """For the CPU: a branch is taken or left before a target has any part in it (for a GPU: the kernels below)."""
    for name, kernel in kernels().items():
        code = generated_variants(kernel)
        for effect in own(kernel):
            for switches in others(kernel, effect):
                off = code[switches, ""]
                assert off == code[switches, effect], (name, effect)
            assert code[replace(switches, **{effect: True}), ""] != off, (name, effect)


@pytest.mark.slow
@pytest.mark.parametrize("target", ["cpu", "cuda"])
def test_the_same_generated_code_is_the_same_machine_code(target, tmp_path):
    """What the comparison leaves out of generated code is in no binary. With the effect on, the binary shows the difference
    that the others must not have.
    """
    kernel = kernels()[SMALL]
    made = {
        "off": with_source(kernel, source_of(kernel), Switches()),
        "twin": with_source(kernel, source_without(kernel, "receivers"), Switches()),
        "on": with_source(kernel, source_of(kernel), Switches(receivers=True)),
    }
    code = {name: compiled(one, tmp_path / name, target) for name, one in made.items()}
    assert code["off"].source == code["twin"].source == generated(made["off"], target)
    assert code["off"].binary == code["twin"].binary
    assert code["on"].source != code["twin"].source
    assert code["on"].binary != code["twin"].binary


def test_every_effect_has_a_kernel_that_is_compared():
    assert {effect for kernel in kernels().values() for effect in named(kernel)} == {*NAMES}


def functions_with_effects(function):
    """The functions that a kernel or function calls, at any depth, and that branch on an effect."""
    found = {}
    for called in called_by(function).values():
        for overload in overloads_of(called):
            if own(overload):
                found[overload.func] = overload
            found |= functions_with_effects(overload.func)
    return found


@pytest.mark.slow
def test_an_effect_of_functions_generates_nothing_where_it_is_off():
    """Of each function that branches on an effect, a kernel that calls it, and its twin whose functions do not."""
    left = {}
    for kernel in kernels().values():
        for function in functions_with_effects(kernel.func).values():
            left.setdefault(function.func, (kernel, own(function)))
    for kernel, effect in {(kernel, effect) for kernel, effects in left.values() for effect in effects}:
        off = functions_in(with_source(kernel, source_of(kernel), Switches()), kernel)
        assert off == functions_in(without(kernel, effect), kernel), kernel.key
        assert off != functions_in(specialised(kernel, Switches(**{effect: True})), kernel)


def functions_in(kernel, like):
    """The functions that Warp generates of a kernel, in any order, without the numbers that tell those of one name, and
    those that take other functions, apart.

    A generic kernel has the overloads of the one that it is ``like``.
    """
    if kernel.is_generic:
        for overload in like.overloads.values():
            kernel.add_overload(list(overload.adj.arg_types.values()))
    parts = functions_of(generated(kernel, "cpu"))
    named_alike = {re.sub(r"_callable_[0-9a-f]+\b", "", part) for part in parts}
    return {re.sub(r"\b([A-Za-z]\w*)_\d+\b", r"\1", part) for part in named_alike}


def test_every_branch_on_an_effect_is_in_a_kernel_that_is_compared():
    compared = {kernel.func.__code__.co_filename + kernel.func.__name__ for kernel in kernels().values()}
    compared |= {
        function.__code__.co_filename + function.__name__
        for kernel in kernels().values()
        for function in functions_with_effects(kernel.func)
    }
    seen = 0
    for file in [*ROOT.glob("methods/**/*.py"), *ROOT.glob("harness/**/*.py")]:
        if "wp.static(effects." not in file.read_text():
            continue
        for node in ast.walk(ast.parse(file.read_text())):
            if isinstance(node, ast.FunctionDef) and any(effect_of(n) for n in ast.walk(node)):
                inner = [n for n in ast.walk(node) if isinstance(n, ast.FunctionDef) and n is not node]
                if any(effect_of(m) for n in inner for m in ast.walk(n)):
                    continue  # a factory: its kernel is counted
                seen += 1
                assert str(file) + node.name in {str(Path(c).resolve()) for c in compared} | compared, (
                    f"{file.name}: {node.name} branches on an effect and is not compared"
                )
    assert seen >= 6


def test_variants_are_few_and_made_once():
    for kernel in kernels().values():
        names = named(kernel)
        assert specialised(kernel, Switches()) is kernel
        unnamed = {name: True for name in NAMES if name not in names}
        for flags in list(itertools.product((False, True), repeat=len(names)))[1:]:
            switches = dict(zip(names, flags, strict=True))
            made = specialised(kernel, Switches(**switches))
            assert made is not kernel
            assert made is specialised(kernel, Switches(**switches, **unnamed))
    assert max(2 ** len(named(kernel)) for kernel in kernels().values()) <= 16  # docs/effects.md says so


def test_a_made_variant_is_the_kernel_with_the_switch_on(tmp_path):
    kernel = kernels()["methods.rays.kernels.make_shadow_kernel"]
    made = specialised(kernel, Switches(receivers=True))
    assert made.options == kernel.options
    assert made.func.__globals__["effects"].receivers
    assert not kernel.func.__globals__["effects"].receivers


def test_an_unknown_effect_is_refused():
    class Named:
        key = "kernel"
        func = _unknown

    with pytest.raises(ValueError, match="sparkle"):
        specialise.named.__wrapped__(Named)


def test_a_function_with_effects_that_is_called_through_its_module_is_refused():
    with pytest.raises(ValueError, match="_through_a_module must import is_flat by its name"):
        specialise.switches_of(_through_a_module)


def _through_a_module():
    return hit_point.is_flat


def _unknown():
    from shadowbench.harness.frame.effects.specialise import effects

    return effects.sparkle


def test_an_else_branch_stays():
    tree = ast.parse("if wp.static(effects.receivers):\n    a()\nelse:\n    b()\n")
    assert ast.unparse(Cut("receivers").visit(tree)) == "b()"
