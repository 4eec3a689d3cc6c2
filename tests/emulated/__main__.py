"""``python tests/emulated [--replace OLD NEW]... COMMAND ...`` or ``... PROGRAM.py ...``: see the package."""

import os
import runpy
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

USAGE = "usage: python tests/emulated [--replace OLD NEW]... COMMAND ... | PROGRAM.py ..."

del sys.argv[0]
replaced = []
while sys.argv[:1] == ["--replace"] and len(sys.argv) > 2:
    replaced.append((sys.argv[1], sys.argv[2]))
    del sys.argv[:3]
if not sys.argv or sys.argv[0] == "--replace":
    sys.exit(USAGE)
if sys.argv[0].endswith(".py") and not Path(sys.argv[0]).is_file():
    sys.exit(f"no program {sys.argv[0]!r}")
seed = os.environ.get("EMULATED_SEED") or "0"
if not (seed.isascii() and seed.isdigit()):
    sys.exit(f"EMULATED_SEED is a number from 0 on, not {seed!r}")

from emulated.device import install  # noqa: E402  (a wrong call is told at once: this takes a second)

unseen = install(replaced)
try:
    if sys.argv[0].endswith(".py"):
        runpy.run_path(sys.argv[0], run_name="__main__")
    else:
        from shadowbench.harness.cli import main

        sys.argv.insert(0, "shadowbench")
        main()
finally:
    for old in unseen:
        print(f"emulated: no snippet holds {old!r}", file=sys.stderr)
