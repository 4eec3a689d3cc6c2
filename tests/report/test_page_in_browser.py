"""What a reader does with the page, in a real Chromium. One browser serves all of these tests."""

import json
import re

import pytest
from helpers import browser
from helpers.experiment_records import record_of
from helpers.page_results import GRIDS, HYBRID, MAP, TREE, command, shared_results, write_machine, wrong
from helpers.waiting import until

VIEWS = (
    "overview", "table", "scatter", "curves", "machines", "points", "pictures", "maps", "claims", "drawings",
)  # fmt: skip


SAVED = (
    "window.saved = []; URL.createObjectURL = (blob) => { blob.text().then((t) => saved.push(t)); return 'data:,'; };"
)
webdriver = pytest.importorskip("selenium.webdriver")
ActionChains, Keys = webdriver.ActionChains, webdriver.Keys
pytestmark = pytest.mark.skipif(bool(browser.missing()), reason=browser.missing() or "there is a browser")


@pytest.fixture(scope="module")
def results():
    return shared_results()


@pytest.fixture(scope="module")
def page(request, results):
    if hasattr(request, "param"):
        return request.getfixturevalue(request.param)
    return results / "page.html"


@pytest.fixture(scope="module")
def driver(tmp_path_factory):
    found = browser.start(tmp_path_factory.mktemp("profile"))
    found.get("about:blank")
    for kind in ("browser", "performance"):
        found.get_log(kind)  # what the browser's own first page said and loaded
    yield found
    found.quit()


@pytest.fixture
def visit(driver, page):
    """Open the page at a state, in a window; on leaving, nothing was fetched and nothing was complained about."""

    def go(state="", width=1280, height=900, dark=False):
        browser.look(driver, width, height, dark)
        driver.get("about:blank")
        driver.get(f"file://{page}#{state}")
        settle(driver)
        return driver

    yield go
    assert [entry["message"] for entry in driver.get_log("browser")] == []
    events = [json.loads(entry["message"])["message"] for entry in driver.get_log("performance")]
    asked = {e["params"]["request"]["url"].split("#")[0] for e in events if e["method"] == "Network.requestWillBeSent"}
    assert {url for url in asked if not url.startswith(("data:", "blob:", "about:"))} <= {f"file://{page}"}


VIEW_READY = "const {ready, view} = document.querySelector('main').dataset; return ready === view"


def settle(driver, script=VIEW_READY):
    until(lambda: driver.execute_script(script), script)


def css(driver, selector):
    return driver.find_elements("css selector", selector)


def text_of(driver, selector):
    """Of the first element."""
    return css(driver, selector)[0].text


def texts_of(driver, selector):
    return [element.text for element in css(driver, selector)]


def column(driver, number):
    return texts_of(driver, f".grid tbody tr > :nth-child({number})")


def press(driver, *keys):
    for key in keys:
        ActionChains(driver).send_keys(key).perform()


@pytest.mark.parametrize(("width", "dark"), [(360, True), (1920, False)])
def test_every_view_fits_its_window(visit, width, dark):
    for view in VIEWS:
        found = visit(f"view={view}", width, 900, dark)
        wide, background = found.execute_script(
            "return [document.documentElement.scrollWidth - innerWidth, getComputedStyle(document.body).backgroundColor]"
        )
        assert wide <= 0, view
        assert (sum(map(int, re.findall(r"\d+", background)[:3])) < 200) == dark
        assert len(css(found, "main h2, main p")) > 0


def test_sorting_filtering_and_the_address(visit):
    found = visit("view=points")
    heading = css(found, "thead th button")[3]
    for way in ("ascending", "descending"):
        heading = next(b for b in css(found, "thead th button") if b.text.startswith("frame, ms"))
        heading.click()
        head = next(th for th in css(found, "thead th") if th.text.startswith("frame, ms"))
        assert head.get_attribute("aria-sort") == way
        times = [float(t.split()[0]) for t in column(found, 5) if t[0].isdigit()]
        assert times == sorted(times, reverse=way == "descending")
        assert column(found, 5)[-1] == "rejected", "what has no time is last either way"
    assert "points.sort=total_ms" in found.current_url
    css(found, 'details[data-key="scene"] summary')[0].click()
    next(x for x in css(found, ".options label") if x.text.startswith("Buddha")).click()
    assert set(column(found, 1)) == {"Buddha (stand-in)"}
    before, state = column(found, 2), found.current_url.split("#")[1]
    assert column(visit(state), 2) == before, "the address brings the state back"
    assert column(visit("view=points&q=rejected+map"), 2) == []
    assert len(column(visit("view=points&method=shadow_map&exp=frame_time"), 2)) == 2


