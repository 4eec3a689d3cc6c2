"""Originals from a server on the loopback address: cut, altered, climbing and exploding archives."""

import gzip
import hashlib
import io
import json
import re
import tarfile
import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import pytest
from helpers import mesh_files as files
from helpers.mesh_files import zipped
from helpers.tiny_runs import TETRAHEDRON
from shadowbench.harness.commands.scenes import scenes
from shadowbench.harness.errors import UserError
from shadowbench.harness.scene import catalogue, download
from shadowbench.harness.scene.download import downloaded, recorded
from shadowbench.harness.scene.names import scene_names
from shadowbench.harness.scene.offered import FURTHER, OFFERS, ORIGINALS, Offer

WHOLE = zipped({"a/readme.txt": "x" * 5000, "a/sibenik.obj": TETRAHEDRON})


@pytest.fixture
def serve(monkeypatch):
    """Serve one archive as that of Sibenik: the list of requested ranges. ``cuts``: bytes sent of each first answer."""
    servers = []

    def start(content, cuts=(), sha256="", files="*sibenik.obj", name="sibenik", ending="zip"):
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
        url = f"http://127.0.0.1:{server.server_port}/{name}.{ending}"
        monkeypatch.setitem(OFFERS, name, Offer(url, files, "nobody's", sha256))
        return asked

    yield start
    for server in servers:
        server.shutdown()
        server.server_close()


def test_every_offer_has_terms_and_every_scene_of_the_catalogue_one():
    assert set(ORIGINALS) == set(scene_names())
    assert not set(FURTHER) & set(scene_names())
    for name, offer in OFFERS.items():
        assert offer.terms, name
        assert offer.files == offer.files.lower(), "names of members are compared in lower case"
        assert re.fullmatch("[0-9a-f]{64}|", offer.sha256), name
        assert offer.where.startswith(("https://", "http://gamma.cs.unc.edu/")) or offer.packaged or not offer.where
        assert bool(offer.make) == offer.packaged <= bool(offer.sha256), name


def test_the_list_tells_terms_checksums_and_what_is_there(tmp_path, capsys):
    (tmp_path / "dragon.obj").write_text(TETRAHEDRON)
    assert scenes("list", ["dragon", "hairball", "munich"], tmp_path) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "in the folder of scenes; Stanford Computer Graphics Laboratory: for research, with credit" in said
    assert f"SHA-256 {FURTHER['dragon'].sha256}" in said
    assert FURTHER["hairball"].where in said.replace(" ", ""), "whole, over two lines"
    assert "NVIDIA Research: CC BY 3.0; McGuire archive" in said
    assert "checksum not pinned: never had" in said
    assert "ODbL 1.0 sionna-rt==2.2.0" in said


MEMBERS = {
    "sibenik": ["sibenik/sibenik.obj", "sibenik/copyright.txt"],
    "conference": ["conference.obj", "conference.mtl"],
    "buddha": ["happy_recon/happy_vrip.ply", "happy_recon/happy_vrip_res2.ply"],
    "bunny": ["bunny/reconstruction/bun_zipper.ply", "bunny/reconstruction/bun_zipper_res2.ply"],
    "dragon": ["dragon_recon/dragon_vrip.ply", "dragon_recon/dragon_vrip_res2.ply"],
    "lucy": ["lucy.ply"],
    "rungholt": ["rungholt.obj", "house.obj"],
    "san_miguel": ["san-miguel.obj", "san-miguel-low-poly.obj"],
    "road_bike": ["roadBike.obj", "roadBike.mtl"],
}
"""Files in the archives as others have told of them, the wanted one first."""


@pytest.mark.parametrize("name", MEMBERS)
def test_of_an_archive_the_wanted_mesh_is_taken(tmp_path, name):
    wanted, *others = MEMBERS[name]
    (tmp_path / "a.zip").write_bytes(zipped({wanted: "mesh", **dict.fromkeys(others, "no mesh")}))
    (made,) = download.unpack(tmp_path / "a.zip", OFFERS[name].files, tmp_path)
    assert (made.name, made.read_text()) == (wanted.rpartition("/")[2], "mesh")


