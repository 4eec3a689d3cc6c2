"""Damaged scene files: whatever the bytes, a valid mesh or one line, never anything else."""

import io
import os
import struct
import tracemalloc
import warnings

import numpy as np
import pytest
from helpers import mesh_files as files
from helpers.loaded_shapes import shape_of
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from shadowbench.harness.errors import UserError
from shadowbench.harness.scene.prepared import prepare
from shadowbench.harness.scene.readers import usd
from shadowbench.harness.scene.readers.load import Loaded, load
from shadowbench.harness.scene.scene import Scene
from shadowbench.harness.scene.views import view

MIXED = [(0, 1, 2, 3), (0, 1, 4), (0, 1, 2, 3, 4)]


def npz() -> bytes:
    stream = io.BytesIO()
    np.savez(stream, V=np.stack([files.QUAD, files.QUAD + 1]), F=np.array(files.FACES))
    return stream.getvalue()


CONCAVE = [(0, 3, 0), (0, 0, 0), (4, 0, 0), (4, 3, 0), (3, 3, 0), (3, 1, 0), (1, 1, 0), (1, 3, 0)]

STRIPS = files.ply_binary(polygons=[(0, 1, 2, 3, -1, 4, 3, 2)]).replace(b"element face", b"element tristrips")

SEEDS = {
    "triangles.ply": files.ply_binary(),
    "mixed.ply": files.ply_binary(polygons=MIXED, big=True),
    "ascii.ply": files.ply_ascii(),
    "mixed_ascii.ply": files.ply_ascii(polygons=MIXED),
    "triangles.obj": files.obj(),
    "mixed.obj": files.obj(polygons=MIXED).replace(b"f 1 2 5", b"f -5/1/1 2//3 5/1"),
    "utf16.obj": files.obj(polygons=MIXED).decode().replace("\n", "\r").encode("utf-16"),
    "continued.obj": files.obj(polygons=MIXED)
    .replace(b" 3", b" \\\n3 # c\\")
    .replace(b"f 1", b"# d:\\\nf 1"),
    "concave.ply": files.ply_ascii(CONCAVE, [tuple(range(8))]),
    "strips.ply": STRIPS,
    "binary.stl": files.stl_binary(),
    "ascii.stl": files.stl_ascii(),
    "scene.glb": files.glb(),
    "frames.npz": npz(),
}

WORDS = [
    b"nan", b"-nan", b"inf", b"1e400", b"-1e400", b"1e-400", b"0", b"-1", b"-0.0", b"1_0", b"0x10", b"2147483648",
    b"4294967295", b"99999999999999999999", b"1e5", b"", b" ", b"\t", b"\n", b"\r\n", b"\r", b"\\\n", b"\0",
    b"\xff\xfe", b"\xef\xbb\xbf", b"\xc3\x28", "\u0661".encode(), b"/", b"//", b"#", b"[", b"{", b'"', b"null",
]  # fmt: skip

EXAMPLES = int(os.environ.get("FUZZ_EXAMPLES", "100"))
"""Damaged files of each seed; more than a run of all tests has time for, where the environment says so."""

position = st.floats(0, 1, exclude_max=True)
byte = st.integers(0, 255).map(lambda n: bytes([n]))
mutation = st.one_of(
    st.tuples(st.just("cut"), position),
    st.tuples(st.just("flip"), position, byte),
    st.tuples(st.just("word"), position, st.sampled_from(WORDS)),
    st.tuples(st.just("insert"), position, st.sampled_from(WORDS)),
    st.tuples(st.just("number"), position, st.sampled_from([0, 1, 3, 255, 65535, 1 << 31, (1 << 32) - 1])),
    st.tuples(st.just("repeat"), position, position),
    st.tuples(st.just("drop"), position, position),
    st.tuples(st.just("crlf")),
)


def damaged(blob: bytes, steps) -> bytes:
    """The file after each mutation in turn."""
    for kind, *how in steps:
        at = int(how[0] * len(blob)) if how else 0
        if kind == "cut":
            blob = blob[:at]
        elif kind == "flip":
            blob = blob[:at] + how[1] + blob[at + 1 :]
        elif kind == "word":  # in place of what stands between two blanks
            start = max(blob.rfind(blank, 0, at) for blank in (b" ", b"\n")) + 1
            ends = [i for i in (blob.find(b" ", at), blob.find(b"\n", at)) if i >= 0]
            blob = blob[:start] + how[1] + blob[min(ends, default=len(blob)) :]
        elif kind == "insert":
            blob = blob[:at] + how[1] + blob[at:]
        elif kind == "number":
            blob = blob[:at] + struct.pack("<I", how[1]) + blob[at + 4 :]
        elif kind in ("repeat", "drop"):
            low, high = sorted((at, int(how[1] * len(blob))))
            blob = blob[:low] + blob[low:high] * (2 if kind == "repeat" else 0) + blob[high:]
        elif kind == "crlf":
            blob = blob.replace(b"\n", b"\r\n")
    return blob