def test_times_have_their_errors_their_spread_and_their_origin(visit):
    found = visit("view=table&t=frame_time")
    cells = {cell.text: cell for cell in css(found, ".grid tbody td")}
    assert any(re.fullmatch(r"0.253\s+✗ 7", text) for text in cells), list(cells)
    assert any("†" in text for text in cells), "a record of an earlier version says so"
    ActionChains(found).move_to_element(next(c for t, c in cells.items() if "✗ 7" in t)).perform()
    tip = text_of(found, "#tip")
    assert "quartiles\n0.251 to 0.254 ms" in tip
    assert "✗ 7 wrong" in tip
    assert "stand-in for" in tip
    for state in ("view=overview", "view=points&points.wide=1"):
        cells = [cell.text for cell in css(visit(state), ".grid tbody td")]
        assert "latest here" in cells
        assert "current" not in cells, "the code may have changed since"
    found = visit("view=table&t=table1")
    assert "paper, GTX 280, 1024x1024" in text_of(found, "thead")
    assert "44.47 ms" in text_of(found, "tbody")
    found = visit("view=table&t=frame_time&m=ratio:tree")
    assert any(cell.text.startswith("0.250") for cell in css(found, "tbody td"))


def test_the_first_screen_has_the_finding_and_the_fastest_of_each_kind(visit):
    """What was found, as the ranking says it, is above everything else; each kind has a mark, wrong answers are crossed."""
    found = visit("", 1280, 700)
    lead, chart = css(found, ".lead")[0], css(found, ".kinds")[0]
    assert "the next, tree, takes 4.00 times as long" in lead.text
    assert lead.rect["y"] < chart.rect["y"] < 500
    marks = {mark.get_attribute("aria-label"): mark.get_attribute("class") for mark in css(found, ".kinds .dot")}
    assert {name.split(",")[0] for name in marks} == {"grids", "tree", "map & <b>"}
    assert [name for name, kind in marks.items() if "bad" in kind] == [
        "map & <b>, Cloth (stand-in): 0.253 ms ✗ 7 wrong"
    ]


def test_lines_separate_all_that_differs(visit):
    """Two lights and two spots have the same number of lights and are not one line."""
    found = visit("view=curves&c=effects&x=lights&at=1")
    assert [text.split()[0] for text in column(found, 3)] == ["1.52"]
    found = visit("view=curves&c=figure11&x=light_distance")
    for series in found.execute_script("return document.querySelector('.plot')._plot.data"):
        assert len(series) == 3


def test_errors_stand_against_time_with_the_front(visit):
    found = visit("view=scatter&s=frame_time&ss=Cloth+(stand-in),+64\N{MULTIPLICATION SIGN}64")
    on_it = {row.text.split()[0] for row in css(found, ".split tbody tr") if row.text.endswith("on it")}
    assert on_it == {"map", "grids"}
    left = {mark.get_attribute("aria-label").split(",")[0]: mark.rect["x"] for mark in css(found, ".plane .dot")}
    assert left["map & <b>"] < left["grids"] < left["tree"]
    assert css(found, ".front polyline")


def test_machines_stand_side_by_side(visit):
    found = visit("view=machines")
    heads = texts_of(found, ".grid thead th")
    assert heads == ["scene", "method", "A GPU", "Another GPU"]
    assert any("0.505 ✓ 0.707 ✓" in " ".join(row.text.split()) for row in css(found, ".grid tbody tr"))


def page_of(root, folders):
    """The page of these folders of records; those of the folder b are of another GPU."""
    for name, records in folders.items():
        write_machine(root / name, records, "Another GPU" if name == "b" else "A GPU")
    with pytest.MonkeyPatch.context() as patch:
        assert command(patch, root, "--out", root / "page.html") == 0
    return root / "page.html"


@pytest.fixture(scope="module")
def ties(tmp_path_factory):
    """Two methods that tie and one beside them with wrong answers; one machine has two folders of the experiment."""
    root = tmp_path_factory.mktemp("ties")
    near = record_of("frame_time", MAP, ms=0.503)
    own = {"a": [record_of("frame_time", GRIDS, ms=0.5), record_of("frame_time", HYBRID, ms=0.5005), wrong(near, 3)]}
    own["a-real"] = [record_of("frame_time", GRIDS, "buddha", ms=0.4)]
    own["b"] = [record_of("frame_time", GRIDS, scene, ms=0.7) | {"environment": "b"} for scene in ("cloth", "buddha")]
    return page_of(root, own)


@pytest.mark.parametrize("page", ["ties"], indirect=True)
def test_ties_are_drawn_as_ties_and_no_mark_hides_another(visit):
    found = visit("view=scatter&s=a")
    assert [row.text.split()[-2:] == ["on", "it"] for row in css(found, ".split tbody tr")] == [True, True, False]
    assert len(css(found, ".plane .dot-label")) == 1, "names at one place do not lie on each other"
    found = visit("", 360)
    boxes = [mark.rect for mark in css(found, ".kind-row:first-child .dot")]
    assert len({box["y"] for box in boxes}) == 2
    left = css(found, ".kinds")[0].rect["x"]
    assert all(label.rect["x"] > left for label in css(found, ".kinds .dot-label"))


