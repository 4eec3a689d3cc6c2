"""The command line: help, JSON, exit codes, and one line for whatever a person gets wrong."""

import json
import os
import runpy
import shlex
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from shadowbench.harness import cli
from shadowbench.harness.cli import spread_values

ROOT = Path(__file__).parents[2]
COMMANDS = tuple(cli.COMMANDS)


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_has_help_with_an_example(call, command):
    code, out, _ = call(command, "--help")
    assert code == 0
    assert f"shadowbench {command} " in out
    assert "--debug" in out


def test_no_command_shows_help(call):
    _, out, err = call()
    assert all(f"  {command} " in out + err for command in COMMANDS)


WRONG = """
run tabel1 -> no experiment 'tabel1'; did you mean table1?
run table1 --preset quik -> table1 has no preset 'quik'; did you mean quick?
run table1 --scene fary -> no scene or file 'fary'; did you mean fairy?
run table1 --scene nowhere/x.ply -> nowhere/x.ply: no such file
run table1 --method warp_bhv -> no method 'warp_bhv'; did you mean warp_bvh?
run table1 --set warp_bvh.updat=refit -> warp_bvh has no parameter 'updat'; did you mean update?
run table1 --cluster local --device cuda:1 -> every worker has its own card
run table1 --cluster local --dry-run -> the points are known to the workers alone
run key_bits --cluster local -> key_bits runs on this machine alone; leave out --cluster
run table1 --set warp_bvh.leaf_size=many -> warp_bvh.leaf_size='many': not a whole number
run table1 --set update=refit -> --set 'update=refit': write it as method.param=value
run table1 --set warp_bhv.update=refit -> 'warp_bhv' is not one of the methods to run; did you mean warp_bvh?
run table1 --size 256 -> --size '256': write it as WIDTHxHEIGHT
run table1 --size 0x9 -> --size '0x9': write it as WIDTHxHEIGHT
run table1 --rounds 0 -> --rounds 0: must be more than 0
run table1 --rounds 99999999999 -> --rounds 99999999999: must be at most 10,000
run table1 --preset '' -> table1 has no preset ''
run table1 --budget -1 -> --budget -1: must be more than 0
run table1 --budget nan -> --budget nan: must be more than 0 and finite
run table1 --memory-limit -5 -> --memory-limit -5: must be more than 0 bytes
run table1 --device cuda:77 -> no device 'cuda:77' on this machine; it has cpu
run table1 --scene-dir nowhere -> nowhere: no such folder of scenes
verify cloth --camera nan,0,0 0,0,0 -> --camera 'nan,0,0': nan is not a number
verify cloth --light 1e50,0,0 -> --light '1e50,0,0': a number is outside the range of float32
list method -> list 'method': unknown kind; did you mean methods?
list methods warp_bhv -> no method 'warp_bhv'; did you mean warp_bvh?
list experiments tabel1 -> no experiment 'tabel1'; did you mean table1?
show table2 . -> no experiment 'table2'; did you mean table1?
show table1 nowhere -> nowhere: no such folder
render cloth --method warp_bvh --out a.gif -> --out a.gif: pictures are PNG files
render clot --method warp_bvh --out a.png -> no scene or file 'clot'; did you mean cloth?
run table1 --size 100000x1 -> --size 100000x1: a side has at most 99,999 pixels; give fewer
run table1 --size 99999x99999 -> more than the 2,147,483,647 that can be indexed; give fewer
plan cloth --size 99999x99999 -> more than the 2,147,483,647 that can be indexed; give fewer
verify cloth --size 99999x99999 -> more than the 2,147,483,647 that can be indexed; give fewer
explain cloth --pixel 1,1 --size 99999x99999 -> more than the 2,147,483,647 that can be indexed; give fewer
render cloth --out a.png --size 99999x99999 -> more than the 2,147,483,647 that can be indexed; give fewer
"""
"""Command lines, and what is said of them."""


@pytest.mark.parametrize("line", WRONG.strip().splitlines())
def test_a_wrong_call_is_one_line_and_exit_2(refused_call, line):
    arguments, said = line.split(" -> ")
    err = refused_call(*shlex.split(arguments))
    assert said in err
    assert err.startswith("shadowbench: ")


def test_debug_shows_where_it_came_from(monkeypatch):
    monkeypatch.setattr(sys, "argv", ["shadowbench", "list", "nothing", "--debug"])
    monkeypatch.setenv(cli.DEBUG, "")
    with pytest.raises(cli.UserError, match="unknown kind"):
        cli.main()


@pytest.mark.parametrize(("error", "code", "said"), [
    (KeyboardInterrupt(), cli.INTERRUPTED, "shadowbench: interrupted; run the same command again to continue\n"),
    (MemoryError("1 EiB"), 2, "not enough memory (1 EiB); choose a smaller --size or scene"),
    (OSError(28, "No space left on device", "/a/file"), 2, "/a/file: No space left on device"),
])  # fmt: skip
def test_what_ends_a_run_is_one_line(call, monkeypatch, scene, tmp_path, error, code, said):
    """Through the whole command line: typer swallows the interruption of a command."""
    monkeypatch.setattr("shadowbench.harness.commands.run.Run.go", lambda *_: raised(error))
    found, out, err = call("run", "table1", "--scene", scene, "--method", "warp_bvh", "--out", tmp_path / "out")
    assert (found, out, err.count("\n")) == (code, "", 1)
    assert said in err


