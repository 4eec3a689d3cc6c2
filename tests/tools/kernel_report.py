"""Registers, spilled bytes and instructions of the hot kernels, read from their binaries for an H200: no GPU needed.

    python tests/tools/kernel_report.py            compile, and print the table beside what is recorded
    python tests/tools/kernel_report.py bvh2       only modules whose names begin so
    python tests/tools/kernel_report.py --record   keep what was found as results/kernels.csv

A binary for the GPU is an ELF file: a kernel's instructions are its section ``.text.NAME``, 16 bytes each, and the
sections ``.nv.info`` hold pairs (symbol, value) of registers a thread and bytes of its stack. The stack is what
does not fit into registers.
"""

import csv
import re
import struct
import sys
from collections.abc import Iterator
from dataclasses import astuple, dataclass, fields
from pathlib import Path

import warp as wp

ARCH = 90
RECORD = Path(__file__).resolve().parents[2] / "results" / "kernels.csv"

INSTRUCTION_BYTES = 16
SYMBOL_BYTES = 24
SYMBOL_TABLE = 2
REGISTERS, STACK = 0x2F, 0x11  # attributes of .nv.info
VALUES = 0x04  # its entries that hold more than 16 bits


@dataclass(frozen=True)
class Use:
    """What a kernel takes: registers a thread, stack bytes a thread, instructions in all."""

    registers: int
    stack_bytes: int
    instructions: int