@pytest.fixture(scope="module")
def near_wins(tmp_path_factory):
    """Two methods that tie on a scene; the slower of them wins on another one. Two of other kinds are near."""
    root = tmp_path_factory.mktemp("near-wins")
    times = (("cloth", GRIDS, 0.5), ("cloth", HYBRID, 0.4995), ("buddha", GRIDS, 0.4), ("buddha", HYBRID, 0.9),
             ("cloth", TREE, 0.501), ("cloth", MAP, 0.502))  # fmt: skip
    return page_of(root, {"a": [record_of("frame_time", entry, scene, ms=ms) for scene, entry, ms in times]})


@pytest.mark.parametrize("page", ["near_wins"], indirect=True)
def test_the_chart_of_the_fastest_has_the_least_times(visit):
    """As the tables have them, whichever of two that tie wins more often; and three marks at one place are three."""
    found = visit("")
    assert text_of(found, ".kinds .dot-label") == "0.504"
    assert len({mark.rect["y"] for mark in css(found, ".kind-row:first-child .dot")}) == 3


@pytest.mark.parametrize("page", ["ties"], indirect=True)
def test_the_folders_of_one_machine_are_one_column(visit):
    found = visit("view=machines")
    assert texts_of(found, ".grid thead th") == ["scene", "method", "A GPU", "Another GPU"]
    assert sorted(column(found, 1)) == ["Buddha (stand-in)", "Cloth (stand-in)"]


def test_a_table_says_how_sure_it_is_and_its_controls_keep_their_names(visit):
    """Disturbed rounds, means over fewer frames and bold stand beside a table and in what is saved of it."""
    found = visit("view=table&t=other/frame_time")
    text = text_of(found, "main")
    assert "2 of 2 rounds were disturbed, the worst by load 9.0 on 2 cores" in text
    assert "2.73 [1/3]" in text
    assert "the mean over 1 of 3 frames" in text
    assert text_of(found, "td.is-best").startswith("0.707")
    labels = [label.text.split("\n")[0] for label in css(found, ".controls label > span")]
    found = visit("view=table&t=other/frame_time&rows=methods")
    assert [label.text.split("\n")[0] for label in css(found, ".controls label > span")] == labels
    assert column(found, 1) == ["grids", "tree"]
    found.execute_script(SAVED)
    css(found, ".savers button")[1].click()
    settle(found, "return saved.length === 1")
    (latex,) = found.execute_script("return saved")
    assert "\\textbf{0.707 " in latex
    assert "rounds were disturbed" in latex


@pytest.mark.parametrize("dark", [False, True])
def test_drawings_follow_the_theme(visit, dark):
    found = visit("view=drawings", dark=dark)
    css(found, "details.figure summary")[0].click()
    settle(found, "return document.querySelector('.drawing img')")
    assert (css(found, ".drawing.lines img")[0].value_of_css_property("filter") != "none") == dark


def test_the_slider_goes_through_distances_and_frames(visit):
    found = visit("view=curves&c=figure11&y=total_ms")
    assert css(found, ".u-over"), "a chart is drawn"
    slider = css(found, "#place")[0]
    places, times = [], []
    for key in (Keys.HOME, Keys.ARROW_RIGHT, Keys.END):
        slider.send_keys(key)
        places.append(text_of(found, ".place output"))
        times.append(float(text_of(found, ".at-place tbody tr:last-child td:last-child").split()[0]))
    assert (places, times) == (["0.1 radii", "1 radius", "10 radii"], sorted(times))
    assert "at=2" in found.current_url
    found = visit("view=curves&c=figure11&x=frame&at=0")
    assert text_of(found, ".place output") == "frame 0"


def test_hovering_a_curve_names_the_nearest_point(visit):
    found = visit("view=curves&c=figure11&y=total_ms&scale=linear")
    x, y, name = found.execute_script(
        "const u = document.querySelector('.plot')._plot;"
        "return [u.valToPos(10, 'x'), u.valToPos(u.data[1][2], 'y'), u.series[1].label]"
    )
    over = css(found, ".u-over")[0]
    ActionChains(found).move_to_element_with_offset(
        over, x - over.rect["width"] / 2 - 3, y - over.rect["height"] / 2 + 2
    ).perform()
    tip = text_of(found, "#tip")
    assert tip.startswith(f"{name} · Cloth (stand-in), 10 radii")
    assert "10 radii" in tip


