"""What one test process makes and the others read, in a folder of the whole session of tests."""

import fcntl
import os
import pickle
from collections.abc import Callable
from hashlib import sha256
from pathlib import Path
from typing import TypeVar

PLACE = "SHADOWBENCH_TEST_SESSION"
"""The environment variable that names the folder: ``conftest.py`` makes it, before other processes start."""

Made = TypeVar("Made")


def session_folder() -> Path:
    return Path(os.environ[PLACE])


def kept(name: str, make: Callable[[], Made]) -> Made:
    """What ``make`` returns in the process that asks first; the others wait for it, and have a copy. Outside of a session
    of tests it is made anew.
    """
    if PLACE not in os.environ:
        return make()
    path = session_folder() / sha256(name.encode()).hexdigest()
    with path.with_suffix(".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if path.exists():
            return pickle.loads(path.read_bytes())
        made = make()
        path.write_bytes(pickle.dumps(made))
        return made
