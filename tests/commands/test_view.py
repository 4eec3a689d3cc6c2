"""The live page: what it shows is what ``render`` shows, nobody comes in without the token, and it ends with the page."""

from __future__ import annotations

import http.client
import json
import re
import socket
import subprocess
import sys
import time

import numpy as np
import pytest
import websocket
from helpers import browser
from helpers.tiny_runs import TETRAHEDRON
from shadowbench.harness.commands.options import view_of
from shadowbench.harness.commands.render import opened
from shadowbench.harness.commands.view import default_method, view
from shadowbench.harness.commands.viewer.frames import Frames, Wish
from shadowbench.harness.commands.viewer.orbit import turned
from shadowbench.harness.commands.viewer.server import Server, listen
from shadowbench.harness.errors import UserError
from shadowbench.harness.files import array_hash
from shadowbench.harness.frame.session import Session
from shadowbench.harness.scene.catalogue import resolve
from shadowbench.harness.scene.prepared import prepare

SIZE = (48, 32)
METHOD, OTHER = "embree", "uniform_grid"
FLOOR = "v -3 -0.2 -3\nv 3 -0.2 -3\nv 3 -0.2 3\nv -3 -0.2 3\nf 5 6 7\nf 5 7 8\n"


@pytest.fixture
def scene(tmp_path):
    """A tetrahedron that casts a shadow."""
    path = tmp_path / "tetra.obj"
    path.write_text(TETRAHEDRON + FLOOR)
    return str(path)


def made_by_render(scene, facts):
    """What ``render`` makes its picture with, under the camera and the light of a frame."""

    def text(place):
        return ",".join(map(repr, place))

    view = view_of((text(facts["eye"]), text(facts["target"])), None, [text(facts["light"])])
    described = view.applied(resolve(scene))
    return opened(scene, described, facts["method"], SIZE, "cpu", None)


def rendered(scene, facts):
    """The hash of the answers that ``render`` makes its picture from."""
    made = made_by_render(scene, facts)
    answers = made.session.answers(made.prepared.moment(0, *SIZE))
    return array_hash(answers["triangle"], answers["shadowed"])


def test_partial_frames_have_the_bits_of_render(scene):
    frames = Frames(prepare(resolve(scene)), *SIZE, "cpu")
    hashes = []
    for wish in (
        Wish(METHOD),
        Wish(METHOD, light=(120.0, -30.0, 0.7)),
        Wish(METHOD, light=(120.0, -30.0, 0.7), camera=(40.0, 15.0, 0.8)),
        Wish(OTHER, light=(120.0, -30.0, 0.7), camera=(40.0, 15.0, 0.8), show="tests", judge=True),
    ):
        facts, picture = frames.show(wish)
        assert picture.startswith(b"RIFF")
        assert facts["answers"] == rendered(scene, facts)
        hashes.append((facts["answers"], facts["changed"]))
    assert len({found for found, _ in hashes}) == 3, "the light, then the camera, changed the answers"
    assert hashes[1][1] == ["light/0"]
    assert hashes[2][0] == hashes[3][0], "two exact methods"
    assert facts["tests"]["most"] >= 1
    assert facts["wrong"] == {"classes": {}, "unjudged": 0, "pixels": SIZE[0] * SIZE[1]}
    again, _ = frames.show(Wish(OTHER, light=(120.0, -30.0, 0.7), camera=(40.0, 15.0, 0.8)))
    assert again["changed"] == []
    assert {stage["ms"] for stage in again["stages"]} == {None}, "nothing ran again"


def test_wrong_pixels_are_found(scene, monkeypatch):
    """Answers with a wrong row of pixels: the judge counts that row."""
    frames = Frames(prepare(resolve(scene)), *SIZE, "cpu")
    frames.show(Wish(METHOD))
    whole = Session.advance

    def spoiled(self, moment):
        changed = whole(self, moment)
        wrong = self.frame.answers.triangle.numpy().copy()
        wrong[SIZE[0] * 16 : SIZE[0] * 17] = 3 - np.maximum(wrong[SIZE[0] * 16 : SIZE[0] * 17], 0)
        self.frame.answers.triangle.assign(wrong)
        return changed

    monkeypatch.setattr(Session, "advance", spoiled)
    facts, _ = frames.show(Wish(METHOD, judge=True))
    assert sum(facts["wrong"]["classes"].values()) == SIZE[0]


def test_a_place_is_turned_and_never_upright():
    start, up = (0.0, 0.0, 2.0), (0.0, 1.0, 0.0)
    assert turned(start, (0.0, 0.0, 0.0), up, 0.0, 0.0, 1.0) is start
    assert np.allclose(turned(start, (0.0, 0.0, 0.0), up, 90.0, 0.0, 0.5), (1.0, 0.0, 0.0))
    high = turned(start, (0.0, 0.0, 0.0), up, 0.0, 500.0, 1.0)
    assert np.allclose(np.linalg.norm(high), 2.0)
    assert 0.01 < high[2] < 0.1
    above = turned((0.0, 2.0, 0.0), (0.0, 0.0, 0.0), up, 30.0, 0.0, 1.0)
    assert np.allclose(above, (0.0, 2.0, 0.0))


