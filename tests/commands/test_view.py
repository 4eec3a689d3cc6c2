"""The live page: what it shows is what ``render`` shows, nobody comes in without the token, and it ends with the page."""

import http.client
import io
import itertools
import json
import re
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest
import uvicorn
import websocket
from helpers import browser
from helpers.tiny_runs import TETRAHEDRON
from helpers.waiting import until
from PIL import Image
from shadowbench.harness.commands.answering import default_method
from shadowbench.harness.commands.options import view_of
from shadowbench.harness.commands.render import opened
from shadowbench.harness.commands.view import view
from shadowbench.harness.commands.viewer.frames import Frames, Wish
from shadowbench.harness.commands.viewer.server import Server, listen
from shadowbench.harness.errors import UserError
from shadowbench.harness.files import array_hash
from shadowbench.harness.frame.session import Session
from shadowbench.harness.runner.machine.lock import LOWEST, MachineLock
from shadowbench.harness.scene.catalogue import resolve
from shadowbench.harness.scene.prepared import prepare

SIZE = (48, 32)
METHOD, OTHER = "embree", "uniform_grid"
ROOM = "".join(f"v {x} {y} {z}\n" for x in (-3, 3) for y in (-0.2, 4) for z in (-3, 3)) + "".join(
    f"f {face}\n" for face in ("5 6 8 7", "9 10 12 11", "5 6 10 9", "7 8 12 11", "5 7 11 9", "6 8 12 10")
)
FLOOR = "v -3 -0.2 -3\nv 3 -0.2 -3\nv 3 -0.2 3\nv -3 -0.2 3\nf 5 6 7\nf 5 7 8\n"


@pytest.fixture
def scene(tmp_path):
    """A tetrahedron that casts a shadow."""
    path = tmp_path / "tetra.obj"
    path.write_text(TETRAHEDRON + FLOOR)
    return str(path)


def view_like(facts):
    """The options that the page gives of a frame, as a command reads them."""
    words = facts["options"].split()
    lights = [words[i + 1] for i, word in enumerate(words) if word == "--light"]
    area = dict(itertools.pairwise(words))
    size, samples = area.get("--light-size"), area.get("--light-samples")
    return view_of(
        (words[1], words[2]), None, lights, light_size=size and float(size), light_samples=samples and int(samples)
    )


def made_by_render(scene, facts):
    """What ``render`` makes its picture with, given the options that the page has copied."""
    described = view_like(facts).resolved(scene)
    return opened(scene, described, facts["method"], tuple(facts["size"]), "cpu")


def rendered(scene, facts):
    """The hash of the answers that ``render`` makes its picture from."""
    made = made_by_render(scene, facts)
    answers = made.session.answers(made.prepared.moment(0, *facts["size"]))
    return array_hash(answers["triangle"], answers["shadowed"])


def test_partial_frames_have_the_bits_of_render(scene):
    frames = Frames(prepare(resolve(scene)), "cpu")
    light, camera = (-1.5, 1.25, -2.0), ((1.5, 1.0, 2.5), (0.0, 0.25, 0.0))
    hashes = []
    for wish in (
        Wish(METHOD, SIZE),
        Wish(METHOD, SIZE, light=light),
        Wish(METHOD, SIZE, light=light, camera=camera),
        Wish(OTHER, SIZE, light=light, camera=camera, show="tests", judge=True, beside=METHOD),
    ):
        facts, picture = frames.show(wish)
        assert picture.startswith(b"RIFF")
        assert facts["answers"] == rendered(scene, facts)
        hashes.append((facts["answers"], facts["changed"]))
        if wish == Wish(METHOD, SIZE):
            assert all(stage["first"] and stage["ran"] for stage in facts["stages"]), "kernels are loaded"
    assert len({found for found, _ in hashes}) == 3, "the light, then the camera, changed the answers"
    assert hashes[1][1] == ["light/0"]
    assert hashes[2][0] == hashes[3][0], "two exact methods"
    tests = facts["tests"]
    assert tests["most"] > tests["mean"] > 0.0
    assert tests["half"] == pytest.approx((tests["most"] + 1) ** 0.5 - 1)
    assert len({tuple(colour) for colour in np.asarray(Image.open(io.BytesIO(picture))).reshape(-1, 3)}) > 1
    assert facts["wrong"] == {"classes": {}, "unjudged": 0, "pixels": SIZE[0] * SIZE[1]}
    soft, _ = frames.show(Wish(OTHER, SIZE, light=light, camera=camera, area=(0.5, 4), judge=True))
    assert (soft["answers"], soft["wrong"]) == (rendered(scene, soft), facts["wrong"])
    assert sum(stage["name"].startswith("targets") for stage in soft["stages"]) == 1
    wider, _ = frames.show(Wish(OTHER, SIZE, light=light, camera=camera, area=(0.75, 4)))
    assert wider["changed"] == [f"light/{i}" for i in range(4)], "a light that changes its size"


