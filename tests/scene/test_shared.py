"""A scene that is handed from one worker to others: the frames that are asked for, and always the first."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from shadowbench.harness.commands.run import plan_run, run
from shadowbench.harness.errors import UserError
from shadowbench.harness.files import write_arrays
from shadowbench.harness.results.schema import newest
from shadowbench.harness.runner.planning.experiment import Entry
from shadowbench.harness.runner.progress import Silent
from shadowbench.harness.runner.run import Run
from shadowbench.harness.scene.catalogue import resolve
from shadowbench.harness.scene.facts import contents, scene_facts
from shadowbench.harness.scene.overrides import Lighting
from shadowbench.harness.scene.prepared import prepare
from shadowbench.harness.scene.scene import Geometry
from shadowbench.harness.scene.shared import read_stored, store


def test_the_first_frame_is_always_there(tmp_path: Path) -> None:
    prepared = prepare(resolve("cloth", None))
    middle = prepared.frame_count // 2
    store(tmp_path / "scene.npz", prepared, [middle])
    read = read_stored(tmp_path / "scene.npz", prepared.scene)
    for frame in (0, middle):
        np.testing.assert_array_equal(read.points(frame)[0], prepared.points(frame)[0])
    with pytest.raises(UserError, match=rf"frame 1 was not stored; there are \[0, {middle}\]"):
        read.points(1)


def test_what_moves_together_is_handed_over_and_that_a_mesh_rests(tmp_path: Path) -> None:
    """Methods that keep a tree for each body had one in the worker that made the scene only."""
    rigid = prepare(resolve("balls-3k-moving60", None))
    still = prepare(dataclasses.replace(rigid.scene, geometry=lambda: dataclasses.replace(rigid.geometry, still=True)))
    for prepared in (rigid, still, prepare(resolve("cloth", None))):
        store(tmp_path / "scene.npz", prepared, [])
        read = read_stored(tmp_path / "scene.npz", prepared.scene)
        assert read.moves == prepared.moves
        np.testing.assert_array_equal(read.bodies, prepared.bodies)


@pytest.mark.parametrize(("still", "made"), [(True, 1), (False, 3)])
def test_a_frame_is_made_once_while_a_moment_holds_it_and_a_mesh_at_rest_has_one(still, made, tmp_path: Path) -> None:
    """A moving light over a mesh of a million triangles: 12 equal frames were made three times each, in 40 seconds."""
    asked: list[int] = []
    rigid = resolve("balls-3k-moving60", None)

    def geometry() -> Geometry:
        def positions(frame: int) -> np.ndarray:
            asked.append(frame)
            return whole.positions(0 if still else frame)

        whole = rigid.geometry()
        return dataclasses.replace(whole, positions=positions, still=still)

    prepared = prepare(dataclasses.replace(rigid, geometry=geometry))
    asked.clear()
    moments = [prepared.moment(frame, 4, 4) for frame in (0, 1, 2)]
    scene_facts(prepared, dict(enumerate(moments)))
    store(tmp_path / "scene.npz", prepared, [0, 1, 2])
    assert len(asked) == made + 1  # and the first once more, unrounded, for rules that choose triangles
    with np.load(tmp_path / "scene.npz") as kept:
        assert sum(name.startswith("points_") for name in kept.files) == made
    read = read_stored(tmp_path / "scene.npz", prepared.scene)
    for frame, moment in enumerate(moments):
        np.testing.assert_array_equal(read.points(frame)[0], moment.points)
        np.testing.assert_allclose(read.geometry.positions(frame), prepared.geometry.positions(frame), atol=1e-5)


def test_all_frames_are_there_where_triangles_of_the_first_are_not_valid(tmp_path: Path) -> None:
    """Found on a GPU: Fairy has 4 triangles without area, and its refitted trees of Warp failed where a worker was handed
    the scene: what is valid in no frame is left out of the tree, which asks for every frame.
    """

    def positions(frame: int) -> np.ndarray:
        return np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (2, 0, 0), (2, frame == 1, 0)], dtype=np.float64)

    faces = np.array([(0, 1, 2), (0, 3, 4)], dtype=np.int32)
    scene = dataclasses.replace(resolve("cloth", None), geometry=lambda: Geometry(faces, positions, 3))
    prepared = prepare(scene)
    store(tmp_path / "scene.npz", prepared, [0, 2])
    read = read_stored(tmp_path / "scene.npz", scene)
    assert [read.points(frame)[1].tolist() for frame in range(3)] == [[1, 0], [1, 1], [1, 0]]


def test_rules_choose_the_same_triangles_in_every_process(tmp_path: Path) -> None:
    """Found on a GPU: triangles of all but one size are ordered by what float32 takes from their corners. Workers that
    made the scene and workers that were handed it had different mirrors: 7,929 rays of Fairy counted as wrong.
    """
    random = np.random.default_rng(5)
    x, y = np.meshgrid(np.arange(21.0), np.arange(21.0), indexing="ij")
    corners = np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1)
    corners += 1e-9 * random.normal(size=corners.shape) + (1000.0, 2000.0, 3000.0)
    at = (np.arange(20)[:, None] * 21 + np.arange(20)).ravel()
    faces = np.concatenate([np.stack([at, at + 1, at + 21], 1), np.stack([at + 1, at + 22, at + 21], 1)])
    scene = dataclasses.replace(
        resolve("bunny_dragon", None), geometry=lambda: Geometry.static(corners, faces.astype(np.int32))
    )
    lighting = Lighting("mirror", count=1, bounces=1)
    made = prepare(scene)
    store(tmp_path / "scene.npz", made, [0])
    mirror = lighting.applied(made).mirror
    assert 0 < mirror.sum() < len(mirror)
    np.testing.assert_array_equal(lighting.applied(read_stored(tmp_path / "scene.npz", scene)).mirror, mirror)


def test_other_mirrors_or_holes_are_another_point(tmp_path: Path) -> None:
    """Which triangles a rule chooses is in none of the arrays that everyone gets: a record says it apart."""
    (tmp_path / "grid.obj").write_text(
        "".join(f"v {x} {y} 0\n" for x in (0, 1, 3, 6) for y in (0, 1))
        + "".join(f"f {2 * k + 1} {2 * k + 3} {2 * k + 2}\n" for k in range(3))
    )
    told = []
    for surfaces in ("", "[mirror]\nshare = 0.5", "[mirror]\nshare = 0.9", "[alpha]\nevery = 1", "[alpha]\nevery = 2"):
        (tmp_path / "scene.toml").write_text(f'mesh = "grid.obj"\n{surfaces}\n')
        prepared = prepare(resolve(tmp_path / "scene.toml"))
        told.append(scene_facts(prepared, {0: prepared.moment(0, 8, 8)}))
    assert len({facts["arrays_sha256"] for facts in told}) == 1
    assert "surfaces_sha256" not in told[0]
    assert len({tuple(contents(facts)) for facts in told}) == len(told)


@pytest.mark.slow
def test_every_tree_is_measured_where_only_a_middle_frame_is_asked_for(tmp_path: Path) -> None:
    """Found on a GPU: with one frame of an animation, trees that begin with its first frame did not find that."""
    entries = [
        Entry("accuracy_ladder", {}, "ladder"), Entry("warp_bvh", {}, "rebuilt"),
        Entry("warp_bvh", {"update": "refit"}, "refitted"), Entry("warp_bvh", {"update": "bvh_rebuild"}, "in place"),
    ]  # fmt: skip
    options = plan_run(
        "table1", "quick", "cpu", ["cloth"], out=tmp_path / "out", size="24x24",
        overrides={"frames": 1, "rounds": 1, "samples": 1, "budget_s": 1.0}, score=False,
    )  # fmt: skip
    options = dataclasses.replace(options, preset=dataclasses.replace(options.preset, methods=tuple(entries)))
    records = Run(options, Silent()).go()
    assert [(record.method["label"], record.status) for record in records] == [(entry.label, "ok") for entry in entries]
    assert all(record.frames[0].frame > 0 for record in records)


@pytest.mark.slow
def test_a_run_shows_the_scene_it_was_asked_for(tmp_path: Path) -> None:
    """Declared one way, another way, and the first way again: the third run measures nothing, and shows the first."""
    (tmp_path / "grid.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 4 0 0\nf 1 2 3\nf 2 4 3\n")
    out, shown = tmp_path / "out", []
    for share in (0.5, 0.99, 0.5):
        (tmp_path / "scene.toml").write_text(f'mesh = "grid.obj"\n[mirror]\nshare = {share}\n')
        options = plan_run(
            "table1", "quick", "cpu", [str(tmp_path / "scene.toml")], ["uniform_grid"], out=out, size="8x8",
            overrides={"frames": 1, "rounds": 1, "samples": 1, "budget_s": 0.1}, score=False,
        )  # fmt: skip
        assert run(options, as_json=True) == 0
        records, older = newest(out)
        shown.append(records[0].key)
        assert (len(records), older) == (1, len(set(shown)) - 1)
    assert shown[0] == shown[2] != shown[1]
    assert len(list((out / "records").glob("*.json"))) == 2


def test_what_could_not_be_written_leaves_nothing(tmp_path: Path) -> None:
    class Refusing:
        def __array__(self, *_: object, **__: object) -> np.ndarray:
            raise OSError(28, "No space left on device")

    with pytest.raises(OSError, match="No space left"):
        write_arrays(tmp_path / "a.npz", {"first": np.zeros(1000), "second": Refusing()})  # type: ignore[dict-item]
    assert list(tmp_path.iterdir()) == []
