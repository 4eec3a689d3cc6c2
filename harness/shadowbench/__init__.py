"""The package ``shadowbench`` itself: its version, and ``python -m shadowbench``.

The packages in it (``harness``, ``methods``, ``experiments``) lie in folders of their own; see ``pyproject.toml``.
"""

from shadowbench.harness.version import VERSION as __version__

__all__ = ["__version__"]
