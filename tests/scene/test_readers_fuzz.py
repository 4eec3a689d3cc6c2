"""Damaged scene files: whatever the bytes, a valid mesh or one line, in time and within ten times the file's memory.

``tests/tools/fuzz_inputs.py --only files`` does the same with thousands of files.
"""

import struct
import tracemalloc
import warnings

import numpy as np
import pytest
from helpers import mesh_files as files
from helpers.fuzzed_inputs import READ, REFUSED
from helpers.reader_fuzz import fuzz, outcome
from helpers.reader_seeds import npz, seeds
from shadowbench.harness.errors import UserError
from shadowbench.harness.scene.readers import apart
from shadowbench.harness.scene.readers.load import load

CASES = 60
"""Damaged files of each format, and as many cut short."""

SEEDS = seeds()
HERE = [ending for ending in SEEDS if not ending.startswith(".usd")]
"""What no library of C++ reads, so that it can be read in this process."""

ROOM = 1 << 19
"""What a reader may hold beside ten times the file: its own tables and buffers, whatever the file."""


def within_memory(path):
    """Load a file in this process, where warnings are errors and memory is counted."""
    limit = 10 * path.stat().st_size + ROOM
    for _ in range(2):  # again: what a first call imports for damage of this kind is not the file's
        tracemalloc.start()
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("error", RuntimeWarning)
                found = load(path)
        except UserError as error:
            found = error
        finally:
            peak = tracemalloc.get_traced_memory()[1]
            tracemalloc.stop()
        if peak <= limit:
            break
    assert peak <= limit, f"{peak} bytes for a file of {path.stat().st_size}"
    if isinstance(found, UserError):
        raise found
    return found


@pytest.mark.parametrize("ending", SEEDS)
def test_damaged_files_are_read_or_refused(tmp_path, monkeypatch, ending):
    monkeypatch.setenv(apart.TIME, "4")  # some damaged stages make USD's library run for ever
    read = within_memory if ending in HERE else apart.load
    found = fuzz(ending, SEEDS[ending], tmp_path, CASES, CASES, read=read)
    assert found.outcomes[READ] >= len(SEEDS[ending])
    assert found.outcomes[REFUSED] > CASES, "damage was not noticed"
    assert found.growth < 64 << 20


@pytest.mark.parametrize("ending", [ending for ending in HERE if ending != ".obj"])
def test_a_file_with_counts_that_is_cut_short_is_refused(tmp_path, ending):
    """OBJ has none and may lose whole lines, an STL text whole facets."""
    path = tmp_path / f"a{ending}"
    for blob in SEEDS[ending]:
        least = blob.find(b"endfacet") + 8 if blob.startswith(b"solid") else len(blob.rstrip())
        least -= len(" 0.5") * blob.startswith(b"# x\nCOFF")  # a colour may be shorter
        for length in range(0, least, max(1, least // 60)):
            path.write_bytes(blob[:length])
            assert outcome(path, load) == REFUSED


SIDE = 40
GRID = np.random.default_rng(0).random((SIDE * SIDE, 3)).astype(np.float32)
CORNERS = (np.arange(SIDE - 1)[:, None] * SIDE + np.arange(SIDE - 1)).ravel()
TRIANGLES = np.stack([CORNERS, CORNERS + 1, CORNERS + SIDE], axis=1).tolist()
POINT_COUNT, FACE_COUNT = str(len(GRID)).encode(), str(len(TRIANGLES)).encode()
HUGE = (10**5, 2**31 - 1, 10**12)


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
    "shape.npz": (npz([GRID, GRID + 1], TRIANGLES), shaped),
}
"""Files of which one number promises more than there is: the file, and how to write the number."""


@pytest.mark.parametrize("name", PROMISES)
def test_promises_take_no_memory(tmp_path, name):
    """A count that the file does not hold is refused before room is made for it."""
    blob, promise = PROMISES[name]
    path = tmp_path / name
    path.write_bytes(blob)
    load(path)  # what is imported on the first call is not the file's memory
    assert outcome(path, within_memory) == READ
    for huge in HUGE:
        path.write_bytes(promise(blob, huge))
        assert path.read_bytes() != blob
        assert outcome(path, within_memory) == REFUSED


QUADS = np.stack([CORNERS, CORNERS + 1, CORNERS + SIDE + 1, CORNERS + SIDE], axis=1).tolist()
MIXED = [*TRIANGLES, *QUADS]
WHOLE = {
    "mixed.ply": files.ply_binary(GRID, MIXED), "mixed_ascii.ply": files.ply_ascii(GRID, MIXED),
    "mixed.obj": files.obj(GRID, MIXED), "mixed.off": files.off(GRID, MIXED),
    "ascii.stl": files.stl_ascii(GRID, 2 * TRIANGLES),
}  # fmt: skip


@pytest.mark.parametrize("name", WHOLE)
def test_polygons_and_texts_take_no_more_memory(tmp_path, name):
    path = tmp_path / name
    path.write_bytes(WHOLE[name])
    assert outcome(path, within_memory) == READ


@pytest.mark.parametrize(
    ("old", "new"),
    [("(2, 5, 3)", "(9, 5, 3)"), ("(2, 5, 3)", "(2,-5,-3"), ("'<f4'", "'|O'"), ("'<f4'", "'<c8"), ("(2, 5, 3)", "exit()")],
)  # fmt: skip
def test_npz_headers_that_claim_anything(tmp_path, old, new):
    """The array header is Python text; it is parsed as a literal and never run."""
    path = tmp_path / "a.npz"
    path.write_bytes(npz().replace(old.encode(), new.ljust(len(old)).encode()))
    assert outcome(path, load) == REFUSED
