"""Scene files are read in a process of its own: the same arrays, and one line whatever the file does to its reader."""

import os
import socket
import subprocess
import sys
from multiprocessing import Pipe

import numpy as np
import psutil
import pytest
from helpers import mesh_files as files
from helpers.mesh_files import refused, written
from shadowbench.harness.errors import UserError
from shadowbench.harness.scene.catalogue import resolve
from shadowbench.harness.scene.readers import apart, helper, usd
from shadowbench.harness.scene.readers import load as here

needs_usd = pytest.mark.skipif(not usd.available(), reason="usd-core is not installed")


@pytest.fixture
def fresh(monkeypatch):
    """A helper of the test's own."""
    made = apart._Helper()
    monkeypatch.setattr(apart, "_HELPER", made)
    yield made
    made.stop()


@pytest.fixture
def small(tmp_path):
    return written(tmp_path, "a.obj", files.obj())


@pytest.mark.parametrize(("name", "content"), [
    ("a.ply", files.ply_binary()), ("a.obj", files.obj()), ("a.stl", files.stl_binary()), ("a.glb", files.glb()),
    pytest.param("a.usda", files.USDA.encode(), marks=needs_usd),
])  # fmt: skip
def test_the_same_arrives_as_is_read_here(tmp_path, name, content):
    path = written(tmp_path, name, content)
    one, other = apart.load(path), here.load(path)
    assert one.faces.dtype == other.faces.dtype
    assert (one.faces == other.faces).all()
    assert [(a.dtype, a.tolist()) for a in one.frames] == [(a.dtype, a.tolist()) for a in other.frames]
    assert (one.files, one.up, one.rate, one.notes) == (other.files, other.up, other.rate, other.notes)
    assert (one.cameras, one.lights) == (other.cameras, other.lights)


def test_a_sequence_and_a_path_in_another_folder(tmp_path, monkeypatch, fresh):
    for number in (1, 2):
        written(tmp_path, f"a_{number}.ply", files.ply_binary(files.QUAD + number))
    first = apart.load(tmp_path)
    monkeypatch.chdir(tmp_path)
    second = apart.load_sequence([here.Path("a_1.ply"), here.Path("a_2.ply")])
    assert [frame.tolist() for frame in first.frames] == [frame.tolist() for frame in second.frames]
    with pytest.raises(UserError, match=r"^none\.ply: no such file"):
        apart.load("none.ply")


def test_one_process_reads_all_and_ends_with_its_parent(small):
    program = (
        "from shadowbench.harness.scene.readers import apart\n"
        "for _ in range(3): apart.load('a.obj')\n"
        "import psutil; print(*(p.pid for p in psutil.Process().children()), flush=True)\n"
        "import os, signal; os.kill(os.getpid(), signal.SIGKILL)"
    )
    said = subprocess.run([sys.executable, "-c", program], cwd=small.parent, capture_output=True, text=True).stdout
    (child,) = map(int, said.split())
    _, alive = psutil.wait_procs([psutil.Process(child)] if psutil.pid_exists(child) else [], timeout=60)
    assert not alive


@needs_usd
def test_a_reader_that_crashes_is_one_line_and_the_next_file_is_read(small, fresh):
    """Prims nested so deep that USD's library overflows its stack."""
    deep = written(small.parent, "deep.usda", "#usda 1.0\n" + 'def "a" {\n' * 100_000 + "}\n" * 100_000)
    line = refused(deep, read=resolve)
    assert "its reader ended by SIG" in line or "not a readable USD file" in line
    assert len(apart.load(small).faces) == len(files.FACES)


def test_a_reader_that_is_killed_is_one_line(small, fresh, monkeypatch):
    apart.load(small)
    send = helper.send

    def killed(line, request):
        psutil.Process(fresh._process.pid).kill()
        send(line, request)

    monkeypatch.setattr(helper, "send", killed)
    refused(small, "its reader ended by SIGKILL", read=resolve)


def test_a_fault_of_a_reader_is_one_line(small, monkeypatch):
    monkeypatch.setitem(helper.TASKS, "load", lambda path: {}["a\nb"])
    fault = helper.answer({"task": "load", "arguments": [small]})
    assert fault == {"fault": r"KeyError: 'a\nb'"}
    monkeypatch.setattr(helper, "received", lambda *_: fault)
    refused(small, r"its reader failed (KeyError: 'a\nb'); this is a fault of the program", read=resolve)
    apart._HELPER.stop()


def test_a_reply_with_too_long_a_text_is_one_line_and_the_next_file_is_read(small, fresh, monkeypatch):
    with monkeypatch.context() as patch:
        patch.setattr(helper, "MOST_TEXT", 10)  # of this process alone
        refused(small, "its reader sent a wrong reply (a text of ", read=resolve)
    assert len(apart.load(small).faces) == len(files.FACES)