def test_what_has_not_changed_is_kept(scene):
    frames = Frames(prepare(resolve(scene)), "cpu")
    light, camera = (-1.5, 1.25, -2.0), ((1.5, 1.0, 2.5), (0.0, 0.25, 0.0))
    frames.show(Wish(METHOD, SIZE))
    facts, _ = frames.show(Wish(OTHER, SIZE, light=light, camera=camera, show="tests", beside=METHOD))
    again, _ = frames.show(Wish(OTHER, SIZE, light=light, camera=camera, beside=METHOD))
    assert (again["changed"], any(stage["ran"] for stage in again["stages"])) == ([], False)
    assert [s["ms"] for s in again["stages"]] == [s["ms"] for s in facts["stages"]], "times are kept"
    warm, _ = frames.show(Wish(OTHER, SIZE, light=light, camera=camera, beside=METHOD, again=True))
    assert all(stage["ran"] and not stage["first"] for stage in warm["stages"])
    assert warm["answers"] == facts["answers"]
    assert set(frames._sessions) == {METHOD, OTHER}, "both of a comparison are kept"
    small, _ = frames.show(Wish(OTHER, (8, 8)))
    assert (small["size"], set(frames._sessions)) == ([8, 8], {OTHER}), "and nothing else"


def test_a_frame_on_a_cpu_waits_for_no_run_that_measures(scene, tmp_path, monkeypatch):
    niced = []
    monkeypatch.setattr("os.nice", niced.append)
    monkeypatch.setattr("shadowbench.harness.commands.viewer.frames.MACHINE", MachineLock(tmp_path))
    frames = Frames(prepare(resolve(scene)), "cpu")
    with MachineLock(tmp_path).exclusive():
        assert frames.show(Wish(METHOD, SIZE))[1]
    assert niced == [LOWEST]


def test_wrong_pixels_are_found(scene, monkeypatch):
    """Answers with a wrong row of pixels: the judge counts that row."""
    frames = Frames(prepare(resolve(scene)), "cpu")
    frames.show(Wish(METHOD, SIZE))
    whole = Session.advance

    def spoiled(self, moment):
        changed = whole(self, moment)
        wrong = self.frame.answers.triangle.numpy().copy()
        wrong[SIZE[0] * 16 : SIZE[0] * 17] = 3 - np.maximum(wrong[SIZE[0] * 16 : SIZE[0] * 17], 0)
        self.frame.answers.triangle.assign(wrong)
        return changed

    monkeypatch.setattr(Session, "advance", spoiled)
    facts, _ = frames.show(Wish(METHOD, SIZE, judge=True))
    assert sum(facts["wrong"]["classes"].values()) == SIZE[0]


