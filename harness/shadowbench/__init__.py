"""The package ``shadowbench`` itself: its version, and ``python -m shadowbench``.

The packages in it (``harness``, ``methods``, ``experiments``) lie in folders of their own; see ``pyproject.toml``.
"""

from shadowbench.harness import version

__version__ = version.VERSION
