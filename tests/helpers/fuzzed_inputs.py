"""Inputs that anyone may have made, and what must come of each: an answer or one line, in time, within the memory.

A family makes a case from a seeded generator and tries it. It returns what came of it, or raises whatever the program
should not have let through. Inputs on the disk lie in the folder of the case, so that one that fails can be kept.
"""

import contextlib
import io
import json
import lzma
import os
import signal
import tarfile
import types
import warnings
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path
from random import Random

import numpy as np
from shadowbench.harness.commands import listing
from shadowbench.harness.commands.compare import compare
from shadowbench.harness.commands.keep import keep
from shadowbench.harness.commands.report import report
from shadowbench.harness.commands.show import show
from shadowbench.harness.commands.viewer.frames import Wish
from shadowbench.harness.errors import UserError
from shadowbench.harness.frame import registry
from shadowbench.harness.report import document
from shadowbench.harness.report.page import gather
from shadowbench.harness.results.folder import ResultsFolder, read_environment, read_json
from shadowbench.harness.results.journal import Journal
from shadowbench.harness.results.record import make_record
from shadowbench.harness.results.schema import ARCHIVE, read_records
from shadowbench.harness.results.table import samples
from shadowbench.harness.runner.planning.experiment import Entry
from shadowbench.harness.scene.catalogue import resolve
from shadowbench.harness.scene.chosen_view import ChosenView
from shadowbench.harness.scene.download import unpack
from shadowbench.harness.scene.prepared import prepare
from shadowbench.harness.typed_json import checked

from . import mesh_files
from .experiment_records import record_of, write_records
from .fuzzed_bytes import VALUES, changed, damaged
from .mesh_files import zipped
from .reader_seeds import seeds

READ, REFUSED, STOPPED = "read", "refused", "reader stopped"
"""What may come of a case. A reader that its limits or a signal have stopped is a fault of its own, not of the program."""

LONGEST_LINE = 1500
"""Characters of an error: it may name a few paths."""


def refusal(error: UserError) -> str:
    """What kind of refusal an error is; it must be one line."""
    line = str(error)
    assert "\n" not in line, line
    assert len(line) < LONGEST_LINE, line[:200]
    stopped = ("its reader ended", "its reader failed", "its reader sent", "to read; make it smaller")
    return STOPPED if any(words in line for words in stopped) else REFUSED


# --- files of scenes ------------------------------------------------------------------------------------------


DECLARATION = b"""mesh = "beside.obj"
title = "Room"
outputs = ["ids", "shadows"]
[camera]
eye = [0, 1.7, 4]
target = [0, 1, 0]
fov = 50
[[lights]]
position = [0, 2.4, 0]
spot = {direction = [0, -1, 0], angle = 40}
[orbit]
turns = 1
frames = 3
[alpha]
every = 4
holes = 4
[mirror]
share = 0.5
bounces = 1
"""


def scene_files(folder: Path | None = None) -> dict[str, list[bytes]]:
    """Whole files by their ending, and those of a folder."""
    made = {**seeds(), ".toml": [DECLARATION]}
    if folder is not None:
        found = (path for path in sorted(folder.rglob("*")) if path.suffix in made and path.is_file())
        for path in found:
            if path.stat().st_size < 200_000:
                made[path.suffix].append(path.read_bytes())
    return made


