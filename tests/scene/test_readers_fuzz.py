"""Damaged scene files: whatever the bytes, a valid mesh or one line, in time and within ten times the file's memory.

``tests/tools/fuzz_inputs.py --only files`` does the same with thousands of files.
"""

import struct
from collections import Counter
from random import Random

import numpy as np
import pytest
from helpers import mesh_files as files
from helpers.fuzzed_bytes import damaged
from helpers.fuzzed_inputs import READ, REFUSED
from helpers.reader_fuzz import outcome, within_memory
from helpers.reader_seeds import npz, seeds
from shadowbench.harness.scene.readers import apart
from shadowbench.harness.scene.readers.load import load

CASES = 80
"""Damaged files of each format, and as many cut short."""

SEEDS = seeds()


@pytest.mark.parametrize("ending", SEEDS)
def test_damaged_files_are_read_or_refused(tmp_path, monkeypatch, ending):
    """With changed bytes, words and values; and ended early, where a file with counts is refused."""
    monkeypatch.setenv(apart.TIME, "4")  # some damaged stages make USD's library run for ever
    here = not ending.startswith(".usd")  # what no library of C++ reads
    path, rng, found = tmp_path / f"a{ending}", Random(ending), Counter()

    def tried(blob: bytes) -> str:
        path.write_bytes(blob)
        return outcome(path, within_memory if here else apart.load)

    for blob in SEEDS[ending]:
        assert tried(blob) == READ
        # OBJ has no counts and may lose whole lines, an STL text whole facets, and a colour may be shorter.
        least = blob.find(b"endfacet") + 8 if blob.startswith(b"solid") else len(blob.rstrip())
        least -= len(" 0.5") * blob.startswith(b"# x\nCOFF")
        for length in range(0, least, max(1, least * len(SEEDS[ending]) // CASES)):
            assert tried(blob[:length]) == REFUSED or ending in (".obj", ".usda", ".usdc", ".usdz")
    for _ in range(CASES if here else CASES // 3):
        found[tried(damaged(rng, rng.choice(SEEDS[ending]), SEEDS[ending]))] += 1
    assert found[REFUSED] > found.total() // 4, "damage was not noticed"


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
    "mixed.ply": files.ply_binary(GRID, MIXED),
    "mixed_ascii.ply": files.ply_ascii(GRID, MIXED),
    "mixed.obj": files.obj(GRID, MIXED),
    "mixed.off": files.off(GRID, MIXED),
    "ascii.stl": files.stl_ascii(GRID, 2 * TRIANGLES),
}


@pytest.mark.parametrize("name", WHOLE)
def test_polygons_and_texts_take_no_more_memory(tmp_path, name):
    assert outcome(files.written(tmp_path, name, WHOLE[name]), within_memory) == READ


@pytest.mark.parametrize(
    ("old", "new"),
    [("(2, 5, 3)", "(9, 5, 3)"), ("(2, 5, 3)", "(2,-5,-3"), ("'<f4'", "'|O'"), ("'<f4'", "'<c8"), ("(2, 5, 3)", "exit()")],
)  # fmt: skip
def test_npz_headers_that_claim_anything(tmp_path, old, new):
    """The array header is Python text; it is parsed as a literal and never run."""
    path = tmp_path / "a.npz"
    path.write_bytes(npz().replace(old.encode(), new.ljust(len(old)).encode()))
    assert outcome(path, load) == REFUSED
