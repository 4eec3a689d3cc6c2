"""``shadowbench show``: the same records give the same files, in their folder or elsewhere, and wrong folders are told."""

import re

import pytest
from helpers.experiment_records import write_records
from helpers.table1_records import METHODS, record
from shadowbench.experiments import table1
from shadowbench.harness.commands.show import show
from shadowbench.harness.errors import UserError
from shadowbench.harness.results.schema import newest


@pytest.fixture
def records():
    return [record(scene, method) for scene in ("fairy", "bunny") for method in METHODS]


def test_only_the_newest_record_of_a_point_is_shown(tmp_path):
    old = record("bunny", "warp_bvh", key="old", rounds=[{"round": 0, "noted": 100.0}])
    new = record("bunny", "warp_bvh", seed=1, key="new", rounds=[{"round": 0, "noted": 200.0}])
    other = record("bunny", "embree", rounds=[{"round": 0, "noted": 1.0}])
    write_records(tmp_path, [new, old, other])
    chosen, older = newest(tmp_path)
    assert {made.key for made in chosen} == {"new", other["key"]}
    assert older == 1
    table1.draw(tmp_path, quiet=True)
    assert (
        "older records of these points, or of other scenes of their names: 1." in (tmp_path / "table1.md").read_text()
    )


def test_show_draws_again_and_says_what_is_wrong_with_a_folder(records, tmp_path, capsys):
    write_records(tmp_path, records)
    first = [file.read_bytes() for file in show("table1", tmp_path)]
    assert "Table 1: build, trace and shadow times" in capsys.readouterr().out
    assert [file.read_bytes() for file in show("table1", tmp_path, quiet=True)] == first
    assert capsys.readouterr().out == ""
    for name, folder, said in (
        ("tabel1", tmp_path, "did you mean table1"),
        ("table1", tmp_path / "elsewhere", "no such folder"),
        ("table1", tmp_path / "records", "no records"),
        ("figure2", tmp_path, "its records belong to table1, not to figure2; run shadowbench show table1 "),
    ):
        with pytest.raises(UserError, match=said):
            show(name, folder)


def test_a_folder_that_can_only_be_read_is_drawn_elsewhere(records, tmp_path):
    folder, out = write_records(tmp_path / "kept", records), tmp_path / "out"
    table1.draw(folder, quiet=True)
    before = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    for path in (folder / "table1.md", folder):
        path.chmod(0o555)
    files = show("table1", folder, quiet=True, out=out)
    assert {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()} == before
    assert {file.parent for file in files} == {out}
    for name in ("table1.csv", "table1.md", "table1.svg"):
        assert (out / name).read_bytes() == before[folder / name]
    assert sorted(path.name for path in out.iterdir()) == ["table1.csv", "table1.md", "table1.svg"], "no link stays"
    folder.chmod(0o755)
    (folder / "records" / "torn.json").write_text("{")
    with pytest.raises(UserError, match=re.escape(str(folder / "records" / "torn.json"))):
        show("claims", folder, quiet=True, out=out)
    (folder / "records" / "torn.json").unlink()
    with pytest.raises(UserError, match="has records of its own"):
        show("table1", folder, quiet=True, out=folder)