@pytest.mark.parametrize(
    "text",
    ["[]", "{", '{"camera": [0, 0]}', '{"light": [0, 0, 1e9]}', '{"show": "all"}', '{"method": "nobody"}',
     '{"camera": [1e999, 0, 1]}', '{"frame": null}'],
)  # fmt: skip
def test_a_bad_message_gets_one_line_and_the_page_lives_on(scene, text):
    with listen(0) as listening:
        server = Server(Frames(prepare(resolve(scene)), *SIZE, "cpu"), {"title": "a"}, listening)
        reply = server.answer(text)
        facts = json.loads(reply[4:])
        assert set(facts) == {"error"}
        assert "\n" not in facts["error"]
        good = server.answer(json.dumps({"method": METHOD}))
        assert b"WEBP" in good


@pytest.mark.parametrize(
    ("changed", "said"),
    [({"port": 70000}, "--port 70000"), ({"size": "9999x9999"}, "choose fewer"), ({"frame": 7}, "frames 0 to 0"),
     ({"method": "nobody"}, "no method 'nobody'"), ({"device": "cuda:99"}, "cuda:99")],
)  # fmt: skip
def test_what_cannot_be_shown_is_one_line(scene, changed, said):
    with pytest.raises(UserError, match=said) as refused:
        view(scene, **{"method": METHOD, "size": "16x16", "device": "cpu", **changed})
    assert "\n" not in str(refused.value)


def test_it_begins_with_a_method_that_can_trace_the_scene(scene, tmp_path):
    camera = '[camera]\neye = [0, 1, 6]\ntarget = [0, 0, 0]\nkind = "orthographic"\nheight = 4\n'
    (tmp_path / "parallel.toml").write_text('mesh = "tetra.obj"\n' + camera)
    parallel = Frames(prepare(resolve(str(tmp_path / "parallel.toml"))), *SIZE, "cpu")
    assert default_method(Frames(prepare(resolve(scene)), *SIZE, "cpu")) == "ray_grids"
    able = {row["name"]: not row["reason"] for row in parallel.methods()}
    assert not able["ray_grids"]
    assert able[default_method(parallel)]


def test_a_port_in_use_is_one_line(scene):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        with pytest.raises(UserError, match="cannot listen there"):
            view(scene, METHOD, "16x16", device="cpu", port=taken.getsockname()[1])


@pytest.fixture
def running(scene):
    """The command in a process of its own, and its address."""
    words = ["view", scene, "--method", METHOD, "--size", f"{SIZE[0]}x{SIZE[1]}", "--device", "cpu"]
    process = subprocess.Popen(
        [sys.executable, "-m", "shadowbench", *words],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        address = process.stdout.readline().strip()
        assert re.fullmatch(r"http://127\.0\.0\.1:\d+/\?token=[\w-]{32}", address), process.stderr.read()
        yield process, address
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
    process, address = running
    place = address.replace("http", "ws").replace("/?", "/frames?")
    port = address.split(":")[2].split("/")[0]
    for origin in (
        "http://elsewhere.example",
        "null",
        f"https://127.0.0.1:{port}",
        "http://127.0.0.1:1",
        "file://",
    ):
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
        connection.send_binary(json.dumps({"method": METHOD}).encode())
        assert b"WEBP" in connection.recv()
        connection.close()
    assert process.wait(timeout=120) == 0
    assert "Traceback" not in process.stderr.read()


@pytest.mark.skipif(bool(browser.missing()), reason=browser.missing() or "there is a browser")
def test_the_page_in_a_browser(running, scene, tmp_path):
    process, address = running
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
        checked_page(driver, address, scene)
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
        return driver.execute_script(script, canvas)

    count, first = facts()
    assert first["answers"] == rendered(scene, first)
    before = pixels()
    assert len(before) == 4 * SIZE[0] * SIZE[1]
    ActionChains(driver).move_to_element(canvas).click_and_hold().move_by_offset(150, 20).release().perform()
    count, lit = facts(count)
    assert lit["eye"] == first["eye"]
    assert lit["light"] != first["light"]
    assert lit["answers"] == rendered(scene, lit) != first["answers"]
    after = pixels()
    shown = np.array(after, dtype=np.uint8).reshape(SIZE[1], SIZE[0], 4)
    assert (shown[..., :3] == made_by_render(scene, lit).picture(0)).all(), "the pixels are those of render"
    assert sum(abs(a - b) > 16 for a, b in zip(before, after, strict=True)) > 20, "the picture changed"
    canvas.send_keys(Keys.SHIFT, Keys.ARROW_LEFT)
    count, seen = facts(count)
    assert (seen["light"], seen["changed"]) == (lit["light"], ["camera"])
    assert seen["eye"] != lit["eye"]
    assert seen["answers"] == rendered(scene, seen)
    driver.find_element("css selector", f"#method option[value={OTHER}]").click()
    count, other = facts(count)
    assert (other["method"], other["answers"]) == (OTHER, seen["answers"])
    rows = driver.find_elements("css selector", "#stages tr")
    assert [row.text.split()[-1] for row in rows] == [f"{stage['ms']:.2f}" for stage in other["stages"]]
    driver.find_element("id", "judge").click()
    count, judged = facts(count)
    assert judged["wrong"]["classes"] == {}
    assert "no pixel is wrong" in driver.find_element("id", "verdict").text
    driver.find_element("id", "tests").click()
    assert facts(count)[1]["tests"]["most"] > 0
