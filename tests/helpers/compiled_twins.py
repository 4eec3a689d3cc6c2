"""Kernels with an effect's branches cut out of their syntax tree, and the code that Warp makes of a kernel.

The twin of a kernel never heard of the effect: what stands under ``if wp.static(effects.NAME):`` is removed from its
source before Warp sees it. What Warp makes of a kernel with the effect off must be the same, in generated source, in
machine code for the CPU, and in the binary for a GPU, which is compiled here without one.
"""

import ast
import collections
import importlib
import inspect
import pkgutil
import re
import textwrap
import types
from collections.abc import Hashable, Mapping
from dataclasses import dataclass
from pathlib import Path

import shadowbench.harness
import shadowbench.methods
import warp as wp
from shadowbench.harness.frame.effects.specialise import (
    NAMES,
    called_by,
    copied,
    is_effects,
    overloads_of,
    own_switches,
    switches_of,
)
from shadowbench.harness.scene.effects import Switches
from shadowbench.methods.grids.cells import make_kernels as make_grid_kernels
from shadowbench.methods.perspective_spherical.camera.trace import make_trace_kernel
from shadowbench.methods.perspective_spherical.light.trace import make_shadow_kernel
from shadowbench.methods.rays import kernels as ray_kernels
from shadowbench.methods.streams.camera import resolve as camera_resolve
from shadowbench.methods.streams.camera import stream as camera_stream
from shadowbench.methods.streams.occlusion import rows as light_rows
from shadowbench.methods.streams.occlusion import stream as light_stream
from shadowbench.methods.streams.occlusion import undecided as light_undecided
from shadowbench.methods.streams.rays import sort
from shadowbench.methods.trees.trace import closest as tree_closest
from shadowbench.methods.trees.trace import shadow as tree_shadow
from shadowbench.methods.warp_bvh import mesh_kernels
from warp._src.context import Module

ARCH = 90


def effect_of(node: ast.AST) -> str | None:
    """NAME, where a node is ``if wp.static(effects.NAME):``."""
    if not isinstance(node, ast.If) or not isinstance(node.test, ast.Call) or len(node.test.args) != 1:
        return None
    asked = node.test.args[0]
    if ast.unparse(node.test.func) != "wp.static" or not isinstance(asked, ast.Attribute):
        return None
    return asked.attr if is_effects(asked.value) else None


class Cut(ast.NodeTransformer):
    """Removes every branch of one effect; an ``else`` stays."""

    def __init__(self, effect: str) -> None:
        self.effect = effect
        self.removed = 0

    def visit_If(self, node: ast.If) -> ast.AST | list[ast.stmt] | None:
        self.generic_visit(node)
        if effect_of(node) != self.effect:
            return node
        self.removed += 1
        return node.orelse or None


def own(kernel: wp.Kernel | wp.Function) -> tuple[str, ...]:
    """The switches that the source of a kernel, or of a function, itself branches on."""
    return tuple(name for name in NAMES if name in own_switches(kernel.func))


def source_of(kernel: wp.Kernel) -> str:
    return textwrap.dedent(inspect.getsource(kernel.func))


def without(kernel: wp.Kernel, effect: str) -> wp.Kernel:
    """The kernel with functions that never heard of the effect, in a module of its own."""
    copy = copied(kernel.func, _cut_calls(kernel.func, effect), {})
    return wp.Kernel(copy, key=kernel.func.__name__, module=Module("twin", None), options=dict(kernel.options))


def _cut_calls(function: types.FunctionType, effect: str) -> dict[str, wp.Function]:
    """What a kernel or function calls, by name, without the effect, where it branches on that."""
    found = {}
    for name, called in called_by(function).items():
        overloads = overloads_of(called)
        if any(effect in switches_of(overload.func) for overload in overloads):
            first, *others = (_cut_function(overload, effect) for overload in overloads)
            for other in others:
                first.add_overload(other)
            found[name] = first
    return found


def _cut_function(function: wp.Function, effect: str) -> wp.Function:
    copy = copied(function.func, _cut_calls(function.func, effect), {})
    source = source_without(function, effect) if effect in own(function) else None
    return wp.Function(
        func=copy, key=function.key, namespace="", module=Module("twin", None), source=source, scope_locals={}
    )


def source_without(kernel: wp.Kernel | wp.Function, effect: str) -> str:
    """The kernel's source with the effect's branches removed. Fails where nothing of the effect can be removed."""
    tree = ast.parse(source_of(kernel))
    cut = Cut(effect)
    tree = cut.visit(tree)
    assert cut.removed, f"{kernel.key} names {effect} outside of `if wp.static(effects.{effect}):`"
    left = [n for n in ast.walk(tree) if isinstance(n, ast.Attribute) and is_effects(n.value) and n.attr == effect]
    assert not left, f"{kernel.key}: {effect} is named where it cannot be cut"
    return ast.unparse(ast.fix_missing_locations(tree))


def with_source(
    kernel: wp.Kernel, source: str, switches: Switches, module: Module | None = None, key: str = ""
) -> wp.Kernel:
    """The kernel as Warp makes it of ``source``, in a module of its own whose name is always the same.

    ``module``, ``key``: a module that it shares with others, and its name there.
    """
    function = kernel.func
    space = {**function.__globals__, "effects": switches}
    copy = types.FunctionType(function.__code__, space, function.__name__, function.__defaults__, function.__closure__)
    copy.__annotations__ = function.__annotations__
    module = module or Module("twin", None)
    key = key or function.__name__
    return wp.Kernel(copy, key=key, module=module, options=dict(kernel.options), source=source)


@dataclass(frozen=True)
class Code:
    """What Warp made of a kernel: generated source without comments, and the compiled file."""

    source: str
    binary: bytes