def hot_modules() -> dict[str, wp.Module | str]:
    """Modules of the kernels in which frames spend their time, by the package they belong to."""
    from shadowbench.harness.frame.effects.specialise import specialised
    from shadowbench.harness.scene.effects import Switches
    from shadowbench.methods.common.box_tree import Boxes, walk
    from shadowbench.methods.grids.cells import make_kernels
    from shadowbench.methods.perspective_spherical.camera.trace import make_trace_kernel
    from shadowbench.methods.perspective_spherical.light.trace import make_shadow_kernel as make_chunk_kernel
    from shadowbench.methods.rays.kernels import make_primary_kernel, make_shadow_kernel
    from shadowbench.methods.streams.camera import rows as camera_rows
    from shadowbench.methods.streams.camera import stream as camera_stream
    from shadowbench.methods.streams.camera.resolve import make_resolve_kernel
    from shadowbench.methods.streams.cube import lights
    from shadowbench.methods.streams.occlusion import rows as light_rows
    from shadowbench.methods.streams.occlusion import stream as light_stream
    from shadowbench.methods.streams.occlusion import undecided as light_undecided
    from shadowbench.methods.streams.rays import region
    from shadowbench.methods.streams.rays import sort as sort_rays
    from shadowbench.methods.streams.rays.place import make_place_kernel
    from shadowbench.methods.trees.builders import hploc, lbvh, sort
    from shadowbench.methods.trees.trace import closest, shadow
    from shadowbench.methods.two_level_bvh import poses

    holes, bounced = Switches(alpha=True), Switches(bounced=True)
    grid_primary, grid_shadow = make_kernels()
    return {
        "warp_bvh: primary": make_primary_kernel(Boxes, walk).module,
        "warp_bvh: shadow": make_shadow_kernel(Boxes, walk).module,
        "uniform_grid: primary": grid_primary.module,
        "uniform_grid: shadow": grid_shadow.module,
        "ray_grids camera: stream": camera_stream.make_stream_kernel().module,
        "ray_grids camera: rows": camera_rows.__name__,
        "ray_grids camera": camera_stream.__name__,
        "ray_grids camera: resolve": make_resolve_kernel("none").module,
        "ray_grids light: aim": lights.__name__,
        "ray_grids light: region": region.__name__,
        "ray_grids light: place": make_place_kernel("hits", "known").module,
        "ray_grids light: place, region found": make_place_kernel("hits", "found").module,
        "ray_grids light: place, spot": make_place_kernel("marked", "cone").module,
        "ray_grids light: sort": sort_rays.__name__,
        "ray_grids light: scatter": sort_rays.make_scatter_kernel(False).module,
        "ray_grids light: scatter, region found": sort_rays.make_scatter_kernel(True).module,
        "ray_grids light: stream": light_stream.make_stream_kernel(False).module,
        "ray_grids light: stream, few triangles": light_stream.make_stream_kernel(True).module,
        "ray_grids light: stream, fewer": light_stream.make_stream_kernel(True, False).module,
        "ray_grids light: rows": light_rows.make_rows_kernel(False).module,
        "ray_grids light: undecided": light_undecided.make_undecided_kernel(False, False).module,
        "ray_grids light: undecided of a spot": light_undecided.make_undecided_kernel(False, True).module,
        "ray_grids light: split": light_rows.__name__,
        "bvh2: tree": hploc.make_hploc_kernel(2).module,
        "bvh2: tree, lbvh": lbvh.make_lbvh_kernel().module,
        "bvh2: refit": "shadowbench.methods.trees.builders.refit",
        "bvh2: sort": sort.make_sweep_kernel(8).module,
        "bvh2: sort, large": sort.make_sweep_kernel(16).module,
        "bvh2: box": "shadowbench.methods.trees.builders.scene_box",
        "bvh2: keys": "shadowbench.methods.trees.builders.keys",
        "bvh2: triangles": "shadowbench.methods.trees.records.planes",
        "bvh2: triangles, rays": "shadowbench.methods.trees.records.rays",
        "bvh2: primary": closest.make_eye_kernel(True, False).module,
        "bvh2: primary and shadow": shadow.make_together_kernel(True, False).module,
        "bvh2: primary and shadow, packets": shadow.make_together_kernel(True, True).module,
        "bvh2: primary and shadow, float32": shadow.make_together_kernel(False, False).module,
        "bvh2: primary, holes": specialised(closest.make_eye_kernel(True, False), holes).module,
        "bvh2: primary, packets": closest.make_eye_kernel(True, True).module,
        "bvh2: primary, float32": closest.make_eye_kernel(False, False).module,
        "bvh2: shadow": shadow.make_shadow_kernel(True, False).module,
        "bvh2: shadow, float32": shadow.make_shadow_kernel(False, False).module,
        "bvh2: shadow, holes": specialised(shadow.make_shadow_kernel(True, False), holes).module,
        "bvh2: mirrored": closest.make_listed_kernel(True).module,
        "bvh2: mirrored, float32": closest.make_listed_kernel(False).module,
        "bvh2: mirrored, list": "shadowbench.methods.trees.trace.closest",
        "bvh2: mirrored, resolve": closest.make_resolve_kernel(False).module,
        "bvh2: mirrored, shadow": specialised(shadow.make_shadow_kernel(True, False), bounced).module,
        "two_level_bvh: bodies": poses.__name__,
        "two_level_bvh: primary and shadow": shadow.make_together_kernel(True, False, 2).module,
        "two_level_bvh: mirrored": closest.make_listed_kernel(True, 2).module,
        "perspective_spherical: trace": make_trace_kernel(0, 64).module,
        "perspective_spherical: shadow": make_chunk_kernel(0, 64).module,
    }


def uses_of(module: wp.Module | str) -> dict[str, Use]:
    """What each kernel of a module takes, by the kernel's name."""
    return uses_in(binary_of(module))


def binary_of(module: wp.Module | str) -> bytes:
    """A module compiled for the GPU, ahead of time and without one. Warp keeps it, by a hash of its source and options."""
    (path,) = wp.compile_aot_module(module, arch=ARCH, use_ptx=False)
    return path.read_bytes()