def test_a_bad_message_gets_one_line_and_the_page_lives_on(scene):
    wrong = [
        {"camera": [0, 0]}, {"light": [0, 0, 1e99]}, {"show": "all"}, {"camera": [[1e999, 0, 1], [0, 0, 0]]},
        {"frame": None}, {"area": [-1, 4]}, {"area": [1, 0]}, {"area": [1e999, 2]},
        {"camera": []}, {"camera": [[0, 0, 1]]}, {"camera": [[0, 0, 1], [0, 0, 0], 1]}, {"area": []}, {"area": [1]},
        {"size": [9999, 9999]}, {"size": [0, 4]}, {"camera": [[1, 1, 1], [1, 1, 1]]},
    ]  # fmt: skip
    texts = [json.dumps({"method": METHOD, "size": SIZE, **one}) for one in wrong]
    with listen(0) as listening:
        server = Server(Frames(prepare(resolve(scene)), "cpu"), {"title": "a"}, listening)
        for text in ["[]", "{", '{"method": "nobody"}', "{}", '"nothing"', *texts]:
            facts = json.loads(server.answer(text)[4:])
            assert set(facts) == {"error"}, text
            assert "\n" not in facts["error"]
            assert "IndexError" not in facts["error"]
        assert b"WEBP" in server.answer(json.dumps({"method": METHOD, "size": SIZE}))


@pytest.mark.parametrize(("changed", "said"), [
    ({"port": 70000}, "--port 70000"), ({"size": "9999x9999"}, "choose fewer"), ({"frame": 7}, "frames 0 to 0"),
    ({"method": "nobody"}, "no method 'nobody'"), ({"device": "cuda:99"}, "cuda:99"),
    ({"setting": ["bvh2.nothing=1"]}, "bvh2 has no parameter 'nothing'"), ("port", "cannot listen there"),
])  # fmt: skip
def test_what_cannot_be_shown_is_one_line(scene, changed, said):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        if changed == "port":
            changed = {"port": taken.getsockname()[1]}
        with pytest.raises(UserError, match=said):
            view(scene, **{"method": METHOD, "size": "16x16", "device": "cpu", **changed})


def test_it_begins_with_a_method_that_can_trace_the_scene(scene, tmp_path):
    camera = '[camera]\neye = [0, 1, 6]\ntarget = [0, 0, 0]\nkind = "orthographic"\nheight = 4\n'
    (tmp_path / "parallel.toml").write_text('mesh = "tetra.obj"\n' + camera)
    parallel = resolve(str(tmp_path / "parallel.toml"))
    assert default_method(resolve(scene), "cpu") == "ray_grids"
    rows = {row["name"]: row for row in Frames(prepare(parallel), "cpu").methods()}
    assert rows["ray_grids"]["reason"]
    assert not rows[default_method(parallel, "cpu")]["reason"]
    assert all(rows[name]["counts"] for name in ("ray_grids", "bvh2", "hybrid")), "they have a heat map"


def test_the_first_frame_is_made_before_a_page_asks(scene, monkeypatch):
    """With what was set, and without importing the other methods, which takes longer than the frame."""
    made, done = [], threading.Event()

    def shown(self, wish):
        made.append((wish, self.settings))
        done.set()
        return {}, b""

    monkeypatch.setattr(uvicorn.Server, "run", lambda self, sockets: done.wait(60))
    monkeypatch.setattr(Frames, "show", shown)
    monkeypatch.setattr(Frames, "methods", lambda self: pytest.fail("the methods were asked for"))
    assert view(scene, METHOD, ["embree.threads=1"], "16x16", device="cpu") == 0
    assert made == [(Wish(METHOD, (16, 16)), {"embree": {"threads": "1"}})]