def test_a_lack_of_memory_here_is_not_the_readers(small, fresh, monkeypatch):
    def received(*_):
        raise MemoryError

    monkeypatch.setattr(helper, "received", received)
    with pytest.raises(MemoryError):
        apart.load(small)
    assert fresh._process is None, "its answer would be taken for the next one's"


@pytest.mark.parametrize(("variable", "limit", "patience", "line"), [
    (apart.MEMORY, "0.005", 100, f"needs more than 0.005 GiB of memory to read; make it smaller, or set {apart.MEMORY}"),
    (apart.TIME, "1", 100, f"takes more than 1 s to read; make it smaller, or set {apart.TIME}"),
    (apart.TIME, "9", 0, f"takes more than 0 s to read; make it smaller, or set {apart.TIME} to a higher limit"),
])  # fmt: skip
def test_memory_and_time_are_limited_and_the_line_names_the_way_out(
    small, fresh, monkeypatch, variable, limit, patience, line
):
    """A file that keeps its reader busy, of the processor and of the clock."""
    large = written(small.parent, "large.obj", b"v 0 0 0\n" + b"f 1 1 1\n" * 8_000_000)
    monkeypatch.setenv(variable, limit)
    monkeypatch.setattr(apart, "PATIENCE", patience)
    refused(large, line, read=resolve)
    monkeypatch.undo()
    monkeypatch.setattr(apart, "_HELPER", fresh)
    assert len(apart.load(small).faces) == len(files.FACES)


def test_limits_grow_with_the_files_up_to_a_maximum(tmp_path, monkeypatch):
    small, large = tmp_path / "small.usda", tmp_path / "large.ply"
    small.write_bytes(b"x")
    assert apart.limits([small]) == (apart.LEAST_MEMORY, apart.LEAST_SECONDS)
    with large.open("wb") as stream:
        stream.truncate(100_000_000)
    assert apart.limits([large]) == (apart.MEMORY_SHARE * 100_000_000, apart.LEAST_SECONDS + 200)
    beside = (apart.MEMORY_SHARE * 100_000_001, apart.LEAST_SECONDS + 200)
    assert apart.limits([small]) == beside, "it may refer to what lies beside it"
    with large.open("wb") as stream:
        stream.truncate(10**12)
    assert apart.limits([large])[0] == apart.MOST_MEMORY
    for text in ("0", "-1", "much", "nan"):
        monkeypatch.setenv(apart.MEMORY, text)
        with pytest.raises(UserError, match=f"{apart.MEMORY}={text}: give a number"):
            apart.limits([large])


@pytest.mark.parametrize("name", ["pipe.ply", "pipe.usda", "pipe.toml", "zero.obj", "socket.stl"])
def test_what_is_no_regular_file_is_refused_at_once(tmp_path, name):
    path = tmp_path / name
    if name.startswith("pipe"):
        os.mkfifo(path)
    elif name.startswith("zero"):
        path.symlink_to("/dev/zero")
    else:
        listening = socket.socket(socket.AF_UNIX)
        listening.bind(str(path))
        listening.close()
    with pytest.raises(UserError, match=rf"{name}.*: not a"):
        resolve(path)


def test_files_outside_the_folder_of_the_first_are_named(tmp_path, capsys):
    near, far = tmp_path / "scene" / "a.obj", tmp_path / "far.bin"
    found = apart.Loaded(np.zeros((1, 3), np.int32), (np.zeros((3, 3)),), (near, near.parent / "b" / "c.bin"))
    assert apart._told(found, [near]) is found
    assert capsys.readouterr().err == ""
    beyond = apart.Loaded(found.faces, found.frames, (near, near.parent / ".." / "far.bin"))
    apart._told(beyond, [near])
    assert f"{near}: refers to files outside its folder: {near.parent / '..' / far.name}" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("text", "size"),
    [*((text, 8) for text in (
     b'{"": "array", "of": ["|O", 1]}', b'{"": "array", "of": ["<f8", -1]}', b'{"": "array", "of": ["<f8", 2]}',
     b'{"": "array", "of": ["<f4", 1]}', b"{}", b'{"": "array", "of": ["<f8", 0.5]}', b'{"": "array", "of": []}',
     b'{"": "os", "of": {}}', b'{"": "Camera", "of": {"eye": 1}}', b"[")),
     (b'{"": "array", "of": ["<f8", 2]}', 16)],
)  # fmt: skip
def test_only_numbers_and_known_classes_are_taken_from_a_reader(text, size):
    """A reader that a file has taken over can send what it likes."""
    one, other = Pipe()
    with one, other:
        os.write(one.fileno(), helper.HEAD.pack(len(text), size) + text + bytes(8))
        one.close()
        with pytest.raises((ValueError, KeyError, TypeError)):
            helper.received(other, most=8)
