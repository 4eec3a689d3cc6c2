"""``python tests/emulated [--replace OLD NEW]... COMMAND ...`` or ``... PROGRAM.py ...``: see the package."""

import runpy
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from emulated.device import install

del sys.argv[0]
replaced = []
while sys.argv[:1] == ["--replace"]:
    replaced.append((sys.argv[1], sys.argv[2]))
    del sys.argv[:3]
if not sys.argv:
    sys.exit("usage: python tests/emulated [--replace OLD NEW]... COMMAND ... | PROGRAM.py ...")
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
