"""Originals from a server on the loopback address: cut, altered, climbing and exploding archives."""

import hashlib
import io
import tarfile
import threading
import zipfile
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import pytest
from helpers.tiny_runs import TETRAHEDRON
from shadowbench.harness.commands import scenes as command
from shadowbench.harness.commands.scenes import SOURCES, Source, scenes
from shadowbench.harness.errors import UserError
from shadowbench.harness.scene import archives, catalogue
from shadowbench.harness.scene.download import downloaded, recorded
from shadowbench.harness.scene.names import scene_names


def zipped(files):
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as packed:
        for name, text in files.items():
            packed.writestr(name, text)
    return buffer.getvalue()


WHOLE = zipped({"a/readme.txt": "x" * 5000, "a/sibenik.obj": TETRAHEDRON})


@pytest.fixture
def serve(monkeypatch):
    """Serve one archive as that of Sibenik: the list of requested ranges. ``cuts``: bytes sent of each first answer."""
    servers = []

    def start(content, cuts=(), sha256="", files="*sibenik.obj", name="sibenik"):
        asked, remaining = [], list(cuts)

        class Handler(BaseHTTPRequestHandler):
            def do_GET(self):
                wanted = self.headers.get("Range")
                asked.append(wanted)
                first = int(wanted[6:-1]) if wanted and self.headers.get("If-Range") == '"one"' else 0
                self.send_response(206 if first else 200)
                self.send_header("ETag", '"one"')
                self.send_header("Content-Length", str(len(content) - first))
                self.end_headers()
                self.wfile.write(content[first:][: remaining.pop(0) if remaining else None])

            def log_message(self, *_):
                pass

        server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        servers.append(server)
        threading.Thread(target=server.serve_forever, args=(0.02,), daemon=True).start()
        url = f"http://127.0.0.1:{server.server_port}/{name}.zip"
        monkeypatch.setitem(command.SOURCES, name, Source(url, files, "nobody's", sha256))
        return asked

    yield start
    for server in servers:
        server.shutdown()
        server.server_close()


def test_every_scene_has_a_source():
    assert set(SOURCES) == set(scene_names())


def test_a_cut_file_is_continued_and_replaces_the_stand_in(serve, tmp_path, capsys):
    asked = serve(WHOLE, cuts=(100, 50))
    assert scenes("fetch", ["sibenik"], tmp_path) == 0
    assert asked == [None, "bytes=100-", "bytes=150-"]
    found = catalogue.resolve("sibenik", tmp_path)
    assert (found.stand_in, found.source.file) == (None, "sibenik.obj")
    assert list(recorded(tmp_path / "archives").values()) == [hashlib.sha256(WHOLE).hexdigest()]
    assert scenes("fetch", ["sibenik"], tmp_path) == 0
    assert len(asked) == 3, "it is there, and not fetched again"
    assert "already in" in capsys.readouterr().err


def test_what_was_cut_off_too_often_is_continued_by_the_next_command(serve, tmp_path):
    asked = serve(WHOLE, cuts=(40, 30, 20))
    with pytest.raises(UserError, match="the same command continues it"):
        scenes("fetch", ["sibenik"], tmp_path)
    assert scenes("fetch", ["sibenik"], tmp_path) == 0
    assert asked[-1] == "bytes=90-"


@pytest.mark.parametrize("pinned", [True, False])
def test_a_wrong_checksum_is_refused(serve, tmp_path, pinned):
    """Pinned in the program, or recorded when it was first fetched."""
    if not pinned:
        serve(WHOLE)
        scenes("fetch", ["sibenik"], tmp_path)
        (tmp_path / "sibenik.obj").unlink()
        (tmp_path / "archives" / "sibenik.zip").unlink()
        url, digest = next(iter(recorded(tmp_path / "archives").items()))
        port = url.split("/")[2]
    serve(WHOLE + b"altered", sha256="0" * 64 if pinned else "")
    if not pinned:
        new = command.SOURCES["sibenik"].url
        (tmp_path / "archives" / "checksums.json").write_text(f'{{"{new}": "{digest}"}}')
        assert port not in new
    with pytest.raises(UserError, match="its checksum is not") as refused:
        scenes("fetch", ["sibenik"], tmp_path)
    assert "\n" not in str(refused.value)
    assert not (tmp_path / "sibenik.obj").exists()
    assert [path.name for path in (tmp_path / "archives").iterdir() if path.suffix != ".json"] == []


def taped(name, text):
    buffer = io.BytesIO()
    with tarfile.open(fileobj=buffer, mode="w:gz") as tape:
        member = tarfile.TarInfo(name)
        member.size = len(text)
        tape.addfile(member, io.BytesIO(text.encode()))
    return buffer.getvalue()


packed_tar = taped("a/sibenik.obj", TETRAHEDRON * 500)