def test_dragging_zooms_a_logarithmic_chart_and_a_button_shows_all_again(visit):
    found = visit("view=curves&c=figure11&y=total_ms")
    scales = "const {x, y} = document.querySelector('.plot')._plot.scales; return [x.min, x.max, y.min, y.max]"
    whole = found.execute_script(scales)
    drag = ActionChains(found).move_to_element_with_offset(css(found, ".u-over")[0], 20, -60)
    drag.click_and_hold().move_by_offset(70, 70).release().perform()
    left, right, low, high = found.execute_script(scales)
    assert whole[0] < left < right < whole[1]
    assert whole[2] < low < high < whole[3]
    css(found, ".plot + .note button")[0].click()
    assert found.execute_script(scales) == whole


def test_pictures_part_under_a_slider_with_wrong_pixels_marked(visit):
    found = visit("view=pictures")
    assert "acne" in text_of(found, ".legend")
    assert "64" in text_of(found, ".legend")
    pixel = "return [...document.querySelector('.over canvas').getContext('2d').getImageData(1, 1, 1, 1).data]"
    assert found.execute_script(pixel)[:3] == [235, 90, 0]
    slider = css(found, ".under-picture input")[0]
    slider.send_keys(Keys.HOME)
    assert css(found, ".frame")[0].get_attribute("data-cut") == "0"
    assert css(found, ".over")[0].value_of_css_property("clip-path") == "inset(0px 0px 0px 0%)"
    found = visit("view=pictures&plain=1")
    assert found.execute_script(pixel)[:3] == [0, 0, 0]


def test_heat_maps_share_a_scale_and_tell_their_counts(visit):
    found = visit("view=maps&scale=linear")
    assert {(r.text.split()[0], r.text.split()[-1]) for r in css(found, ".split tbody tr")} == {
        ("grids", "300"),
        ("tree", "9"),
    }
    assert css(found, ".ends span")[-1].text == "300"
    frame = css(found, ".frame")[0]
    ActionChains(found).move_to_element(frame).perform()
    first, *lines = text_of(found, "#tip").splitlines()
    x, y = map(int, re.fullmatch(r"pixel (\d+), (\d+)", first).groups())
    told = dict(zip(lines[::2], lines[1::2], strict=True))
    assert told == {name: f"{(16 * y + x) * most // 255} tests" for name, most in (("grids", 300), ("tree", 9))}


def test_the_keyboard_alone_reaches_everything(visit):
    found = visit("view=points")
    names = []
    for _ in range(40):
        press(found, Keys.TAB)
        names.append(found.execute_script(
            "const e = document.activeElement; const o = getComputedStyle(e);"
            "return [e.tagName, e.textContent.slice(0, 20), o.outlineStyle, parseFloat(o.outlineWidth)]"))  # fmt: skip
        if names[-1][0] == "TH":
            break
    reached = {name[0] for name in names}
    assert {"A", "SELECT", "SUMMARY", "INPUT", "BUTTON", "TH"} <= reached
    assert all(style != "none" and width >= 1 for _, _, style, width in names), "the focus is seen everywhere"
    press(found, Keys.ARROW_RIGHT, Keys.ARROW_RIGHT, Keys.ARROW_RIGHT, Keys.ARROW_RIGHT, Keys.ARROW_DOWN)
    assert "whole frame" in text_of(found, "#tip"), "a focused cell shows its spread"
    press(found, Keys.ENTER)
    dialog = css(found, "dialog[open]")[0]
    assert "method's source" in dialog.text
    assert "A GPU" in dialog.text
    press(found, Keys.ESCAPE)
    settle(found, "return !document.querySelector('dialog[open]') && !location.href.includes('point=')")
    found.execute_script("document.querySelector('details.pick summary').focus()")
    press(found, Keys.ENTER, Keys.TAB, Keys.SPACE)
    assert len(css(found, "details.pick[open] input:checked:focus")) == 1, "drawing anew leaves the focus where it was"
    assert "exp=" in found.current_url
    press(found, Keys.ESCAPE)
    assert css(found, "details.pick[open]") == []


def test_what_is_shown_is_saved_as_csv_and_latex(visit):
    found = visit("view=table&t=table1&table.sort=tree:down")
    found.execute_script(SAVED)
    for button in css(found, ".savers button"):
        button.click()
    settle(found, "return saved.length === 2")
    csv, latex = found.execute_script("return saved")
    assert csv.splitlines()[0].startswith("scene,")
    assert '"HBVH (paper, GTX 280, 1024x1024)"' in csv
    assert '"tree, whole frame, ms","tree, wrong answers"' in csv
    assert ",2.02,0," in csv
    assert [line.split(" ")[0] for line in csv.splitlines()[1:]] == ["Buddha", "Cloth"]
    assert "\\toprule" in latex
    assert "Cloth (stand-in)" in latex
    assert latex.count("\\\\") == 4
    assert "\\cmidrule(lr){4-8}" in latex
