"""An experiment's report: one sentence of finding, tables, what was not measured, and the pictures."""

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple
from urllib.parse import quote

from ..frame.cards import UNITS
from ..results.means import points
from ..results.schema import folders_with_records, place_name
from ..results.table import TEXTS, samples, stage_ms, tidy
from ..results.throttled import disturbances
from ..scene.facts import Notice, never_hit
from ..texts import for_markdown, numbered
from . import compare, numbers, style
from . import paper_table1 as paper
from .compare import pass_spread, spread
from .dataframe import DataFrame, Series, pd
from .terminal import make_console, print_table

COMMON = (  # columns that every CSV of an experiment begins with
    "scene scene_title stand_in triangles method label settings device device_name width height preset status reason "
    "light_label light_count light_distance build_ms trace_ms light_build_ms shadow_ms total_ms iqr_ms between_ms "
    "frames samples true_errors unscored environment key"
).split()
FEW = 3  # number of points up to which each is named
NO_RECORD = "no record"  # status of points that a stopped run did not reach


def with_passes(table: DataFrame, folder: Path, passes: Mapping[str, tuple[str, str]]) -> DataFrame:
    """The points with NAME_ms, NAME_spread and NAME_text of passes: {name: (part of the frame, pattern of their names)}."""
    repeats = samples(folder)
    for name, which in passes.items():
        ms, around = stage_ms(table, *which), pass_spread(repeats, *which).reindex(table["key"])
        made = {f"{name}_ms": ms, f"{name}_spread": around, f"{name}_text": numbers.carry(ms, around, numbers.TIME)}
        table = table.assign(**made)
    return table


def cross_table(table: DataFrame, rows: Sequence[str] | Mapping[str, str], columns: str, value: str) -> DataFrame:
    """``value`` with ``rows`` down (columns, or {column: heading}) and ``columns`` across; of several in a cell the last."""
    down = list(rows)
    wide = table.groupby([*down, columns], sort=False, dropna=False)[value].last().unstack(columns)
    order = table[down].drop_duplicates().set_index(down).index
    wide = wide.reindex(index=order, columns=table[columns].unique()).rename_axis(columns=None).reset_index()
    return wide.rename(columns=dict(rows)) if isinstance(rows, Mapping) else wide


def frames(folder: Path | str) -> DataFrame:
    """The tidy table of a folder in the order of tables: the paper's scenes, then others; methods as registered."""
    return in_order(tidy(folder))


class Source(NamedTuple):
    """A folder of results in a tree of them: what it is called there, where it is, and its :func:`frames`."""

    name: str
    path: Path
    frames: DataFrame


def sources(folder: Path) -> list[Source]:
    """Every results folder in a folder. Raises :class:`.errors.UserError` where there is none."""
    named = [(place_name(place, folder), place) for place in folders_with_records(folder)]
    return [Source(name, place, frames(place).assign(folder=name)) for name, place in named]


def read(folder: Path | str) -> DataFrame:
    """The points of a folder (:func:`named`), in the order of :func:`frames`."""
    return named(frames(folder))


def arranged(table: DataFrame, column: str, order: Sequence[Any]) -> DataFrame:
    """The rows sorted by the place of a column's values in ``order``, then other values; otherwise as they are."""
    places = {value: i for i, value in reversed(list(enumerate(order)))}
    return table.sort_values(column, key=lambda own: own.map(places).fillna(len(order)), kind="stable")


def in_order(table: DataFrame) -> DataFrame:
    """The rows in the order of tables."""
    table = table.sort_values(["scene_title", "label", "device", "key", "frame"], ignore_index=True)
    table = arranged(table, "method", style.in_order(table["method"]))
    table = arranged(table.sort_values("scene", kind="stable"), "scene", list(paper.ROWS))
    return table.reset_index(drop=True)


def named(table: DataFrame) -> DataFrame:
    """The points of a tidy table (:func:`.results.means.points`), with their keys as index. Besides:

    title        the scene's, with "(stand-in)" where it is one, and with the size of the image where there are several
    spread, ms   see :func:`.report.compare.spread`; the time of the frame as text, with the digits that it carries, marked
                 where it is a mean over fewer frames than others of the scene
    file         a name for the scene's files: with the size too where there are several
    error        :func:`.report.numbers.check_text`: a tick, how many answers are wrong, or "unscored"
    light_count  the column ``lights``, as every CSV calls it
    """
    table = points(table)
    table.index = table["key"].rename(None)
    sizes = table["width"].astype(str) + "x" + table["height"].astype(str)
    several, around = int(sizes.nunique() > 1), spread(table)
    apart = (table["stand_in"] != "") & ~table["scene_title"].str.contains("stand-in")
    title = table["scene_title"] + apart.map({True: " (stand-in)", False: ""})
    scene = ["folder", *compare.LIT_SCENE, *compare.SIZE]
    beside = table.groupby(scene, sort=False, dropna=False)["frames"].transform("max")
    ms = numbers.of_frames(numbers.carry(table["total_ms"], around, numbers.TIME), table["frames"], beside)
    rows = table[["true_errors", "check", "excused_share"]].to_dict("records")
    return table.assign(
        title=title + (", " + sizes) * several, file=table["scene"] + ("-" + sizes) * several, spread=around,
        ms=ms, light_count=table["lights"], error=list(map(numbers.check_text, rows)),
    )  # fmt: skip