def linked():
    buffer = io.BytesIO()
    with tarfile.open(fileobj=buffer, mode="w:gz") as tape:
        link = tarfile.TarInfo("a/sibenik.obj")
        link.type, link.linkname = tarfile.SYMTYPE, "/etc/passwd"
        tape.addfile(link)
    return buffer.getvalue()


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (zipped({"../sibenik.obj": TETRAHEDRON}), "leaves its folder"),
        (zipped({"/tmp/sibenik.obj": TETRAHEDRON}), "leaves its folder"),
        (zipped({"a\\..\\..\\sibenik.obj": TETRAHEDRON}), "leaves its folder"),
        (zipped({"sibenik.obj": TETRAHEDRON + "#" * 500_000}), "unpacks to more than 100,000 bytes"),
        (zipped({f"{i}.txt": "" for i in range(30)}), "more than 20 files"),
        (zipped({"a/sibenik.obj": TETRAHEDRON, "b/sibenik.obj": TETRAHEDRON}), "holds two files"),
        (zipped({"other.obj": TETRAHEDRON}), "has no file"),
        (zipped({"name": ""}).replace(b"name", b"\0ame"), "has no file"),
        (zipped({"sibenik.obj": "no mesh"}), "sibenik.obj"),
        (WHOLE[:-30], "no archive but"),
        (zipped({"n" * 3000 + "sibenik.obj": ""}).replace(b"n" * 3000, b"m" * 3000, 1), "damaged"),
        (packed_tar[: len(packed_tar) // 2], "damaged"),
        (linked(), "a link or no file"),
    ],
)
def test_what_must_not_be_unpacked_is_refused(serve, tmp_path, monkeypatch, content, said):
    monkeypatch.setattr(archives, "MOST_MEMBERS", 20)
    monkeypatch.setattr(archives.unpack, "__defaults__", (100_000,))
    serve(content)
    folder = tmp_path / "deep" / "scenes"
    with pytest.raises(UserError, match=said) as refused:
        scenes("fetch", ["sibenik"], folder)
    assert "\n" not in str(refused.value)
    assert len(str(refused.value)) < 1500
    assert [path.name for path in folder.iterdir()] == ["archives"]
    assert [path.name for path in tmp_path.rglob("*.obj")] == []


PAGE = b"<html><head><title>Service unavailable</title></head></html>"


def test_an_error_page_is_not_taken_for_the_archive_and_pins_nothing(serve, tmp_path):
    """A server may send one with the status of a success."""
    serve(PAGE)
    with pytest.raises(UserError, match="no archive but '<html>") as refused:
        scenes("fetch", ["sibenik"], tmp_path)
    assert "\n" not in str(refused.value)
    assert recorded(tmp_path / "archives") == {}
    serve(WHOLE)
    assert scenes("fetch", ["sibenik"], tmp_path) == 0
    assert list(recorded(tmp_path / "archives").values()) == [hashlib.sha256(WHOLE).hexdigest()]


def test_an_archive_without_the_mesh_pins_nothing(serve, tmp_path):
    for content in (zipped({"a/readme.txt": "x"}), zipped({"a/sibenik.obj": "no mesh"}), WHOLE[:-30]):
        serve(content)
        with pytest.raises(UserError):
            scenes("fetch", ["sibenik"], tmp_path)
        assert recorded(tmp_path / "archives") == {}
        assert list((tmp_path / "archives").iterdir()) == []


def test_an_encrypted_address_must_not_lead_to_another(tmp_path, monkeypatch):
    import requests

    class Answer:
        status_code, url, headers = 200, "http://elsewhere.example/a.zip", {}
        __enter__ = lambda self: self  # noqa: E731
        __exit__ = raise_for_status = lambda self, *_: None

    monkeypatch.setattr(requests, "get", lambda *_, **__: Answer())
    with (
        pytest.raises(UserError, match="which is not encrypted"),
        downloaded("https://archive.example/a.zip", tmp_path),
    ):
        raise AssertionError


def test_frames_stand_in_the_order_of_their_numbers(serve, tmp_path):
    frames = {f"c/ball{i}.obj": TETRAHEDRON.replace("v 0 0 1", f"v 0 0 {i}") for i in (10, 9, 1)}
    serve(zipped(frames), files="*.obj", name="cloth")
    assert scenes("fetch", ["cloth"], tmp_path) == 0
    geometry = catalogue.resolve("cloth", tmp_path).geometry()
    assert [geometry.positions(k)[3][2] for k in range(geometry.frame_count)] == [1.0, 9.0, 10.0]


def test_what_a_person_has_to_fetch_is_told(tmp_path, capsys, monkeypatch):
    assert scenes("fetch", ["fairy"], tmp_path) == 1
    said = capsys.readouterr().err
    assert "by hand" in said
    assert f"{tmp_path} as fairy_001.obj" in said
    monkeypatch.delenv(catalogue.FOLDER_VARIABLE, raising=False)
    for arguments, text in [(("fetch", ["fary"], tmp_path), "did you mean fairy"), (("get", ["fairy"]), "only scenes fetch"),
                            (("fetch", ["fairy"]), "give --scene-dir")]:  # fmt: skip
        with pytest.raises(UserError, match=text):
            scenes(*arguments)
