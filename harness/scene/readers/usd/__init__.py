"""USD through the package usd-core: all that the stage draws, in the order of the stage, over its time.

prims       which prims have a place; transforms and visibility
shapes      triangles of meshes, of spheres, cubes ..., and of what a skeleton bends
drawing     what is drawn where, and what instancers draw many times
views       its cameras and lights
read        opens it, puts all of this together, and says what is missing, approximated or left out
"""

from pathlib import Path

from ....errors import UserError, install
from ..checks import ALL, Loaded, Wanted, read_bytes


def missing() -> str:
    """What to do where usd-core is not installed."""
    return f"reading USD needs the package usd-core; {install('usd-core')}"


def available() -> bool:
    """Whether usd-core is installed."""
    try:
        import pxr.Usd  # noqa: F401
    except ImportError:
        return False
    return True


def read_usd(path: Path, wanted: Wanted = ALL) -> Loaded:
    """Everything that the stage draws, in its space: positions float64, float32 where nothing is moved. ``up`` is the
    stage's up axis; lengths are in its unit. Raises :class:`UserError` if usd-core is missing, the stage or a file that
    it refers to cannot be opened, its arrays contradict each other, or it exceeds a limit.
    """
    if not available():
        raise UserError(f"{path}: {missing()}")
    from . import read

    read_bytes(path, 1024)  # missing and unreadable files get the same message as in every other format
    return read.read(path, wanted)