def write_csv(table: DataFrame, path: Path, columns: Sequence[str]) -> Path:
    """The columns as CSV: numbers with six digits, whole numbers without decimals; unknown values are empty."""
    own = table.reindex(columns=columns).convert_dtypes()
    own.to_csv(path, index=False, float_format="%.6g", lineterminator="\n")
    return path


def markdown(table: DataFrame) -> list[str]:
    """A table of texts in Markdown: its index is not shown; missing values are dashes."""
    texts = table.astype(object).where(table.notna(), "-").astype(str)
    lines = [[str(name) for name in table.columns], ["---"] * len(table.columns), *texts.to_numpy().tolist()]
    return ["| " + " | ".join(for_markdown(cell).replace("|", "\\|") for cell in line) + " |" for line in lines]


def measured(table: DataFrame) -> DataFrame:
    """The points that have a time."""
    return table[(table["status"] == "ok") & table["total_ms"].notna()]


def complete(table: DataFrame, apart: Collection[str] = ()) -> DataFrame:
    """The points, and a row with the status :data:`NO_RECORD` for each that a stopped run did not reach, scene after scene.

    Other scenes, sizes and lights show what is missing. ``apart``: lightings at which only some points are measured.
    """
    planned, place = table[~table["light_label"].isin(apart)], ["title", "light_label", "width", "height"]
    same = "scene scene_title stand_in file lights light_count light_distance pixels".split()
    whose = "label method method_title settings device device_name".split()
    every = planned.drop_duplicates(place)[[*place, *same]]
    every = every.merge(planned.drop_duplicates("label")[whose], how="cross")
    known = planned.set_index([*place, "label"]).index
    missing = every[~every.set_index([*place, "label"]).index.isin(known)]
    if missing.empty:
        return table
    empty = {column: "" for column in (*TEXTS, "error") if column not in missing}
    whole = pd.concat([table, missing.assign(**{**empty, "status": NO_RECORD})], ignore_index=True)
    return arranged(arranged(whole, "label", table["label"].unique()), "title", table["title"].unique())


def lost(table: DataFrame, apart: Collection[str] = ()) -> DataFrame:
    """The points without a time, and a row for each without a record (see :func:`complete`); ``why``: status and reason."""
    rows = complete(table, apart)
    rows = rows[(rows["status"] != "ok") | rows["total_ms"].isna()]
    reasons = rows["reason"].where((rows["reason"] != "") | (rows["status"] == NO_RECORD), "no reason given")
    return rows.assign(why=rows["status"].where(reasons == "", rows["status"] + ": " + reasons))


def not_measured(table: DataFrame, apart: Collection[str] = ()) -> list[str]:
    """The points without a time, one line per reason."""
    rows = lost(table, apart)
    groups = rows["title"].groupby([with_light(rows, "label"), rows["why"]], sort=False).unique()
    return [f"{name}: {reason} ({', '.join(titles)})" for (name, reason), titles in groups.items()]


def write(
    folder: Path, experiment: Any, table: DataFrame, columns: Sequence[str], finding: str,
    tables: Mapping[str, DataFrame], pictures: Sequence[Path | None], quiet: bool, notes: Sequence[str] = (), *,
    rows: DataFrame | None = None, apart: Collection[str] = (),
) -> list[Path]:  # fmt: skip
    """Write ``EXPERIMENT.csv`` and ``EXPERIMENT.md``, print the report unless ``quiet``; return every file written.

    table    the points behind the report, for where they ran, how long, and what is known of their answers
    columns  of the CSV: of ``table``, or of ``rows``
    tables, notes  what stands under each heading; lines below. ``apart``: see :func:`not_measured`
    """
    name, files = experiment.name, [picture for picture in pictures if picture]
    csv = write_csv(table if rows is None else rows, folder / f"{name}.csv", columns)
    shown = {heading: body for heading, body in tables.items() if len(body)}
    cells = [str(cell) for body in shown.values() for cell in body.to_numpy().ravel()]
    about = numbers.meanings([finding, *cells])
    about += [*notes, *validity(table), errors(table)]
    missing = not_measured(table, apart)
    measured_on = "; ".join(filter(None, [where(table), disturbances(folder)]))
    text = [f"# {experiment.title}", "", for_markdown(finding), "", for_markdown(f"{measured_on}."), ""]
    for heading, body in shown.items():
        text += [f"## {for_markdown(heading)}", "", *markdown(body), ""]
    text += [for_markdown(f"{line}\n") for line in about]
    text += ["Not measured:", "", *(for_markdown(f"- {line}") for line in missing), ""] if missing else []
    path, kept = folder / f"{name}.md", sorted(folder.glob("*.png"))
    # Pictures of an earlier drawing stay, because the files that they were drawn from may have been removed.
    drawn = [file.name for file in files if file.suffix in (".svg", ".png")]
    drawn += [file.name for file in kept if file.name.startswith((name, "gallery"))]
    text += [f"![{Path(file).stem}]({quote(file)})" for file in dict.fromkeys(drawn)]
    path.write_text("\n".join(text).rstrip() + "\n", encoding="utf-8")
    if not quiet:
        console = make_console()
        console.print(f"{experiment.title}; {measured_on}\n  {finding}")
        for heading, body in shown.items():
            print_table(body, heading, console)
        for line in [*about, *(["Not measured: " + "; ".join(missing)] if missing else [])]:
            console.print("  " + line.replace(r"\*", "*"))
    return [csv, *files, path]


