"""The methods of a scene sorted by time, and what is said of the fastest."""

import pytest
from helpers.experiment_records import record_of, write_records
from shadowbench.harness.report import document, ranking
from shadowbench.harness.runner.planning.experiment import Entry
from shadowbench.harness.scene.overrides import Lighting


def made(label, ms, wrong=0, scene="cloth", inexact="", **changes):
    record = record_of("trial", Entry("bvh2", {}, label), scene, ms=ms, **changes)
    record["method"]["known_inexact"] = inexact
    for frame in record["frames"]:
        if wrong is None:
            frame |= {"score": None, "unscored": "no reference"}
        else:
            frame["score"]["true_errors"] = wrong
    return record


def ranked(folder, *records):
    return ranking.ranked(document.frames(write_records(folder, records)))


def building(table, words):
    """The table with what each method builds in a frame, by label."""
    return table.assign(in_each_frame=table["label"].map(words))


def said(folder, *records):
    return ranking.finding(ranked(folder, *records))


def test_rows_are_sorted_by_time_with_errors_memory_and_what_is_rebuilt(tmp_path):
    table = ranked(tmp_path, made("slow", 4.0), made("loose", 1.0, 7), made("good", 2.0))
    (heading, rows), *others = ranking.tables(building(table, {"good": "rebuilds its tree"})).items()
    assert not others
    assert heading == "Cloth (stand-in), fastest first"
    assert list(rows) == ["method", "ms", "ratio", "answers", "memory, MB", "in each frame"]
    assert rows.to_numpy().tolist() == [
        ["loose", "1.01", "0.500", "✗ 7 wrong", "0.0", "-"],
        ["good", "2.02", "1.00", "✓", "0.0", "rebuilds its tree"],
        ["slow", "4.04", "2.00", "✓", "0.0", "-"],
    ]


def test_one_sentence_for_the_exact_and_one_for_all(tmp_path):
    text = said(tmp_path, made("slow", 4.0), made("loose", 1.0, 7), made("good", 2.0))
    assert text == (
        "Cloth (stand-in): the fastest exact method is good with 2.02 ms a frame; the next, slow, takes 2.00 times as long. "
        "The fastest of all is loose with 1.01 ms: 7 of its answers are wrong."
    )


@pytest.mark.parametrize(("others", "end"), [
    ([made("tree", 2.001)], "tree with 2.02 ms is as fast within the spread of the repeats. No inexact method "
     "is faster."),
    ([], "no other exact method was measured. No inexact method is faster."),
    ([made("one", 1.0, 1)], "The fastest of all is one with 1.01 ms: 1 of its answers is wrong."),
    ([made("unknown", 1.0, None)], "The fastest of all is unknown with 1.01 ms: its answers were not scored."),
    ([made("float", 1.0, inexact="float32")], "none of its answers is wrong here, which it does not promise elsewhere."),
])  # fmt: skip
def test_what_is_near_alone_or_unknown_is_said_so(tmp_path, others, end):
    text = said(tmp_path, made("good", 2.0), *others)
    assert text.startswith("Cloth (stand-in): the fastest exact method is good with 2.02 ms a frame; ")
    assert text.endswith(end)


def test_a_method_with_wrong_answers_is_never_called_exact(tmp_path):
    text = said(tmp_path, made("good", 2.0, 3), made("unknown", 1.0, None))
    assert text.startswith("Cloth (stand-in): no method is known to have answered exactly.")


def test_of_many_scenes_it_says_how_often_each_wins(tmp_path):
    scenes = ("cloth", "fairy", "sibenik")
    records = [made("a", 1.0 + 2.0 * (scene == "fairy"), scene=scene) for scene in scenes]
    records += [made("b", 2.0, scene=scene) for scene in scenes]
    assert said(tmp_path / "exact", *records) == (
        "Trees are the fastest on all 3 scenes, with every answer right: a on 2, b on 1."
    )
    text = said(tmp_path / "wrong", *records, made("c", 0.5, 9, "cloth"))
    assert text.endswith("c on Cloth (stand-in) takes the least: 0.500 times as long, and 9 of its answers are wrong.")


def of_method(method, record):
    record["method"]["name"] = method
    return record