def raised(error):
    raise error


def test_run_show_and_json(call, scene, tmp_path):
    out_folder = tmp_path / "out"
    options = (
        "--method warp_bvh embree --set embree.threads=1 --preset quick --size 16x12 --rounds 1 --samples 2 --no-score"
    )
    arguments = ["run", "table1", "--scene", scene, *options.split(), "--out", out_folder, "--json"]
    code, out, err = call(*arguments)
    report = json.loads(out)
    assert (code, err) == (0, "")
    assert [(p["method"], p["status"], p["samples"]) for p in report["points"]] == [
        ("warp_bvh", "ok", 2),
        ("embree", "ok", 2),
    ]
    assert (report["points"][1]["built"]["threads"], {p["width"] for p in report["points"]}) == (1, {16})
    for file in report["files"]:
        assert (tmp_path / file).stat().st_size > 0
    records = sorted((out_folder / "records").iterdir())
    before = [path.read_bytes() for path in records]
    table = out_folder / "table1.csv"
    table.unlink()
    code, out, _ = call("show", "table1", out_folder, "--json")
    assert code == 0
    assert str(table) in json.loads(out)["files"]
    assert [path.read_bytes() for path in records] == before


def test_an_unwritable_folder_is_refused(refused_call, scene, tmp_path):
    (tmp_path / "file").write_text("")
    err = refused_call("run", "table1", "--scene", scene, "--method", "warp_bvh", "--out", tmp_path / "file" / "out")
    assert f"{tmp_path / 'file'} is a file; name a folder" in err


@pytest.mark.parametrize(("given", "read"), [
    ("run table1 --scene a b --json", "run table1 --scene a --scene b --json"),
    ("run table1 --method a --set a.b=1 a.c=2", "run table1 --method a --set a.b=1 --set a.c=2"),
    ("run --scene a table1", "run --scene a table1"),
    ("run table1 --out x --scene a", "run table1 --out x --scene a"),
    ("verify a b --method c d --json", "verify a b --method c --method d --json"),
    ("list methods --json", "list methods --json"),
])  # fmt: skip
def test_several_values_after_one_flag(given, read):
    assert spread_values(given.split()) == read.split()


def test_two_scenes_of_one_name_are_refused(refused_call, tmp_path):
    files = [tmp_path / folder / "model.obj" for folder in ("a", "b")]
    for file in files:
        file.parent.mkdir()
        file.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    err = refused_call("run", "table1", "--scene", files[0], "--scene", files[1], "--out", tmp_path / "out")
    assert f"{files[1]}: has the same name as {files[0]}" in err


def test_the_package_runs_as_a_module_and_states_its_version(monkeypatch, capsys):
    """Once as a process of its own; then as Python runs a module, in this process."""
    import shadowbench

    declared = tomllib.loads((ROOT / "pyproject.toml").read_text())
    assert declared["tool"]["setuptools"]["dynamic"]["version"] == {"attr": "shadowbench.__version__"}
    version = f"shadowbench {shadowbench.__version__}\n"
    command = [sys.executable, "-m", "shadowbench", "--version"]
    assert subprocess.run(command, capture_output=True, text=True).stdout == version

    def said(module, *words):
        with monkeypatch.context() as patched:
            patched.setattr(sys, "argv", [module, *words])
            patched.delitem(sys.modules, module, raising=False)
            with pytest.raises(SystemExit) as stopped:
                runpy.run_module(module, run_name="__main__", alter_sys=True)
        assert not stopped.value.code
        return capsys.readouterr().out

    assert said("shadowbench.harness.cli", "--version") == version
    assert "table1" in said("shadowbench.__main__", "list", "experiments")


def test_completion_is_installed_and_completes_names(tmp_path):
    """In a home of its own. The shell's detection is left out: a test may run without one."""
    program = "import sys; sys.argv[0] = 'shadowbench'; from shadowbench.harness.cli import main; main()"

    def said(*words, **environment):
        known = {**os.environ, "HOME": str(tmp_path), "_TYPER_COMPLETE_TEST_DISABLE_SHELL_DETECTION": "1"}
        start = [sys.executable, "-c", program, *words]
        done = subprocess.run(start, env={**known, **environment}, capture_output=True, text=True, timeout=120)
        return done.stdout

    assert "bash completion installed" in said("--install-completion", "bash")
    script = (tmp_path / ".bash_completions" / "shadowbench.sh").read_text()
    assert "complete -o default -F _shadowbench_completion shadowbench" in script
    asked = {"_SHADOWBENCH_COMPLETE": "complete_bash", "COMP_CWORD": "4"}
    found = said(**asked, COMP_WORDS="shadowbench run table1 --method ray")
    assert found.split() == ["ray_grids"]
