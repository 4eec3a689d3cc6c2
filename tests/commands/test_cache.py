"""The compiled kernels on the disk: shown and cleared, and nothing else with them."""

import json
import os
import subprocess
import sys

import pytest
import warp as wp
from shadowbench.harness.commands.cache import cache
from shadowbench.harness.errors import UserError
from shadowbench.harness.frame.devices import CACHE


@pytest.fixture
def kernels(tmp_path, monkeypatch):
    """A folder as Warp leaves it: two versions, and what is not of it."""
    place = tmp_path / "warp" / "1.19.0"
    for folder in (
        place / "wp_a_1234",
        place / "lto",
        place.parent / "1.18.0" / "wp_b",
        place / "mine",
        tmp_path / "wp_c",
    ):
        folder.mkdir(parents=True)
        (folder / "kernel.o").write_bytes(bytes(1000))
    (place / "wp_link").symlink_to(tmp_path / "wp_c")
    (place / "wp_file").write_text("")
    monkeypatch.setattr(wp.config, "kernel_cache_dir", str(place))
    return place


def test_it_shows_and_clears_compiled_modules_alone(kernels, capsys):
    assert cache("show", as_json=True) == 0
    shown = json.loads(capsys.readouterr().out)
    assert shown == {"folder": str(kernels), "modules": 3, "bytes": 3000, "cleared": False}
    assert cache("clear") == 0
    assert f"3 compiled modules, 0 MB, removed from {kernels}" in capsys.readouterr().out
    assert sorted(path.name for path in kernels.iterdir()) == ["mine", "wp_file", "wp_link"]
    assert list((kernels.parent / "1.18.0").iterdir()) == []
    assert (kernels.parents[1] / "wp_c" / "kernel.o").is_file()
    cache("show")
    assert capsys.readouterr().out.startswith("0 compiled modules")


def test_a_folder_that_was_chosen_is_not_left(kernels, monkeypatch, capsys):
    """Its neighbours are not Warp's."""
    chosen = kernels.parents[1] / "chosen"
    (chosen / "wp_d").mkdir(parents=True)
    (chosen.parent / "1.0.0" / "wp_e").mkdir(parents=True)
    monkeypatch.setattr(wp.config, "kernel_cache_dir", str(chosen))
    cache("clear")
    assert capsys.readouterr().out.startswith("1 compiled modules")
    assert (chosen.parent / "1.0.0" / "wp_e").is_dir()


def test_another_action_is_refused():
    with pytest.raises(UserError, match="give show or clear"):
        cache("empty")


def test_a_home_that_cannot_be_written_is_one_line():
    """Below /proc nobody makes a folder, root included."""
    environment = {name: value for name, value in os.environ.items() if name not in ("XDG_CACHE_HOME", CACHE)}
    ended = subprocess.run(
        [sys.executable, "-m", "shadowbench", "plan", "balls-1k", "--method", "embree"],
        env={**environment, "HOME": "/proc"}, capture_output=True, text=True,
    )  # fmt: skip
    assert ended.returncode == 2
    assert ended.stderr.count("\n") == 1
    assert f"set {CACHE} to a folder that can be written" in ended.stderr
