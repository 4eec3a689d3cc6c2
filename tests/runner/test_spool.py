"""The folder of shards: only what lies in this user's own folder, closed to others, is written to or removed."""

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
    """A folder that a person gave, in which a folder of data lies already, of a name that a shard could have."""
    (tmp_path / "place" / NAME).mkdir(parents=True)
    os.utime(tmp_path / "place" / NAME, (0, 0))
    monkeypatch.setenv(spool.PLACE, str(tmp_path / "place"))
    return tmp_path / "place"


def shard(name: str) -> Path:
    folder = spool.shard_folder(name)
    (folder / "records").mkdir()
    return folder


def test_only_old_shards_are_removed(place: Path) -> None:
    old, young = shard(NAME), shard(NAME[::-1])
    when = old.stat().st_mtime - OLD_S
    os.utime(old, (when, when))
    assert spool.held() == [young.name]
    assert not old.exists()
    assert (place / NAME).exists()


@pytest.mark.parametrize("name", ["", ".", "..", "data set", "../place", f"../{NAME}", f"{NAME}/records"])
def test_a_name_that_is_no_shard_s_is_not_forgotten(place: Path, name: str) -> None:
    there = shard(NAME)
    spool.forget(name)
    assert (there / "records").is_dir()
    assert (place / NAME).is_dir()
    spool.forget(NAME)
    assert not there.exists()


@pytest.mark.parametrize("kind", ["open to others", "a link", "of another user"])
def test_a_folder_of_another_in_the_place_of_ours_is_one_line(place: Path, kind: str) -> None:
    folder = spool.root()
    if kind == "open to others":
        folder.chmod(0o755)
    elif kind == "a link":
        folder.rename(place.parent / "elsewhere")
        folder.symlink_to(place.parent / "elsewhere")
    elif os.getuid() != 0:
        pytest.skip("only root can give a folder to another user")
    else:
        os.chown(folder, 12345, 12345)
    with pytest.raises(UserError, match="no folder shadowbench-shards that is closed to others"):
        spool.shard_folder(NAME)


def test_without_the_variable_the_folder_lies_among_temporary_files(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv(spool.PLACE, raising=False)
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    folder = shard(NAME)
    assert folder.parent == tmp_path / f"{spool.PREFIX}-{os.getuid()}"
    assert folder.parent.lstat().st_mode & 0o777 == 0o700
    assert spool.shard_folder(NAME) == folder, "the next run finds it"
    assert spool.held() == [NAME]