def nasty(rng: Random) -> tuple[str, bytes]:
    """A file that is no damaged one: built to take time, memory or the stack of its reader."""
    n = int(10 ** rng.uniform(1, 5))
    face = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
    glb = mesh_files.glb(
        change=lambda head: head["meshes"][0].update(primitives=head["meshes"][0]["primitives"] * (n // 10 + 1))
    )
    header = "ply\nformat ascii 1.0\n" + "comment x\n" * n + "element vertex 3\n"
    squeezed = zipped({"V.npy": bytes(n * 1000), "a.usda": b"#usda 1.0\n" + b" " * n * 1000})
    return rng.choice(
        [
            ("a.obj", (face + "# \\\n" * n).encode()), ("a.obj", (face + "f " + "1 " * n).encode()),
            ("a.obj", (face + "f 1 \\\n2 \\\n3\\\n" * n).encode()), ("a.obj", (face + "\\\n" * n).encode()),
            ("a.usda", ("#usda 1.0\n" + 'def "a" {\n' * n + "}\n" * n).encode()),
            ("a.usda", b'#usda 1.0\n(subLayers = [@./a.usda@])\ndef "a" (references = @./a.usda@</a>) {}\n'),
            ("a.usda", ('#usda 1.0\ndef Mesh "m" {\nint[] faceVertexCounts = [' + f"{n}," * 99 + "]\n}\n").encode()),
            ("a.glb", glb), ("a.gltf", b'{"asset": ' + b"[" * n + b"]" * n + b"}"), ("a.gltf", b"[" * n),
            ("a.ply", header.encode()), ("a.ply", f"{header}element face {n}0000\nend_header\n".encode()),
            ("a.stl", b"solid\n" + b"facet normal 0 0 0\n" * n), ("a.off", f"OFF\n{n}000 {n}000 0\n".encode()),
            ("a.npz", squeezed), ("a.usdz", squeezed), ("a.3mf", squeezed),
            ("a.toml", b"mesh = " + b"[" * n), ("a.toml", b'mesh = "a.toml"'),
        ]
    )  # fmt: skip


def try_scene(path: Path) -> str:
    """Read a file as every command does, and prepare its first frame."""
    try:
        scene = resolve(path)
        moment = prepare(scene).moment(0, 2, 2)
    except UserError as error:
        return refusal(error)
    assert np.isfinite(moment.eye).all()
    assert scene.title.isprintable()
    return READ


class Files:
    """Damaged files of scenes. ``seeds``: whole ones, by their ending."""

    def __init__(self, seeds: dict[str, list[bytes]]):
        self.seeds = seeds

    def __call__(self, rng: Random, folder: Path) -> str:
        if rng.random() < 0.01:
            name, content = nasty(rng)
        else:
            ending = rng.choice(list(self.seeds))
            others = self.seeds[ending]
            name, content = f"a{ending}", damaged(rng, rng.choice(others), others)
        (folder / "beside.obj").write_bytes(mesh_files.obj())
        (folder / name).write_bytes(content)
        return try_scene(folder / name)


# --- records --------------------------------------------------------------------------------------------------


def whole_records() -> list[dict]:
    """Records of two methods on two scenes, with rounds, samples and scores."""
    found = []
    for method in ("ray_grids", "bvh2"):
        for scene in ("cloth", "fairy"):
            record = record_of("table1", Entry(method, {"k": "2"}, method), scene, frames=2, counters={"tests": 5})
            clock = {"load": 1.0, "gpu": {"clocks.sm": "1980", "clocks_throttle_reasons.active": "0x0"}}
            record["rounds"] = [
                {"round": 0, "run": "r", "noted": 1.0, "environment": "e", "clock": clock, "started": 1.0}
            ]
            found.append(record)
    return found


ENVIRONMENT = {
    "id": "e", "cpu": {"model": "C", "cores": 2, "usable_cores": 2}, "memory_bytes": 1, "git": None,
    "gpus": [{"name": "G", "smi": {"driver_version": "1", "power.limit": "700"}}], "cuda": {"toolkit": "13", "driver": "13"},
}  # fmt: skip


def records(rng: Random, folder: Path) -> str:
    """Records with odd values, or whose bytes are damaged; one in twenty is drawn, packed, compared and reported."""
    made = whole_records()
    for number in range(len(made)):
        if number == 0 or rng.random() < 0.2:
            made[number] = changed(rng, made[number])
    texts = [json.dumps(one, ensure_ascii=rng.random() < 0.5).encode("utf-8", "surrogatepass") for one in made]
    if rng.random() < 0.2:
        texts[0] = damaged(rng, texts[0], texts)
    place = folder / "run"
    (place / "records").mkdir(parents=True)
    if rng.random() < 0.2:
        packed = lzma.compress(b"\n".join(texts) + b"\n", preset=0)
        packed = damaged(rng, packed, [packed]) if rng.random() < 0.5 else packed
        (place / "records" / ARCHIVE).write_bytes(packed)
    else:
        for number, text in enumerate(texts):
            (place / "records" / f"{number}.json").write_bytes(text)
    (place / "environments").mkdir()
    facts = changed(rng, ENVIRONMENT) if rng.random() < 0.5 else ENVIRONMENT
    (place / "environments" / "e.json").write_text(json.dumps(facts), encoding="utf-8", errors="surrogatepass")
    try:
        read_records(place)
        frames = document.frames(place)
        table = document.named(frames)
        assert len(samples(place)) == len(samples(place)["ms"])
        gather.gather("a", document.sources(place))
        document.not_measured(table)
        if rng.random() < 0.05:
            said = io.StringIO()
            with contextlib.redirect_stdout(said):
                show("table1", place)
                report(place, folder / "report.html")
                keep([place], folder / "kept")
                compare(place, folder / "kept", allow=["machine", "driver", "versions", "scene"])
            assert "\x1b[31m" not in said.getvalue()
            (place / "table1.md").read_text(encoding="utf-8")
    except UserError as error:
        return refusal(error)
    return READ


def facts_beside(rng: Random, folder: Path) -> str:
    """Environments, facts of scenes and journals of another program."""
    for name in ("environments", "journal"):
        (folder / name).mkdir()
    whole = json.dumps(changed(rng, ENVIRONMENT), ensure_ascii=False).encode("utf-8", "surrogatepass")
    content = damaged(rng, whole, [whole]) if rng.random() < 0.5 else whole
    (folder / "environments" / "e.json").write_bytes(content)
    (folder / "scenes.json").write_bytes(content)
    lines = b'{"event":"prepared","compile_s":1.0}\n{"event":"round","round":0,"frames":[]}\n'
    (folder / "journal" / "k.jsonl").write_bytes(damaged(rng, lines, [lines, content]))
    read_environment(folder, "e")
    read_json(folder / "scenes.json")
    journal = Journal(folder / "journal" / "k.jsonl")
    journal.append({"event": "round", "round": 7, "frames": []})
    assert Journal(journal.path).events[-1]["round"] == 7
    assert ResultsFolder(folder).record("k") is None
    return READ


# --- packages of methods, archives, messages of a page --------------------------------------------------------


CLASS = "class METHOD:\n    title = 'a'\n    devices = ('cpu',)\n    Build = Trace = dict\n    "
PACKAGES = [
    "raise RuntimeError('\\x1b[31m')", "raise SystemExit(3)", "import sys; sys.exit('no')", "raise ImportError", "1 / 0",
    "import none_of_that_name", "raise MemoryError", "METHOD = None", "METHOD = 3", "class METHOD: pass", CLASS + "pass",
    CLASS + "title = None", CLASS + "devices = None", CLASS + "devices = [None]", CLASS + "formerly = 7",
    CLASS + "title = '\\x1b[31m\\ud800'", CLASS + "Build = int", CLASS + "Build = None",
    CLASS + "def Build(): raise SystemExit", CLASS + "@property\n    def Build(self): raise KeyError",
    "def METHOD(): raise SystemExit", "import os; os.chdir('/')\nraise OSError('\\n\\n')", "raise RecursionError",
    "raise Exception(b'\\xff')",
]  # fmt: skip
"""Modules of a package of methods."""


def packages(rng: Random, folder: Path) -> str:
    """A package that fails on import, or whose class is none."""

    class Point:
        def __init__(self, text: str):
            self.value = "odd:METHOD"
            self.text = text

        def load(self) -> object:
            module = types.ModuleType("odd")
            exec(self.text, module.__dict__)
            return module.METHOD

    points = {f"odd{number}": Point(rng.choice(PACKAGES)) for number in range(3)}
    before = registry._entry_points
    registry._entry_points = lambda: points  # type: ignore[assignment]
    registry.current_name.cache_clear()
    here = os.getcwd()
    try:
        rows = listing.rows_of("methods", [], ChosenView, None, brief=False)
        with contextlib.redirect_stdout(io.StringIO()) as said:
            listing.show(rows)
        assert "\x1b" not in said.getvalue()
        json.dumps(rows, default=str)
        assert {row["name"] for row in rows} >= set(points)
        record = record_of("table1", Entry("nobody", {}, "x"))
        assert read_records(write_records(folder, [record]))[0].method["name"] == "nobody"
        for name in points:
            with contextlib.suppress(UserError):
                registry.method_class(name)
        assert os.getcwd() == here
    finally:
        registry._entry_points = before
        registry.current_name.cache_clear()
    return REFUSED


def archives(rng: Random, folder: Path) -> str:
    """Damaged archives, and whole ones with odd names."""
    odd = ("a/b.obj", "../b.obj", "/b.obj", "b.obj", "a\\..\\b.obj", "C:b.obj", "\x1b.obj", "a" * 300 + ".obj", ".", "")
    stream = io.BytesIO()
    if rng.random() < 0.5:
        with warnings.catch_warnings(), zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as packed:
            warnings.simplefilter("ignore")
            for name in rng.sample(odd, 3):
                packed.writestr(name or "x", mesh_files.obj())
    else:
        with tarfile.open(fileobj=stream, mode=rng.choice(("w", "w:gz", "w:xz", "w:bz2"))) as tape:
            for name in rng.sample(odd, 3):
                member = tarfile.TarInfo(name)
                member.type = rng.choice((tarfile.REGTYPE,) * 5 + (tarfile.SYMTYPE, tarfile.FIFOTYPE, tarfile.DIRTYPE))
                member.size = len(mesh_files.obj()) if member.type == tarfile.REGTYPE else 0
                tape.addfile(member, io.BytesIO(mesh_files.obj()) if member.size else None)
    whole = stream.getvalue()
    content = damaged(rng, whole, [whole]) if rng.random() < 0.7 else whole
    (folder / "a.archive").write_bytes(content)
    (folder / "out").mkdir()
    try:
        made = unpack(folder / "a.archive", "*.obj", folder / "out", 1 << 20)
    except UserError as error:
        return refusal(error)
    except OSError:  # a name that the disk refuses: the command names the folder
        return REFUSED
    assert all(path.parent == folder / "out" and path.is_file() for path in made)
    assert {path.name for path in folder.iterdir()} == {"a.archive", "out"}
    return READ


def messages(rng: Random, folder: Path) -> str:
    """What a page may send to the viewer."""
    places = {"camera": [[0, 0, 1], [0, 0, 0]], "light": [0, 0, 1]}
    wish = {"method": "embree", "frame": 0, "size": [8, 8], "show": "shaded", "judge": False, **places}
    text = json.dumps(changed(rng, wish) if rng.random() < 0.8 else rng.choice(VALUES))
    try:
        found = checked(Wish, json.loads(text))
    except (ValueError, TypeError, KeyError, OverflowError):
        return REFUSED
    assert np.isfinite([*(found.camera or ()), found.light or (0, 0, 0)]).all()
    return READ


def made_records(rng: Random, folder: Path) -> str:
    """A record without rounds, with odd values."""
    record = make_record(
        "k", {"experiment": "e", "width": 4, "height": 4}, {"name": "s"}, {"name": "m", "device": "cpu"}, "e"
    )
    text = json.dumps(changed(rng, record.to_json()))
    (folder / "records").mkdir()
    (folder / "records" / "k.json").write_text(text)
    try:
        read_records(folder)
    except UserError as error:
        return refusal(error)
    return READ


Family = Callable[[Random, Path], str]


def families(folder: Path | None = None) -> dict[str, tuple[Family, int]]:
    """Every family of cases by its name, and how many of a hundred cases are its own."""
    return {
        "files": (Files(scene_files(folder)), 72), "records": (records, 8), "facts": (facts_beside, 4),
        "made records": (made_records, 4), "packages": (packages, 2), "archives": (archives, 5),
        "messages": (messages, 5),
    }  # fmt: skip


@contextlib.contextmanager
def at_most(seconds: int) -> Iterator[None]:
    """Raise TimeoutError in the block if it takes longer."""

    def ring(*_: object) -> None:
        raise TimeoutError(f"more than {seconds} s")

    before = signal.signal(signal.SIGALRM, ring)
    signal.alarm(seconds)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)
