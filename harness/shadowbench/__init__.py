"""The package ``shadowbench`` itself: its version, and ``python -m shadowbench``. The packages in it (``harness``,
``methods``, ``experiments``) lie in folders of their own; see ``pyproject.toml``, which reads the version from here.
"""

__version__ = "0.2.0"