ROOM = 1 << 19
"""What a reader may hold beside ten times the file: its own tables and buffers, whatever the file."""


def measured(path) -> tuple[Loaded | UserError, int]:
    """What comes of loading a file, and the most memory that it took."""
    tracemalloc.start()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", RuntimeWarning)
            return load(path), tracemalloc.get_traced_memory()[1]
    except UserError as error:
        return error, tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def check(path) -> bool:
    """Load a file; True where it is a valid mesh that can be prepared and looked at, False where it is refused.

    Either way within ten times the memory of the file.
    """
    loaded, peak = measured(path)
    limit = 10 * path.stat().st_size + ROOM
    if peak > limit:  # again: what a first call imports for damage of this kind is not the file's
        loaded, peak = measured(path)
    assert peak <= limit, f"{peak} bytes for a file of {path.stat().st_size}"
    if isinstance(loaded, UserError):
        line = str(loaded)
        assert "\n" not in line
        assert len(line) < 600
        assert path.name in line
        return False
    assert len(loaded.faces)
    assert loaded.faces.dtype == np.int32
    for frame in loaded.frames:
        assert frame.shape == loaded.frames[0].shape
        assert 0 <= loaded.faces.min() <= loaded.faces.max() < len(frame)
    camera, lights = view(shape_of(loaded))
    moment = prepare(Scene("fuzz", "Fuzz", loaded.geometry, camera, lights)).moment(0, 2, 2)
    assert np.isfinite(moment.eye).all()
    assert np.isfinite(moment.lights).all()
    return True


@pytest.fixture(scope="module", autouse=True)
def imported(tmp_path_factory) -> None:
    """Whatever is imported on the first call is not a file's memory."""
    for name, blob in SEEDS.items():
        path = tmp_path_factory.mktemp("first") / name
        path.write_bytes(blob)
        load(path)


@pytest.mark.parametrize("name", SEEDS)
def test_undamaged_files_load(tmp_path, name):
    path = tmp_path / name
    path.write_bytes(SEEDS[name])
    assert check(path)


@pytest.mark.parametrize("name", SEEDS)
def test_damaged_files_are_read_or_refused(tmp_path, name):
    path = tmp_path / name
    outcomes = []

    @given(st.lists(mutation, min_size=1, max_size=4))
    @settings(
        derandomize=True,
        max_examples=EXAMPLES,
        deadline=None,
        suppress_health_check=list(HealthCheck),
        database=None,
    )
    def run(steps):
        path.write_bytes(damaged(SEEDS[name], steps))
        outcomes.append(check(path))

    run()
    assert not all(outcomes), "no damage was ever noticed"


@pytest.mark.parametrize("name", SEEDS)
def test_every_truncation_is_read_or_refused(tmp_path, name):
    """Formats with counts refuse every one; OBJ has none and may lose whole lines, an STL text whole facets."""
    path = tmp_path / name
    blob = SEEDS[name].rstrip(b"\n")
    enough = 0 if name.endswith(".obj") else len(blob)
    if name == "ascii.stl":
        enough = blob.find(b"endfacet") + 8
    for length in range(0, len(blob), 1 if len(blob) < 400 else 3):
        path.write_bytes(blob[:length])
        assert not check(path) or length >= enough


SIDE = 40
GRID = np.random.default_rng(0).random((SIDE * SIDE, 3)).astype(np.float32)
CORNERS = (np.arange(SIDE - 1)[:, None] * SIDE + np.arange(SIDE - 1)).ravel()
TRIANGLES = np.stack([CORNERS, CORNERS + 1, CORNERS + SIDE], axis=1).tolist()
POINT_COUNT, FACE_COUNT = str(len(GRID)).encode(), str(len(TRIANGLES)).encode()
HUGE = (10**5, 10**7, 2**31 - 1, 2**32 - 1, 10**12)


def large_npz() -> bytes:
    stream = io.BytesIO()
    np.savez(stream, V=np.stack([GRID, GRID + 1]), F=np.array(TRIANGLES))
    return stream.getvalue()


def counted(old: bytes, fields: bytes):
    """A change of a count in a text: ``fields`` with the new number in place of %d, for ``old``."""
    return lambda blob, n: blob.replace(old, fields % n)


def word_at(place: int):
    """A change of the 32 bits at a place."""
    return lambda blob, n: blob[:place] + struct.pack("<I", min(n, 2**32 - 1)) + blob[place + 4 :]


def shaped(blob: bytes, n: int) -> bytes:
    """Another number of vertices in the header of an array, whose length stays what it is."""
    new = b"(2, %d, 3), }" % n
    return blob.replace(b"(2, 1600, 3), }".ljust(len(new)), new)


