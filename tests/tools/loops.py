"""The loops of a compiled kernel, read from its PTX: no GPU needed.

A traversal whose steps and tests are one loop keeps the lanes of a warp together. Where the compiler makes a loop of the
steps inside one of the tests, the lanes test one by one, and a frame takes up to three times as long
(results/notebook.md, "Trees of Warp").
"""

import re

import networkx as nx
import warp as wp

ARCH = 90
LABEL = re.compile(r"(\$\w+):")
BRANCH = re.compile(r"(@!?%p\d+\s+)?bra(?:\.uni)?\s+(\$\w+)")
LEAVE = re.compile(r"ret|exit|trap")
KERNEL = re.compile(r"\.entry (\w+)_cuda_kernel_forward\(.*?\n(\{.*?\n\})", re.DOTALL)


def loop_counts(module: wp.Module | str) -> dict[str, int]:
    """How many natural loops each kernel of a module has, by its name with Warp's hash."""
    (path,) = wp.compile_aot_module(module, arch=ARCH, use_ptx=True)
    return {name: len(loop_heads(body)) for name, body in KERNEL.findall(path.read_text())}


def loop_heads(body: str) -> set[int]:
    """The blocks to which an edge leads from a block that they dominate."""
    graph = nx.DiGraph(dict(enumerate(successors(body))))
    above = nx.immediate_dominators(graph, 0)

    def dominators(block: int) -> set[int]:
        return {block, *(dominators(above[block]) if block else ())}

    return {to for block, to in graph.edges if block in above and to in dominators(block)}


def successors(body: str) -> list[list[int]]:
    """The blocks that may follow each block of a kernel, numbered in the order of the text."""
    blocks: list[list[str]] = [[]]
    names: dict[str, int] = {}
    for line in body.splitlines():
        text = line.strip()
        label = LABEL.match(text)
        if label:
            blocks.append([])
            names[label.group(1)] = len(blocks) - 1
            continue
        blocks[-1].append(text)
        if BRANCH.match(text) or LEAVE.match(text):
            blocks.append([])
    result = []
    for i, block in enumerate(blocks):
        last = block[-1] if block else ""
        branch = BRANCH.match(last)
        to = [names[branch.group(2)]] if branch else []
        goes_on = not LEAVE.match(last) and (branch is None or branch.group(1) is not None)
        result.append(to + ([i + 1] if goes_on and i + 1 < len(blocks) else []))
    return result
