"""Trees with other constants than those that were measured to be fast, of which none changes an answer; and their nodes."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from shadowbench.harness.frame.registry import make_method
from shadowbench.harness.frame.session import Session
from shadowbench.harness.scene.prepared import Prepared
from shadowbench.methods.trees import constants, quality
from shadowbench.methods.trees.nodes import NODE_BYTES


@contextmanager
def tuned(settings: Mapping[str, Any]) -> Iterator[dict[str, str]]:
    """A method's settings without those in capitals, which are the constants of :mod:`shadowbench.methods.trees.constants`
    meanwhile. ROOM: of the pairs left to float64, at first.
    """
    with pytest.MonkeyPatch.context() as patch:
        for name, value in settings.items():
            if name == "ROOM":
                patch.setattr(constants, "first_capacity", lambda pixels, value=value: value)
            elif name.isupper():
                patch.setattr(constants, name, value)
        yield {name: value for name, value in settings.items() if not name.isupper()}


def built(prepared: Prepared, settings: dict[str, Any], device: str = "cpu") -> Session:
    with tuned(settings) as given:
        session = Session(make_method("bvh2", given), prepared, 8, 8, device)
        session.answers(prepared.moment(0, 8, 8))
    return session


def children(session: Session) -> tuple[NDArray, NDArray, NDArray, int]:
    """(centres, extents, references) of both children, [nodes, 2, ...], and the root's reference."""
    tree = session.method._rays.tree
    nodes = tree.nodes.numpy().reshape(-1, NODE_BYTES // 4)
    return *quality.children(nodes), int(tree.root.numpy().view(np.uint32)[0])
