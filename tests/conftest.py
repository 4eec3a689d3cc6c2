"""What holds for every test: its runs wait for nobody else's on this machine, the other test process's among them."""

from __future__ import annotations

import os
import tempfile

from shadowbench.harness.runner.machine_lock import FOLDER

_turns = tempfile.TemporaryDirectory(prefix="shadowbench-turns-")
os.environ[FOLDER] = _turns.name