def compiled(kernel: wp.Kernel, folder: Path, target: str) -> Code:
    """The code for "cpu" or "cuda"."""
    folder.mkdir(parents=True)
    place = {"device": "cpu"} if target == "cpu" else {"arch": ARCH}
    wp.compile_aot_module(kernel.module, module_dir=folder, strip_hash=True, **place)
    text = next(folder.glob("*.cpp" if target == "cpu" else "*.cu")).read_text()
    binary = next(p for p in sorted(folder.iterdir()) if p.suffix in (".o", ".cubin", ".ptx"))
    return Code(normalised(text), binary.read_bytes())


def generated(kernel: wp.Kernel, target: str) -> str:
    """The source that Warp generates for "cpu" or "cuda", as in :class:`Code`, without compiling it."""
    module = kernel.module
    module._set_strip_hash(True)
    options = module.resolve_options(wp.config) | {"output_arch": None if target == "cpu" else ARCH}
    return normalised(module._run_codegen(options, target == "cpu")[0])


def generated_together(
    kernel: wp.Kernel, variants: Mapping[Hashable, tuple[str, Switches]], target: str
) -> dict[Hashable, str]:
    """What Warp generates of each (source, switches) of a kernel, without what they share: the functions they call.

    In one module, because it is those functions that take the time.
    """
    module = Module("twins", None)
    keys = {name: f"twin{number:03}" for number, name in enumerate(variants)}
    for name, (source, switches) in variants.items():
        with_source(kernel, source, switches, module, keys[name])
    module._set_strip_hash(True)
    options = module.resolve_options(wp.config) | {"output_arch": None if target == "cpu" else ARCH}
    parts = functions_of(module._run_codegen(options, target == "cpu")[0])
    found: dict[Hashable, str] = {}
    for name, key in keys.items():
        own = [part for part in parts if key in part]
        assert own, f"{kernel.key}: no code of {name}"
        assert not any(other in part for part in own for other in keys.values() if other != key)
        found[name] = "\n".join(own).replace(key, "twin")
    return found


def normalised(text: str) -> str:
    """Generated source without comments and without constants that nothing uses; variables numbered as they come.

    ``wp.static`` leaves the constant it was asked for, which no line reads and which the compiler drops.
    """
    return "\n".join(functions_of(text))


def functions_of(text: str) -> list[str]:
    """The functions and structures of generated source, each as :func:`normalised`."""
    lines = [line for line in re.sub(r"//.*", "", text).splitlines() if line.strip()]
    functions: list[list[str]] = [[]]
    for line in lines:  # a variable's name means something within its function only
        if line.startswith(("static", "extern", "void", "struct", "template", "WP_API")):
            functions.append([])
        functions[-1].append(line)
    return ["\n".join(_renumbered(part)) for part in functions]


def _renumbered(lines: list[str]) -> list[str]:
    number = re.compile(r"\b(?:var|adj)_\d+\b")
    uses = collections.Counter(name for line in lines for name in number.findall(line))
    unused = re.compile(r"\s*const \w+ (var_\d+) = (?:true|false);\s*$")
    kept = [line for line in lines if not ((m := unused.match(line)) and uses[m[1]] == 1)]
    names: dict[str, str] = {}
    return [number.sub(lambda m: names.setdefault(m[0], f"v{len(names)}"), line) for line in kept]


def made_kernels() -> dict[str, wp.Kernel]:
    """One kernel of every factory: a factory's other kernels have the same source."""
    made = {
        make_trace_kernel: make_trace_kernel(0, 64),
        make_shadow_kernel: make_shadow_kernel(0, 64),
        camera_stream.make_stream_kernel: camera_stream.make_stream_kernel(),
        camera_resolve.make_resolve_kernel: camera_resolve.make_resolve_kernel("rounded"),
        light_stream.make_stream_kernel: light_stream.make_stream_kernel(True),
        light_rows.make_rows_kernel: light_rows.make_rows_kernel(False),
        sort.make_scatter_kernel: sort.make_scatter_kernel(False),
        light_undecided.make_undecided_kernel: light_undecided.make_undecided_kernel(False, False),
        ray_kernels.make_primary_kernel: make_grid_kernels()[0],
        ray_kernels.make_shadow_kernel: make_grid_kernels()[1],
        tree_closest.make_eye_kernel: tree_closest.make_eye_kernel(True, False),
        tree_closest.make_listed_kernel: tree_closest.make_listed_kernel(True),
        tree_closest.make_tests_kernel: tree_closest.make_tests_kernel("eye", True),
        tree_closest.make_resolve_kernel: tree_closest.make_resolve_kernel(False),
        tree_shadow.make_shadow_kernel: tree_shadow.make_shadow_kernel(True, True),
        tree_shadow.make_shadow_tests_kernel: tree_shadow.make_shadow_tests_kernel(True),
        mesh_kernels.make_mesh_shadow_kernel: mesh_kernels.make_mesh_shadow_kernel("plain_cut"),
    }
    return {f"{f.__module__.split('.', 1)[1]}.{f.__name__}": kernel for f, kernel in made.items()}


def kernels_with_effects() -> dict[str, wp.Kernel]:
    """Every kernel of harness and methods that branches on an effect, or calls a function that does, by module and name."""
    found = {name: kernel for name, kernel in made_kernels().items() if switches_of(kernel.func)}
    for package in (shadowbench.methods, shadowbench.harness):
        for entry in pkgutil.walk_packages(package.__path__, package.__name__ + "."):
            module = importlib.import_module(entry.name)
            for name, value in vars(module).items():
                if isinstance(value, wp.Kernel) and value.module.name == entry.name and switches_of(value.func):
                    found[f"{entry.name.split('.', 1)[1]}.{name}"] = value
    return found