PROMISES = {
    "vertices.ply": (files.ply_binary(GRID, TRIANGLES), counted(b"vertex " + POINT_COUNT, b"vertex %d")),
    "faces.ply": (files.ply_binary(GRID, TRIANGLES), counted(b"face " + FACE_COUNT, b"face %d")),
    "vertices_ascii.ply": (files.ply_ascii(GRID, TRIANGLES), counted(b"vertex " + POINT_COUNT, b"vertex %d")),
    "faces_ascii.ply": (files.ply_ascii(GRID, TRIANGLES), counted(b"face " + FACE_COUNT, b"face %d")),
    "corners_ascii.ply": (files.ply_ascii(GRID, TRIANGLES), counted(b"\n3 0 1 40\n", b"\n%d 0 1 40\n")),
    "index.obj": (files.obj(GRID, TRIANGLES), counted(b"\nf 1 2 41\n", b"\nf 1 2 %d\n")),
    "facets.stl": (files.stl_binary(GRID, TRIANGLES), word_at(80)),
    "length.glb": (files.glb(GRID, TRIANGLES), word_at(8)),
    "json.glb": (files.glb(GRID, TRIANGLES), word_at(12)),
    "count.glb": (files.glb(GRID, TRIANGLES), counted(b'"count": ' + POINT_COUNT, b'"count": %d')),
    "shape.npz": (large_npz(), shaped),
}
"""Files of which one number promises more than there is: the file, and how to write the number."""


@pytest.mark.parametrize("name", PROMISES)
def test_promises_take_no_memory(tmp_path, name):
    """A count that the file does not hold is refused before room is made for it."""
    blob, promise = PROMISES[name]
    path = tmp_path / name
    path.write_bytes(blob)
    assert check(path)
    for huge in HUGE:
        path.write_bytes(promise(blob, huge))
        assert path.read_bytes() != blob
        assert not check(path)


numbers = st.sampled_from(
    [0, 1, 2, 3, 5, 12, 5121, 5126, -1, 1 << 31, 1 << 62, 0.5, float("nan"), None, "x", [], {}, True]
)


@given(st.lists(st.tuples(position, numbers), min_size=1, max_size=3))
@settings(derandomize=True, max_examples=150, deadline=None, suppress_health_check=list(HealthCheck))
def test_glb_whose_json_says_anything(tmp_path_factory, steps):
    def change(head):
        for where, value in steps:
            places = list(leaves(head))
            holder, key = places[int(where * len(places))]
            holder[key] = value

    def leaves(entry):
        for key, value in entry.items() if isinstance(entry, dict) else enumerate(entry):
            yield entry, key
            if isinstance(value, dict | list):
                yield from leaves(value)

    path = tmp_path_factory.getbasetemp() / "scene.glb"
    path.write_bytes(files.glb(change=change))
    check(path)


def test_glb_with_json_nested_beyond_reason(tmp_path):
    text = (b'{"a":' + b"[" * 100_000 + b"]" * 100_000 + b"}").ljust(200_008)
    body = struct.pack("<II", len(text), 0x4E4F534A) + text
    path = tmp_path / "deep.glb"
    path.write_bytes(b"glTF" + struct.pack("<II", 2, 12 + len(body)) + body)
    assert not check(path)


def test_npz_headers_that_claim_anything(tmp_path):
    """The array header is Python text; it is parsed as a literal and never run."""
    path = tmp_path / "a.npz"
    good = npz()
    for old, new in (
        (b"(2, 5, 3)", b"(9, 5, 3)"),
        (b"(2, 5, 3)", b"(2,-5,-3"),
        (b"'<f4'", b"'|O'"),
        (b"'<f4'", b"'<c8"),
        (b"(2, 5, 3)", b"exit()   "),
    ):
        path.write_bytes(good.replace(old, new.ljust(len(old))))
        assert not check(path)


@pytest.mark.skipif(not usd.available(), reason="usd-core is not installed")
def test_damaged_usd_text_is_read_or_refused(tmp_path):
    outcomes = []
    seed = files.USDA.encode()
    words = st.tuples(
        st.just("word"), position, st.sampled_from([b"nan", b"-1", b"9", b"1e400", b"[]", b'"x"', b"("])
    )
    cuts = st.tuples(st.just("cut"), position)
    count = iter(range(10_000))

    @given(st.lists(st.one_of(words, cuts), min_size=1, max_size=2))
    @settings(derandomize=True, max_examples=60, deadline=None, suppress_health_check=list(HealthCheck))
    def run(steps):
        # A name of its own for each: the library keeps what it has read by path.
        path = tmp_path / f"{next(count)}.usda"
        path.write_bytes(damaged(seed, steps))
        outcomes.append(check(path))

    run()
    assert set(outcomes) == {True, False}