def test_a_gzip_file_is_an_archive_of_one_file(serve, tmp_path):
    packed = gzip.compress(files.ply_binary(files.QUAD))
    serve(packed, files="*.ply", name="armadillo", ending="ply.gz")
    assert scenes("fetch", ["armadillo"], tmp_path) == 0
    found = catalogue.resolve("armadillo", tmp_path)
    assert (found.name, found.stand_in, len(found.geometry().faces)) == ("armadillo", None, 4)
    assert (tmp_path / "armadillo.source.txt").read_text().startswith(f"armadillo\nfrom: {OFFERS['armadillo'].where}")
    for number, broken in enumerate((packed[:-9], packed[:10] + b"x" * 40, packed[:2] + b"x" * 40)):
        (tmp_path / "a.ply.gz").write_bytes(broken)
        (tmp_path / str(number)).mkdir()
        with pytest.raises(UserError, match="damaged"):
            download.unpack(tmp_path / "a.ply.gz", "*.ply", tmp_path / str(number))


def test_of_several_those_that_can_be_fetched_are_and_the_others_are_named(serve, tmp_path, capsys):
    serve(b"no archive", files="*.ply", name="armadillo")
    serve(WHOLE)
    with pytest.raises(UserError, match="armadillo could not be fetched"):
        scenes("fetch", ["armadillo", "fairy", "sibenik"], tmp_path)
    said = capsys.readouterr().err
    assert "warning: armadillo: " in said
    assert "fairy: has to be fetched by hand" in said
    assert catalogue.resolve("sibenik", tmp_path).stand_in is None
    assert scenes("fetch", ["fairy", "sibenik"], tmp_path) == 1


def test_a_checksum_that_is_not_pinned_is_warned_of(serve, tmp_path, capsys):
    serve(WHOLE)
    scenes("fetch", ["sibenik"], tmp_path)
    assert "its checksum is not pinned; what arrives now is recorded" in capsys.readouterr().err
    (tmp_path / "sibenik.obj").unlink()
    scenes("fetch", ["sibenik"], tmp_path)
    serve(WHOLE, sha256=hashlib.sha256(WHOLE).hexdigest())
    scenes("fetch", ["sibenik"], tmp_path / "other")
    assert "not pinned" not in capsys.readouterr().err


def test_originals_take_the_place_of_stand_ins(tmp_path):
    for name in scene_names():
        (tmp_path / f"{name}.obj").write_text(TETRAHEDRON)
        found = catalogue.resolve(name, tmp_path)
        assert (found.stand_in, found.source.file) == (None, f"{name}.obj")


def test_a_cut_file_is_continued_and_replaces_the_stand_in(serve, tmp_path, capsys):
    asked = serve(WHOLE, cuts=(100, 50))
    assert (scenes("fetch", ["sibenik"], tmp_path), asked) == (0, [None, "bytes=100-", "bytes=150-"])
    found = catalogue.resolve("sibenik", tmp_path)
    assert (found.stand_in, found.source.file) == (None, "sibenik.obj")
    assert list(recorded(tmp_path / "archives").values()) == [hashlib.sha256(WHOLE).hexdigest()]
    assert scenes("fetch", ["sibenik"], tmp_path) == 0
    assert len(asked) == 3, "it is there, and not fetched again"
    assert "already in" in capsys.readouterr().err
    asked = serve(WHOLE, cuts=(40, 30, 20))
    with pytest.raises(UserError, match="the same command continues it"):
        scenes("fetch", ["sibenik"], tmp_path / "other")
    assert (scenes("fetch", ["sibenik"], tmp_path / "other"), asked[-1]) == (0, "bytes=90-")


@pytest.mark.parametrize(
    ("host", "said"),
    [("127.0.0.1:9", "Connection refused"), ("no-such.invalid", "Failed to resolve 'no-such.invalid'")],
)
def test_a_server_that_cannot_be_reached_is_named_once(tmp_path, host, said):
    with pytest.raises(UserError) as refused, downloaded(f"http://{host}/a.zip", tmp_path):
        pass
    assert said in str(refused.value)
    assert not re.search(r"HTTP|Pool|retries", str(refused.value))


