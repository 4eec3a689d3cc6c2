"""The command line called in the test's own process, which is faster than one process for each command."""

import sys

import pytest
from shadowbench.harness import cli


def exit_code(monkeypatch, *words) -> int:
    """The exit code of ``shadowbench WORDS``."""
    monkeypatch.setattr(sys, "argv", ["shadowbench", *map(str, words)])
    monkeypatch.delenv(cli.DEBUG, raising=False)
    with pytest.raises(SystemExit) as stopped:
        cli.main()
    return stopped.value.code or 0
