"""Tests of the CPU, run on the side of the GPU: ``python tests/emulated tests/emulated/run_tests.py PYTEST'S ARGUMENTS``."""

import sys

import pytest

sys.exit(pytest.main(["-q", "-p", "no:cacheprovider", *sys.argv[1:]]))