def uses_in(binary: bytes) -> dict[str, Use]:
    """The kernels of a GPU binary."""
    sections = list(sections_of(binary))
    symbols: list[str] = []
    for _, kind, offset, size, link in sections:
        if kind == SYMBOL_TABLE:
            names = sections[link][2]
            for at in range(offset, offset + size, SYMBOL_BYTES):
                symbols.append(text_at(binary, names + struct.unpack_from("<I", binary, at)[0]))
    values: dict[tuple[str, int], int] = {}
    for name, _, offset, size, _ in sections:
        if name.startswith(".nv.info"):
            for attribute, symbol, value in values_in(binary, offset, offset + size):
                values[symbols[symbol], attribute] = value
    result = {}
    for name, _, _, size, _ in sections:
        if name.startswith(".text."):
            symbol = name.removeprefix(".text.")
            use = Use(values[symbol, REGISTERS], values[symbol, STACK], size // INSTRUCTION_BYTES)
            # Of overloads, which share a name, the largest figures.
            other = astuple(result.get(plain_name(symbol), use))
            result[plain_name(symbol)] = Use(*map(max, astuple(use), other))
    return result


def sections_of(binary: bytes) -> Iterator[tuple[str, int, int, int, int]]:
    """(name, type, offset, size, link) of every section of a 64-bit ELF file."""
    if binary[:5] != b"\x7fELF\x02":
        raise ValueError("no 64-bit ELF file")
    (table,) = struct.unpack_from("<Q", binary, 0x28)
    entry, count, names = struct.unpack_from("<HHH", binary, 0x3A)
    rows = [struct.unpack_from("<IIQQQQIIQQ", binary, table + k * entry) for k in range(count)]
    for row in rows:
        yield text_at(binary, rows[names][4] + row[0]), row[1], row[4], row[5], row[6]


def values_in(binary: bytes, start: int, stop: int) -> Iterator[tuple[int, int, int]]:
    """(attribute, symbol, value) of the registers and stacks in an info section."""
    at = start
    while at < stop:
        form, attribute, size = struct.unpack_from("<BBH", binary, at)
        at += 4
        if form == VALUES:
            if attribute in (REGISTERS, STACK) and size == 8:
                yield (attribute, *struct.unpack_from("<II", binary, at))
            at += size


def text_at(binary: bytes, at: int) -> str:
    return binary[at : binary.index(b"\0", at)].decode()


def plain_name(symbol: str) -> str:
    """A kernel's own name: without the factory that made it, Warp's hash and its ending."""
    return re.sub(r"(_[0-9a-f]{8})?_cuda_kernel_forward$", "", symbol).rsplit("__locals__", 1)[-1]


def report(labels: tuple[str, ...] = ("",)) -> dict[tuple[str, str], Use]:
    """Every hot kernel of the modules whose labels begin so, by package and name."""
    return {
        (label, name): use
        for label, module in hot_modules().items()
        if label.startswith(labels)
        for name, use in sorted(uses_of(module).items())
    }


def recorded() -> dict[tuple[str, str], Use]:
    """What was recorded last."""
    with RECORD.open(newline="") as file:
        return {
            (row["module"], row["kernel"]): Use(*(int(row[f.name]) for f in fields(Use)))
            for row in csv.DictReader(file)
        }


def record(found: dict[tuple[str, str], Use]) -> None:
    with RECORD.open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["module", "kernel", *(f.name for f in fields(Use))])
        writer.writerows([*key, *astuple(use)] for key, use in found.items())


def kept(
    before: dict[tuple[str, str], Use], found: dict[tuple[str, str], Use], labels: set[str]
) -> dict[tuple[str, str], Use]:
    """What is recorded now: what was found, and before it what was not asked for, of labels that there still are."""
    asked = {label for label, _ in found}
    return {key: use for key, use in before.items() if key[0] in labels - asked} | found


def main(arguments: list[str]) -> None:
    found = report(tuple(text for text in arguments if text != "--record") or ("",))
    before = recorded() if RECORD.exists() else {}
    print(f"{'':52} {'registers':>16} {'stack bytes':>16} {'instructions':>16}   (recorded)")
    for key, use in found.items():
        old = before.get(key)
        cells = [
            f"{value:>7} {'(' + str(astuple(old)[k]) + ')' if old else '':>8}" for k, value in enumerate(astuple(use))
        ]
        print(f"{': '.join(key):52} {' '.join(cells)}")
    if "--record" in arguments:
        record(kept(before, found, set(hot_modules())))
        print(f"recorded in {RECORD}")


if __name__ == "__main__":
    main(sys.argv[1:])