def test_of_many_scenes_kinds_come_before_settings(tmp_path):
    """Whoever wins: the same numbers, swapped between two methods, swap their names in the sentence."""
    times = {"cloth": (1.0, 1.5), "fairy": (2.0, 1.0), "sibenik": (1.0, 4.0)}

    def both(one, other):
        records = [made(one[0], ms, scene=scene) for scene, (ms, _) in times.items()]
        records += [made(other[0], ms, scene=scene) for scene, (_, ms) in times.items()]
        methods = [one[1]] * 3 + [other[1]] * 3
        return [of_method(method, record) for method, record in zip(methods, records, strict=True)]

    tree, grid, own = ("BVH2", "bvh2"), ("ray grids", "ray_grids"), ("mine", "my_method")
    form = (
        "{} the fastest on 2 of 3 scenes, {} on 1, with every answer right: {} on 2, {} on 1. The nearest exact one of "
        "another kind, {} on Cloth (stand-in), takes 1.50 times as long; on Sibenik (stand-in) the nearest, {}, 4.00."
    )
    assert said(tmp_path / "tree", *both(tree, grid)) == form.format(
        "Trees are", "grids of rays", "BVH2", "ray grids", "ray grids", "ray grids"
    )
    assert said(tmp_path / "grid", *both(grid, tree)) == form.format(
        "Grids of rays are", "trees", "ray grids", "BVH2", "BVH2", "BVH2"
    )
    assert said(tmp_path / "own", *both(own, tree)).startswith("mine is the fastest on 2 of 3 scenes, trees on 1, with")
    assert ranking.headline(ranked(tmp_path / "one", *both(grid, tree))) == (
        "Grids of rays are the fastest on 2 of 3 scenes, trees on 1, with every answer right; the nearest exact structure "
        "of another kind takes 1.50 to 4.00 times as long."
    )


@pytest.mark.parametrize("first", ["ray grids", "BVH2"])
def test_what_ties_is_told_in_order_of_speed(first):
    words = {"ray grids": ("Grids of rays", "ray_grids"), "BVH2": ("Trees", "bvh2")}
    (then,) = words.keys() - {first}
    wins = [{label: words[label][1] for label in order} for order in ([then, first], [first, then], [then, first])]
    text = ranking.most_wins(wins, [{first: 1.0, then: 1.02}, {first: 5.0, then: 5.3}, {first: 9.1, then: 9.0}], 3)
    assert text == (
        f"{words[first][0]} are the fastest on all 3 scenes, {words[then][0].lower()} on 3, with every answer right: "
        f"{first} on all, {then} on all (ties count for each)."
    )


def test_of_one_scene_nothing_is_counted():
    one, both = {"BVH2": "bvh2"}, {"BVH2": "bvh2", "ray grids": "ray_grids"}
    times = [{"BVH2": 2.0, "ray grids": 2.1}]
    assert ranking.most_wins([one], times, 1) == "Trees are the fastest on the scene, with every answer right: BVH2."
    assert ranking.most_wins([both], times, 1) == (
        "Trees are the fastest on the scene, grids of rays too, with every answer right: BVH2, ray grids (ties count for "
        "each)."
    )
    assert ranking.most_wins([one], times, 2).startswith("Trees are the fastest on 1 of 2 scenes, with"), (
        "no winner on one"
    )


def test_lights_and_scenes_are_never_ranked_together(tmp_path):
    four = Lighting("4 lights", count=4)
    table = ranked(tmp_path, made("a", 1.0), made("b", 3.0, lighting=four), made("a", 2.0, lighting=four))
    assert {heading: list(rows["ratio"]) for heading, rows in ranking.tables(building(table, {})).items()} == {
        "Cloth (stand-in), fastest first": ["1.00"],
        "Cloth (stand-in), 4 lights, fastest first": ["1.00", "1.50"],
    }


def test_what_is_not_built_for_what_has_moved_is_said(tmp_path):
    moved = Lighting("the camera moves", moved="camera")
    idle = made("tree", 1.0, lighting=moved, passes=[("primary rays", "trace", 1.0)])
    busy = made("grid", 2.0, lighting=moved, passes=[("cells", "build", 1.0), ("primary rays", "trace", 1.0)])
    words = {"tree": "rebuilds its tree", "grid": "rebuilds its grid"}
    (rows,) = ranking.tables(building(ranked(tmp_path, idle, busy), words)).values()
    assert list(rows["in each frame"]) == ["builds nothing", "rebuilds its grid"]


def test_nothing_measured_is_said(tmp_path):
    table = ranked(tmp_path, made("a", 1.0, status="failed"))
    assert ranking.finding(table) == ranking.headline(table) == "Nothing was measured."
