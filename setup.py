"""The packages of the distribution: every package of the three folders, under the name that it is imported by."""

from setuptools import find_packages, setup

FOLDERS = ("harness", "methods", "experiments")  # mapped in pyproject.toml, [tool.setuptools.package-dir]

found = find_packages(
    include=[f"{folder}{end}" for folder in FOLDERS for end in ("", ".*")], exclude=["harness.shadowbench"]
)
setup(packages=["shadowbench", *(f"shadowbench.{package}" for package in found)])