def validity(table: DataFrame) -> list[str]:
    """What a reader must know of the points behind a table before comparing them; a line each."""
    lines = []
    for column, read in (("view", ""), ("left_out", ", as read")):  # by scene; what of its file was left out
        known = table[table[column] != ""].groupby("title", sort=False)[column].unique()
        lines += [f"{title}{read}: {' | '.join(found)}." for title, found in known.items()]
    built = table["built"].astype(str)  # by Vulkan the adapter traces, and not the device of the arrays
    whose = built.str.extract(rf"\badapter (.+), {UNITS} ", expand=False).fillna(table["device_name"])
    told = table.assign(whose=whose, units=built.str.extract(rf"{UNITS} (\w+)", expand=False)).dropna(subset=["units"])
    lines += [
        f"{UNITS.capitalize()} of {own.whose}: {own.units}."
        for own in told.drop_duplicates(["whose", "units"]).itertuples()
    ]
    return list(filter(None, [*lines, *compare.apart(table), effort(table)]))


def where(table: DataFrame) -> str:
    """Size and device of points, as a phrase: "256x256 on AMD EPYC"."""
    by_size = table.sort_values("pixels")
    sizes = (by_size["width"].astype(str) + "x" + by_size["height"].astype(str)).unique()
    return f"{', '.join(sizes)} on {' and '.join(table['device_name'].unique())}"


def effort(table: DataFrame) -> str:
    """How long the points were sampled, where they say so, as a sentence."""
    asked = table.reindex(columns=["point.rounds", "point.budget_s"]).dropna().drop_duplicates().to_numpy()
    form = "{}, at most {:g} s of samples per point"
    told = " and ".join(form.format(numbered(int(n), "round"), budget) for n, budget in asked)
    if not told:
        return ""
    short = table[(table["rounds"] > 0) & (table["rounds"] < table["point.rounds"])]
    counts = zip(names(short), short["rounds"], short["point.rounds"], strict=True)
    less = [f"{name}: {n:.0f} of {of:.0f}" for name, n, of in counts]
    if len(less) > FEW:
        return f"{told}. The budget of {len(less)} of {len(table)} points was spent before their last round."
    return f"{told}." + f" The budget was spent before the last round: {'; '.join(less)}." * bool(less)


def with_light(table: DataFrame, column: str) -> Series:
    """A column of texts, and the lighting where it has a name."""
    light = table["light_label"].astype("str")
    return table[column].astype("str") + (", " + light).where(light != "", "")


def names(table: DataFrame) -> Series:
    """What each point is called in a sentence: scene, method, and lighting where it has a name."""
    return table["title"] + ", " + with_light(table, "label")


def listed(texts: Sequence[str], most: int = 6) -> str:
    """The first texts of a list, and how many more there are."""
    return "; ".join([*texts[:most], *[f"and {len(texts) - most} more (see the CSV)"] * (len(texts) > most)])


def errors(table: DataFrame) -> str:
    """The correctness of the answers behind the times, as a sentence."""
    done = measured(table)
    bad = (names(done) + ": " + done["error"])[done["error"] != numbers.OK].tolist()
    bad += [f"{title}: {notice}." for title, notice in unseen(table) if notice.warns]
    return f"Answers: {listed(bad)}." if bad else "Every answer behind these times was found right."


def never_hit_notes(table: DataFrame) -> list[str]:
    """One line per scene with triangles that are never hit: right answers there are misses."""
    return [f"{title}: {notice}." for title, notice in unseen(table)]


def unseen(table: DataFrame) -> list[tuple[str, Notice]]:
    """The title of each scene with triangles that are never hit, and what is to be said of it."""
    known = table.dropna(subset=["triangles"]).drop_duplicates("title")
    known = known[["title", "triangles", "invalid_triangles"]].to_numpy()
    found = [(title, never_hit(int(total), int(total - invalid))) for title, total, invalid in known]
    return [(title, notice) for title, notice in found if notice]