@pytest.fixture
def running(tmp_path):
    """The command in a process of its own, its address, and its scene: a closed room, in which the camera is."""
    room = str(tmp_path / "room.obj")
    Path(room).write_text(TETRAHEDRON + ROOM)
    seen = f"--camera 0.5,1,2.5 0.5,0.2,0 --light 2,3,2 --method {METHOD} --size {SIZE[0]}x{SIZE[1]} --device cpu"
    words = ["view", room, *seen.split()]
    process = subprocess.Popen(
        [sys.executable, "-m", "shadowbench", *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    try:
        address = process.stdout.readline().strip()
        assert re.fullmatch(r"http://127\.0\.0\.1:\d+/\?token=[\w-]{32}", address), process.stderr.read()
        yield process, address, room
    finally:
        process.kill()
        process.wait()
        process.stdout.close()
        process.stderr.close()


def asked(address, path, **headers):
    connection = http.client.HTTPConnection(address.split("/")[2], timeout=120)
    connection.request("GET", path, headers=headers)
    answer = connection.getresponse()
    return answer.status, answer.read().decode()


def test_other_pages_are_refused_and_any_message_is_answered(running):
    """A page of another origin that has got hold of the token; bytes in place of text, and no JSON at all."""
    process, address, _ = running
    place = address.replace("http", "ws").replace("/?", "/frames?")
    port = address.split(":")[2].split("/")[0]
    for origin in ("http://elsewhere.example", "null", f"https://127.0.0.1:{port}", "http://127.0.0.1:1", "file://"):
        with pytest.raises(websocket.WebSocketBadStatusException) as refused:
            websocket.create_connection(place, origin=origin)
        assert refused.value.status_code == 403
    for options in ({"origin": f"http://127.0.0.1:{port}"}, {"suppress_origin": True}):
        connection = websocket.create_connection(place, timeout=120, **options)
        for message in (b"\xff\x00", b"[]", b""):
            connection.send_binary(message)
            assert b'"error"' in connection.recv()
        connection.send("[" * 4000)
        assert b'"error"' in connection.recv()
        connection.send_binary(json.dumps({"method": METHOD, "size": SIZE}).encode())
        assert b"WEBP" in connection.recv()
        connection.close()
    assert process.wait(timeout=120) == 0
    assert "Traceback" not in process.stderr.read()


@pytest.mark.slow
@pytest.mark.skipif(bool(browser.missing()), reason=browser.missing() or "there is a browser")
def test_the_page_in_a_browser(running, tmp_path):
    process, address, room = running
    token = address.split("=")[1]
    upgrade = {
        "Connection": "Upgrade", "Upgrade": "websocket", "Sec-WebSocket-Version": "13",
        "Sec-WebSocket-Key": "dGhlIHNhbXBsZSBub25jZQ==",
    }  # fmt: skip
    for path in ("/", "/?token=", f"/?token={token[:-1]}", f"/?token={token}%C3%A4"):
        status, text = asked(address, path)
        assert (status, text.count("\n")) == (403, 1), path
    assert asked(address, "/frames", **upgrade)[0] == 403
    assert asked(address, f"/frames?token={token}", Host="elsewhere.example", **upgrade)[0] == 400
    driver = browser.start(tmp_path / "profile")
    try:
        checked_page(driver, address, room)
        messages = [entry["message"] for entry in driver.get_log("browser")]
    finally:
        driver.quit()
    # A hint for pages that read pixels, as this test does.
    assert [message for message in messages if "willReadFrequently" not in message] == []
    assert process.wait(timeout=120) == 0, "it ends with its page"
    assert "Traceback" not in process.stderr.read()


def checked_page(driver, address, scene):
    from selenium.webdriver import ActionChains
    from selenium.webdriver.common.keys import Keys

    browser.look(driver, 1000, 700)
    driver.get("about:blank")
    driver.get_log("browser")
    driver.get(address)
    canvas = driver.find_element("id", "picture")

    def facts(after=0):
        """The facts of the last frame, once a frame after number ``after`` is there and none is under way."""
        for _ in range(1200):
            count = int(canvas.get_attribute("data-count") or 0)
            if count > after:
                time.sleep(0.2)
                if int(canvas.get_attribute("data-count")) == count:
                    return count, json.loads(canvas.get_attribute("data-facts"))
            time.sleep(0.05)
        raise AssertionError(f"no frame after {after}: {driver.find_element('id', 'verdict').text}")

    def pixels():
        script = "const c = arguments[0]; return [...c.getContext('2d').getImageData(0, 0, c.width, c.height).data]"
        return np.array(driver.execute_script(script, canvas), dtype=np.uint8).reshape(SIZE[1], SIZE[0], 4)[..., :3]

    def settled(after=0):
        """As :func:`facts`, of the frame whose kernels are loaded."""
        count, found = facts(after)
        while any(stage["first"] for stage in found["stages"]):
            count, found = facts(count)
        return count, found

    def text(name):
        return driver.find_element("id", name).text

    count, first = settled()
    assert first["answers"] == rendered(scene, first)
    before = pixels()
    ActionChains(driver).move_to_element(canvas).click_and_hold().move_by_offset(150, 20).release().perform()
    count, lit = facts(count)
    assert lit["eye"] == first["eye"]
    assert lit["light"] != first["light"]
    assert lit["answers"] == rendered(scene, lit) != first["answers"], "by what the page gives to copy"
    assert lit["options"] == text("options")
    after = pixels()
    assert (after == made_by_render(scene, lit).picture(0)).all(), "the pixels are those of render"
    assert (np.abs(before.astype(int) - after) > 16).sum() > 20, "the picture changed"
    canvas.send_keys(Keys.SHIFT, Keys.ARROW_LEFT)
    count, seen = facts(count)
    assert (seen["light"], seen["changed"]) == (lit["light"], ["camera"])
    assert seen["eye"] == lit["eye"], "indoors the camera looks around"
    assert seen["target"] != lit["target"]
    assert seen["answers"] == rendered(scene, seen)
    slide = "const s = document.getElementById('light-size'); s.value = arguments[0]; s.oninput()"
    driver.execute_script(slide, 20)
    count, soft = settled(count)
    assert soft["answers"] == rendered(scene, soft) != seen["answers"], "sixteen targets"
    driver.execute_script(slide, 0)
    count, _ = facts(count)
    canvas.send_keys("w")
    count, walked = facts(count)
    steps = [np.subtract(walked[end], seen[end]) for end in ("eye", "target")]
    assert np.linalg.norm(steps[0]) > 0.01
    assert np.allclose(*steps, atol=1e-4)
    canvas.send_keys("d" * 40 + "++++")
    count, walked = facts(count)
    assert walked["eye"] != seen["eye"]
    assert all(-3 < walked["eye"][axis] < 3 for axis in (0, 2)), "nobody leaves the room"
    canvas.send_keys(Keys.ARROW_LEFT * 9, "-" * 30)
    count, walked = facts(count)
    assert np.all(np.less([-3, -0.2, -3], walked["light"]) & np.less(walked["light"], [3, 4, 3])), "nor does the light"
    driver.find_element("css selector", f"#other option[value={OTHER}]").click()
    beside = driver.find_element("id", "beside")
    count, _ = facts(count)
    until(lambda: "times as long as" in text("ratio"), "the ratio of times")
    found = json.loads(beside.get_attribute("data-facts"))
    assert (found["method"], found["answers"]) == (OTHER, walked["answers"])
    assert "Both find the same triangles and shadows." in text("ratio")
    rows = driver.find_elements("css selector", ".side:last-of-type .stages tr")
    assert [row.text.split()[-1] for row in rows] == [f"{stage['ms']:.2f}" for stage in found["stages"]]
    assert beside.value_of_css_property("clip-path").endswith("50%)")
    driver.find_element("css selector", "#other option[value='']").click()
    count, _ = facts(count)
    driver.find_element("css selector", f"#method option[value={OTHER}]").click()
    count, other = settled(count)
    driver.find_element("id", "tests").click()
    count, heat = facts(count)
    assert heat["tests"]["most"] > 0
    legend = driver.find_element("css selector", ".legend").text
    assert legend.split()[:2] == ["0", str(heat["tests"]["most"])]
    assert "half way" in legend
    assert [stage["ms"] for stage in heat["stages"]] == [stage["ms"] for stage in other["stages"]], "kept"
    driver.find_element("id", "judge").click()
    count, judged = facts(count)
    assert judged["wrong"]["classes"] == {}
    assert "no pixel is wrong" in driver.find_element("css selector", ".judged").text
    driver.find_element("id", "size").find_elements("tag name", "option")[0].click()
    count, small = facts(count)
    assert small["size"] == [SIZE[0] // 4, SIZE[1] // 4]
    driver.execute_script("HTMLAnchorElement.prototype.click = function () { window.saved = this.download; }")
    driver.find_element("id", "save").click()
    saved = until(lambda: driver.execute_script("return window.saved"), "a saved picture")
    assert saved == f"room.obj-{OTHER}.png"
    for width in (360, 1920):
        browser.look(driver, width, 800, dark=width == 360)
        assert driver.execute_script("return document.documentElement.scrollWidth") <= width
