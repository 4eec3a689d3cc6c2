"""The folder of shards: only what this program made for this user is written to or removed."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

import pytest
from shadowbench.harness.errors import UserError
from shadowbench.harness.runner.cluster import spool

NAME = "0123456789abcdef"
OLD_S = 30 * 24 * 3600.0


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder that a person gave, in which a folder of data lies already."""
    (tmp_path / "place" / "data set").mkdir(parents=True)
    monkeypatch.setenv(spool.PLACE, str(tmp_path / "place"))
    return tmp_path / "place"


def aged(folder: Path) -> Path:
    """The folder, as if nothing had changed in it for a month."""
    when = folder.lstat().st_mtime - OLD_S
    os.utime(folder, (when, when), follow_symlinks=False)
    return folder


def shard(name: str) -> Path:
    folder = spool.shard_folder(name)
    (folder / "records").mkdir()
    return folder


def strangers(place: Path) -> list[Path]:
    """Folders that look like old shards, each of which lacks one property."""
    unnamed = shard(NAME[:-1] + "0").rename(place / "my results")
    open_to_others = shard(NAME[:-1] + "1")
    open_to_others.chmod(0o755)
    linked = place / (NAME[:-1] + "2")
    linked.symlink_to(shard(NAME[:-1] + "9").rename(place.parent / "elsewhere"))
    unmarked = shard(NAME[:-1] + "3")
    (unmarked / spool.MARKER).unlink()
    marker_linked = shard(NAME[:-1] + "4")
    (marker_linked / spool.MARKER).rename(place.parent / "marker")
    (marker_linked / spool.MARKER).symlink_to(place.parent / "marker")
    found = [place / "data set", unnamed, open_to_others, linked, unmarked, marker_linked]
    if os.getuid() == 0:
        of_another = shard(NAME[:-1] + "5")
        os.chown(of_another, 12345, 12345)
        found.append(of_another)
    return [aged(folder) for folder in found]


def test_only_old_shards_of_our_own_are_removed(place: Path) -> None:
    others, old, young = strangers(place), shard(NAME), shard(NAME[::-1])
    aged(old)
    assert spool.held() == [young.name]
    for folder in others:
        spool.forget(folder.name)
    assert all(folder.exists() for folder in others)
    assert not old.exists()
    assert young.exists()


@pytest.mark.parametrize("name", ["", ".", "..", "data set", "../place", f"../place/{NAME}", f"{NAME}/records"])
def test_a_name_that_is_no_shard_s_is_not_forgotten(place: Path, name: str) -> None:
    there = shard(NAME)
    spool.forget(name)
    assert (there / "records").is_dir()
    assert (place / "data set").is_dir()
    spool.forget(NAME)
    assert not there.exists()


def test_a_folder_of_another_in_the_place_of_a_shard_is_one_line(place: Path) -> None:
    for folder in (one for one in strangers(place) if one.name != "my results"):
        with pytest.raises(UserError, match="it is not a folder of shadowbench") as caught:
            spool.shard_folder(folder.name)
        assert "\n" not in str(caught.value)
    (place / NAME).mkdir(mode=0o700)  # as a kill between the folder and its marker leaves it
    assert spool.is_own(spool.shard_folder(NAME))


def test_without_the_variable_the_folder_has_a_name_that_nobody_knows_before(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv(spool.PLACE, raising=False)
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    target = tmp_path / "target"
    target.mkdir()
    for planted in (f"{spool.PREFIX}{os.getuid()}", f"{spool.PREFIX}aaaaaaaa"):
        (tmp_path / planted).symlink_to(target)
    folder = shard(NAME)
    assert folder.parent.parent == tmp_path
    assert not folder.parent.is_symlink()
    assert folder.parent.lstat().st_mode & 0o777 == 0o700
    assert not any(target.iterdir())
    assert spool.shard_folder(NAME) == folder, "the next run finds it"
    assert spool.held() == [NAME]
    # Of a worker that began at the same time:
    second = spool.made(Path(tempfile.mkdtemp(prefix=spool.PREFIX)))
    spool.made(second / NAME[::-1])
    assert sorted(spool.held()) == sorted([NAME, NAME[::-1]])
    assert spool.shard_folder(NAME[::-1]).parent == second
    for name in (NAME, NAME[::-1]):
        spool.forget(name)
    assert spool.held() == []
