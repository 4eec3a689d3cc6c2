"""Files in place of a name that cannot be taken, and meshes of sizes that float32 cannot trace: one line each."""

import numpy as np
import pytest
from helpers import mesh_files as files
from shadowbench.harness.commands.answering import answer
from shadowbench.harness.errors import UserError
from shadowbench.harness.judge.context import Judge
from shadowbench.harness.judge.score import score_answers
from shadowbench.harness.scene import catalogue
from shadowbench.harness.scene.prepared import prepare


def put(path):
    path.write_bytes(files.obj(files.QUAD) if path.suffix == ".obj" else files.ply_binary(files.QUAD))


@pytest.mark.parametrize("make", [lambda path: path.mkdir(), lambda path: path.symlink_to(path)])
def test_what_bears_an_originals_name_and_is_no_file_is_reported(tmp_path, capsys, make):
    make(tmp_path / "sibenik.ply")
    assert catalogue.resolve("sibenik", tmp_path).stand_in
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert f"warning: {tmp_path / 'sibenik.ply'}: a " in said
    assert "using the stand-in" in said


def test_of_two_originals_it_is_said_which_is_taken(tmp_path, capsys):
    put(tmp_path / "sibenik.obj")
    put(tmp_path / "sibenik.ply")
    assert catalogue.resolve("sibenik", tmp_path).source.file == "sibenik.ply"
    said = capsys.readouterr().err
    assert "sibenik.ply and sibenik.obj are all originals of sibenik; using sibenik.ply" in said


@pytest.mark.parametrize(
    ("size", "said"),
    [(1e-44, "too small for float32"), (9e-39, "too small"), (2e37, "too large"), (1e38, "too large for float32 rays"),
     (1e39, "too large"), (1e300, "too large"), (1.1e-38, ""), (1e37, ""), (np.inf, "")],
)  # fmt: skip
def test_sizes_that_float32_cannot_trace_are_refused(tmp_path, size, said):
    """A corner that is infinite in the file is never hit, and so no error."""
    points = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    points[points > 0] *= size
    path = tmp_path / "sized.npz"
    np.savez(path, V=points, F=np.array([[0, 1, 2], [0, 1, 3]]))
    if said:
        with pytest.raises(UserError, match=said) as refused:
            catalogue.resolve(path)
        assert str(refused.value).endswith("scale it to coordinates between 1e-38 and 1e+37")
    else:
        catalogue.resolve(path)


@pytest.mark.parametrize("size", [1e-38, 1e37])
@pytest.mark.parametrize("method", ["perspective_spherical", "ray_grids", "uniform_grid"])
def test_at_the_ends_of_that_range_answers_are_right(tmp_path, size, method):
    points = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1]]) * size
    path = tmp_path / "sized.npz"
    np.savez(path, V=points, F=np.array([[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3], [1, 2, 4]]))
    prepared = prepare(catalogue.resolve(path))
    moment = prepared.moment(0, 16, 16)
    found = answer(method, {}, prepared, moment, "cpu")
    assert found.answers is not None, found.reason
    assert (found.answers["triangle"] >= 0).sum() > 20
    assert score_answers(Judge.of(prepared, moment, device="cpu"), found.answers).score.true_errors == 0
