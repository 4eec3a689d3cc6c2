"""A folder of results: its files, the lock of the run that writes to it, and errors of writing."""

import contextlib
import errno
import fcntl
import functools
import glob
import json
import os
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Annotated, Any, TypedDict

from ..errors import UserError, warn
from ..files import PARTIAL, open_regular, read_regular, write_atomic
from ..texts import all_visible
from ..typed_json import WrongFieldError, checked
from .journal import EVENTS, Journal
from .record import Record
from .schema import archived, whole_record

FULL = (errno.ENOSPC, errno.EDQUOT, errno.EROFS)  # errors that are due to the results folder wherever they occur

PARTS = ("answers", "environments", "images", "journal", "logs", "maps", "records", "truth")
"""The folders in a results folder."""

UNWRITABLE = (*FULL, errno.EACCES, errno.EPERM, errno.EIO, errno.ENOTDIR, errno.EISDIR)


def require_plain(folder: Path) -> None:
    """Raise :class:`UserError` where a results folder has a link, a pipe or a device in the place of a file. It may
    come from elsewhere: a table drawn through a link would replace a file of another folder, and packing would publish
    one. Folders may be links, such as those to a larger disk.
    """
    for place in (folder, *(folder / name for name in PARTS)):
        with contextlib.suppress(OSError), os.scandir(place) as entries:  # who reads or writes there says what is wrong
            odd = [one.path for one in entries if not (one.is_file(follow_symlinks=False) or one.is_dir())]
            if odd:
                way_out = "put a file in its place, or remove it"
                if not (folder / "records").exists():
                    way_out = f"{folder} has no records of its own, name another folder"
                raise UserError(f"{min(odd)}: a link, or no file at all; {way_out}")


class ResultsFolder:
    """``records/KEY.json``, ``journal/KEY.jsonl``, ``environments/ID.json``, ``scenes.json`` and so on in ``path``."""

    def __init__(self, path: Path):
        self.path = path

    @contextmanager
    def locked(self) -> Iterator[None]:
        """Make the folder and lock it for this process. Raises :class:`UserError` if that is not possible."""
        taken = [self.path / name for name in PARTS if (self.path / name).is_file()]
        if taken:
            raise UserError(f"{taken[0]}: a file where a folder is needed; move it, or choose another --out")
        try:
            self.path.mkdir(parents=True, exist_ok=True)
            require_plain(self.path)
            (self.path / ".lock").touch()
            file = open_regular(self.path / ".lock", update=True)
        except OSError as error:
            raise UserError(f"{self.path}: cannot write there ({error.strerror}); choose another --out") from error
        with file:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError as error:
                raise UserError(f"{self.path}: another run is writing there; wait or choose another --out") from error
            self.remove_partial()
            yield
            self.remove_partial()  # of a worker that was killed, while the run went on

    def remove_partial(self) -> None:
        """Remove files that a process was writing when it was killed. Only while no other run writes there."""
        for place in (self.path, *(self.path / name for name in PARTS)):
            for path in place.glob(".*"):
                if PARTIAL.fullmatch(path.name) and path.is_file() and not path.is_symlink():
                    path.unlink(missing_ok=True)

    @contextmanager
    def idle(self) -> Iterator[None]:
        """Lock an existing folder, so that no run writes to it. Raises :class:`UserError` if one does, and as
        :func:`require_plain` does. A folder without a lock file is not locked, and no lock file is created, because the
        folder may be read-only.
        """
        require_plain(self.path)
        with ExitStack() as held:
            try:
                file = held.enter_context(open_regular(self.path / ".lock"))
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except FileNotFoundError:
                pass
            except BlockingIOError as error:
                raise UserError(f"{self.path}: a run is writing there; wait for its end") from error
            yield

    @contextmanager
    def writing(self) -> Iterator[None]:
        """Turn a failure to write into one line: which results remain, and what to do."""
        try:
            yield
        except OSError as error:
            if error.errno in UNWRITABLE:
                where = f"{error.filename}: " if error.filename else ""
                raise self.unwritable(f"{where}{error.strerror or error}") from error
            raise

    def unwritable(self, reason: str) -> UserError:
        """The error to raise where nothing can be written."""
        return UserError(
            f"{self.path}: cannot write ({reason}); finished measurements are kept: free space or correct the permissions, "
            f"then run the same command again to continue"
        )

    def shared_scene(self, frames: int = 1) -> Path:
        """Where the scene under way is handed from one worker to the others; ``frames``: see :class:`.Lighting`."""
        return self.path / "journal" / f"scene-{frames}.npz"

    def log(self, worker: str) -> Path:
        """The output of a worker, and of the method in it, on standard error."""
        return self.path / "logs" / f"{worker}.log"

    def journal(self, key: str) -> Journal:
        with self.writing():
            return Journal(self.path / "journal" / f"{key}.jsonl", EVENTS)

    def record(self, key: str) -> Record | None:
        """The finished record of a point; None if there is none, or if the file is not a whole record."""
        found = whole_record(self.path / "records" / f"{key}.json") or self._archived.get(key)
        return found if found is not None and found.key == key else None

    @functools.cached_property
    def _archived(self) -> dict[str, Record]:
        return {record.key: record for record in archived(self.path / "records", set())}

    def keep_record(self, record: Record, journal: Journal) -> None:
        """Write a record, then delete its journal and the answers that were handed over for scoring."""
        with self.writing():
            write_atomic(self.path / "records" / f"{record.key}.json", record.to_json())
            for path in (self.path / "journal").glob(f"{glob.escape(record.key)}-*.npz"):
                path.unlink()
            journal.remove()


def image_name(scene: str, light: str, width: int, height: int) -> str:
    """The file of the picture of a scene in ``images``. ``light``: the label of its lighting; "" for its own lights."""
    return "-".join(filter(None, (scene, light, f"{width}x{height}"))) + ".png"


MOST_FACTS = 16 << 20  # longest file of facts about an environment or scenes, bytes


def read_json(path: Path) -> dict[str, Any] | None:
    """The object in a JSON file, with texts that can be shown; None where there is no such file, or it holds none."""
    try:
        found = all_visible(json.loads(read_regular(path, MOST_FACTS)))
    except (OSError, ValueError, RecursionError):
        return None
    return found if isinstance(found, dict) else None


class Cpu(TypedDict, total=False):
    """The processor of an environment. ``usable_cores``: those that a run may use."""

    model: str
    usable_cores: Annotated[int, 1] | None


class Gpu(TypedDict, total=False):
    """A GPU of an environment. ``smi``: what its driver says, as texts."""

    name: str
    smi: dict[str, str] | None


class EnvironmentFacts(TypedDict, total=False):
    """The machine, its software and the commit that a run had, as far as tables and comparisons need them."""

    cpu: Cpu | None
    gpus: list[Gpu] | None
    cuda: dict[str, str | None] | None


def read_environment(folder: Path, name: str) -> dict[str, Any] | None:
    """The facts of an environment of a results folder; None where they are not known, with a warning if they are damaged."""
    path = folder / "environments" / f"{name}.json"
    if not os.path.lexists(path):
        return None
    try:
        return checked(EnvironmentFacts, read_json(path))
    except (WrongFieldError, RecursionError) as error:
        warn(f"{path}: not the facts of an environment ({error}), left out")
        return None
