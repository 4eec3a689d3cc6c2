"""Hard cases: small named scenes on which ray tracers are known to give wrong answers. A :class:`.case.HardCase`
constructs the scene. The exact referee computes the expected answer; cases whose answer can be derived by hand also
state it. ``shadowbench check METHOD`` runs all cases.
"""

import importlib
import pkgutil

from ..errors import UserError, did_you_mean
from .case import CASES, Counts, HardCase, Trial

__all__ = ["Counts", "HardCase", "Trial", "all_cases", "find_case"]

for _module in pkgutil.iter_modules(__path__):
    importlib.import_module(f"{__name__}.{_module.name}")


def all_cases(large: bool = False) -> tuple[HardCase, ...]:
    """Areas (A), holes (H), mirrors (M), orthographic cameras (O), shadows (S), eyes and meshes (P), then the variants
    of scale, offset and distance (V). Those that take long (:attr:`.case.HardCase.large`) only with ``large``.
    """
    single = [case for module, cases in CASES.items() if module != "variants" for case in cases]
    ordered = sorted(single, key=lambda case: (case.name[0] == "P", case.name))
    return tuple(case for case in (*ordered, *CASES["variants"]) if large or not case.large)


def find_case(name: str) -> HardCase:
    known = {case.name: case for case in all_cases(large=True)}
    if name not in known:
        raise UserError(f"no hard case {name!r}{did_you_mean(name, known)}")
    return known[name]