@pytest.mark.parametrize("pinned", [True, False])
def test_a_wrong_checksum_is_refused(serve, tmp_path, pinned):
    """Pinned in the program, or recorded when it was first fetched."""
    serve(WHOLE + b"altered", sha256="0" * 64 if pinned else "")
    archived = tmp_path / "archives"
    if not pinned:
        archived.mkdir()
        known = {OFFERS["sibenik"].where: hashlib.sha256(WHOLE).hexdigest()}
        (archived / "checksums.json").write_text(json.dumps(known))
    with pytest.raises(UserError, match="its checksum is not"):
        scenes("fetch", ["sibenik"], tmp_path)
    assert not (tmp_path / "sibenik.obj").exists()
    assert [path.name for path in archived.iterdir() if path.suffix != ".json"] == []


def taped(text="", **member):
    """A compressed tape of one member."""
    buffer = io.BytesIO()
    with tarfile.open(fileobj=buffer, mode="w:gz") as tape:
        made = tarfile.TarInfo("a/sibenik.obj")
        for name, value in {"size": len(text), **member}.items():
            setattr(made, name, value)
        tape.addfile(made, io.BytesIO(text.encode()))
    return buffer.getvalue()


packed_tar = taped(TETRAHEDRON * 500)


@pytest.mark.parametrize(("content", "said"), [
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
    (gzip.compress(b"another") + zipped({"sibenik.obj": TETRAHEDRON}), "has no file"),
    (zipped({"n" * 3000 + "sibenik.obj": ""}).replace(b"n" * 3000, b"m" * 3000, 1), "damaged"),
    (packed_tar[: len(packed_tar) // 2], "damaged"),
    (taped(type=tarfile.SYMTYPE, linkname="/etc/passwd"), "a link or no file"),
])  # fmt: skip
def test_what_must_not_be_unpacked_is_refused(serve, tmp_path, monkeypatch, content, said):
    monkeypatch.setattr(download, "MOST_MEMBERS", 20)
    monkeypatch.setattr(download.unpack, "__defaults__", (100_000,))
    serve(content)
    folder = tmp_path / "deep" / "scenes"
    with pytest.raises(UserError, match=said) as refused:
        scenes("fetch", ["sibenik"], folder)
    assert len(str(refused.value)) < 1500
    assert [path.name for path in folder.iterdir()] == ["archives"]
    assert [path.name for path in tmp_path.rglob("*.obj")] == []


def test_what_is_not_the_archive_pins_nothing(serve, tmp_path):
    """A server may send an error page with the status of a success."""
    page = b"<html><head><title>Service unavailable</title></head></html>"
    for content in (page, zipped({"a/readme.txt": "x"}), zipped({"a/sibenik.obj": "no mesh"}), WHOLE[:-30]):
        serve(content)
        with pytest.raises(UserError) as refused:
            scenes("fetch", ["sibenik"], tmp_path)
        assert ("no archive but '<html>" in str(refused.value)) == (content == page)
        assert (recorded(tmp_path / "archives"), list((tmp_path / "archives").iterdir())) == ({}, [])
    serve(WHOLE)
    assert scenes("fetch", ["sibenik"], tmp_path) == 0
    assert list(recorded(tmp_path / "archives").values()) == [hashlib.sha256(WHOLE).hexdigest()]


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
    with pytest.raises(UserError, match="dragon: not in the folder of scenes; shadowbench scenes fetch dragon"):
        catalogue.resolve("dragon", tmp_path)
    monkeypatch.delenv(catalogue.FOLDER_VARIABLE, raising=False)
    for arguments, text in [(("fetch", ["fary"], tmp_path), "did you mean fairy"), (("get", ["fairy"]), "only scenes fetch"),
                            (("fetch", ["fairy"]), "give --scene-dir")]:  # fmt: skip
        with pytest.raises(UserError, match=text):
            scenes(*arguments)
