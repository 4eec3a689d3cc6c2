"""Trees with other constants than those that were measured to be fast. None of them changes an exact answer."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import pytest
from shadowbench.methods.trees import constants


@contextmanager
def tuned(settings: Mapping[str, Any]) -> Iterator[dict[str, str]]:
    """A method's settings without those in capitals, which are the constants of :mod:`shadowbench.methods.trees.constants`
    meanwhile. ROOM: of the pairs left to float64, at first."""
    with pytest.MonkeyPatch.context() as patch:
        for name, value in settings.items():
            if name == "ROOM":
                patch.setattr(constants, "first_capacity", lambda pixels, value=value: value)
            elif name.isupper():
                patch.setattr(constants, name, value)
        yield {name: value for name, value in settings.items() if not name.isupper()}
