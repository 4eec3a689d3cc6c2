"use strict";
(() => {
  const $ = (id) => document.getElementById(id);
  const facts = JSON.parse($("facts").textContent);
  const state = { ...facts.state, beside: "", camera: null, light: null, area: null, show: "shaded" };
  const socket = new WebSocket(`ws://${location.host}/frames?token=${encodeURIComponent(facts.token)}`);
  const sides = [{ canvas: $("picture") }, { canvas: $("beside") }].map((side) => {
    const box = $("side").content.cloneNode(true).firstElementChild;
    $("sides").append(box);
    return { ...side, box, part: (name) => box.querySelector(`.${name}`) };
  });
  const canvas = sides[0].canvas;
  let busy = true, dirty = false, judge = false, playing = false, answered = null, last = null, known = false, counting = "";
  const shownAt = [];
  socket.binaryType = "arraybuffer";

  // One message is under way at a time; what has changed meanwhile is asked for after it.
  function reply(message) {
    socket.send(JSON.stringify(message));
    return new Promise((resolve) => { answered = resolve; });
  }
  socket.onmessage = ({ data }) => {
    const length = new DataView(data).getUint32(0, true);
    answered([JSON.parse(new TextDecoder().decode(new Uint8Array(data, 4, length))), new Uint8Array(data, 4 + length)]);
  };
  async function ask() {
    dirty = true;
    if (busy) return;
    busy = true;
    while (dirty) {
      dirty = false;
      const wish = { ...state, judge };
      judge = false;
      await shown(sides[0], wish);
      if (state.beside) await shown(sides[1], { ...wish, method: wish.beside, beside: wish.method });
      compared();
      if (playing) step(1);
      else if (!dirty && !known) await listed();
    }
    busy = false;
  }
  async function shown(side, wish) {
    const slow = setTimeout(() => { $("slow").hidden = false; }, 2000);
    let [found, picture] = await reply(wish);
    clearTimeout(slow);
    $("slow").hidden = true;
    await drawn(side, wish, found, picture);
    // What ran for the first time has loaded its kernels: it is timed again, unless something has changed meanwhile.
    if (side.cold && !dirty && !playing) {
      [found, picture] = await reply({ ...wish, again: true });
      await drawn(side, wish, found, picture);
    }
  }
  async function drawn(side, wish, found, picture) {
    side.found = found;
    if (found.error) {
      side.cold = false;
      say(found.error, true);
    } else {
      const image = await createImageBitmap(new Blob([picture], { type: "image/webp" }));
      side.canvas.width = image.width;
      side.canvas.height = image.height;
      side.canvas.getContext("2d").drawImage(image, 0, 0);
      tell(side, wish, found);
    }
    side.canvas.dataset.facts = JSON.stringify(found);
    side.canvas.dataset.count = Number(side.canvas.dataset.count || 0) + 1;
  }
  async function listed() {
    known = true;
    const [{ methods }] = await reply("methods");
    counting = methods.filter((one) => one.counts && !one.reason).map((one) => one.name).join(", ");
    for (const select of [$("method"), $("other")])
      for (const one of methods.filter((each) => each.reason)) {
        const option = [...select.options].find((each) => each.value === one.name);
        option.disabled = true;
        option.textContent = `${one.name}: ${one.reason}`.slice(0, 90);
      }
  }

  const say = (text, wrong = false) => {
    $("verdict").textContent = text;
    $("verdict").className = wrong ? "error" : "";
  };
  const place = (values) => values.map((value) => Number(value.toPrecision(5))).join(", ");
  const ms = (stages) => stages.reduce((sum, stage) => sum + (stage.ms || 0), 0);
  const inputs = (names) => [...new Set(names.includes("light/1") ? names.map((name) => name.replace(/^light\/.*/, "lights")) : names)];
  function tell(side, wish, found) {
    side.cold = found.stages.some((stage) => stage.first && stage.ms !== null);
    side.box.hidden = false;
    side.part("name").textContent = found.method;
    const ran = found.stages.filter((stage) => stage.ran), whole = ms(found.stages);
    const part = ran.length < found.stages.length ? `; in this one ${ran.length} of ${found.stages.length} passes ran, ${ms(ran).toFixed(2)} ms` : "";
    side.part("total").textContent = side.cold ? "" : `${whole.toFixed(2)} ms for a whole frame, warm${part}`;
    side.part("cold").hidden = !side.cold;
    const most = Math.max(...found.stages.map((stage) => stage.ms || 0), 1e-6);
    side.part("stages").tBodies[0].replaceChildren(...found.stages.map((stage) => {
      const row = document.createElement("tr");
      const name = row.insertCell(), time = row.insertCell(), bar = document.createElement("div");
      name.textContent = stage.name;
      time.textContent = stage.ms === null || side.cold ? "" : stage.ms.toFixed(2);
      if (!stage.ran) [row.className, row.title] = ["kept", "It did not run for this frame; the time is that of its last run."];
      bar.className = "bar";
      bar.style.width = side.cold ? "0" : `${100 * (stage.ms || 0) / most}%`;
      row.insertCell().append(bar);
      return row;
    }));
    side.part("legend").hidden = !found.tests;
    if (found.tests) {
      side.part("most").textContent = found.tests.most;
      side.part("mean").textContent = `tests; ${found.tests.half.toPrecision(2)} half way, ${found.tests.mean.toFixed(1)} on average`;
    }
    side.part("uncounted").hidden = found.counts || wish.show !== "tests";
    side.part("uncounted").textContent = `${found.method} does not count the tests of a ray${counting ? `; ${counting} do` : ""}.`;
    const judged = side.part("judged"), wrong = Object.entries(found.wrong?.classes || {}).map(([name, count]) => `${count} ${name}`);
    if (found.wrong?.unjudged) wrong.push(`${found.wrong.unjudged} not judged`);
    judged.hidden = !found.wrong;
    judged.classList.toggle("error", wrong.length > 0);
    judged.textContent = found.wrong ? `Compared with exact arithmetic: ${wrong.join(", ") || "no pixel is wrong"}, of ${found.wrong.pixels}.` : "";
    if (side !== sides[0]) return;
    say("");
    last = found;
    $("caption").textContent = `Eye ${place(found.eye)}` + (found.light ? `; light ${place(found.light)}` : "") + (wish.again ? "" : `; changed: ${inputs(found.changed).join(", ") || "nothing"}`);
    $("options").textContent = found.options + facts.fov;
    const now = performance.now();
    shownAt.push(now);
    while (shownAt[0] < now - 4000) shownAt.shift();
    $("rate").textContent = shownAt.length > 2 ? `The page shows ${((shownAt.length - 1) * 1000 / (now - shownAt[0])).toPrecision(2)} frames a second.` : "";
  }
  function compared() {
    const two = Boolean(state.beside), [a, b] = sides.map((side) => side.found);
    sides[1].canvas.hidden = sides[1].box.hidden = $("divider").hidden = $("edge").hidden = !two;
    $("left").textContent = state.method;
    $("right").textContent = state.beside;
    const able = two && !a.error && !b.error && !sides.some((side) => side.cold);
    $("ratio").textContent = able ? `${b.method} takes ${(ms(b.stages) / ms(a.stages)).toPrecision(3)} times as long as ${a.method}. ${a.answers === b.answers ? "Both find the same triangles and shadows." : "Their triangles or shadows differ."}` : "";
    divide();
  }
  function divide() {
    sides[1].canvas.style.clipPath = `inset(0 0 0 ${$("split").value}%)`;
    $("edge").style.left = `${$("split").value}%`;
  }

  function step(by) {
    state.frame = (state.frame + by + facts.frames) % facts.frames;
    $("frame").value = state.frame;
    $("number").textContent = `${state.frame + 1} of ${facts.frames}`;
    ask();
  }

  // Places: the scene's up is the camera's. Numbers have six digits, so that what is copied is short and exact.
  const add = (a, b, scale = 1) => a.map((value, i) => value + scale * b[i]);
  const dot = (a, b) => a.reduce((sum, value, i) => sum + value * b[i], 0);
  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const size = (a) => Math.hypot(...a);
  const unit = (a) => a.map((value) => value / (size(a) || 1));
  const short = (a) => a.map((value) => Number(value.toPrecision(6)));
  const [low, high] = facts.box, middle = add(low, high).map((value) => value / 2), wide = size(add(high, low, -1));
  const within = (a) => a.every((value, i) => value > low[i] && value < high[i]);
  const kept = (a) => a.map((value, i) => Math.min(high[i] - 0.02 * (high[i] - low[i]), Math.max(low[i] + 0.02 * (high[i] - low[i]), value)));

  // `point` turned about `centre` by degrees, to `scale` times its distance: never straight above it.
  function turned(point, centre, up, azimuth, elevation, scale) {
    const arm = add(point, centre, -1), length = size(arm) || 1, rise = dot(arm, up);
    let level = add(arm, up, -rise);
    if (size(level) <= 1e-9 * length) level = cross(up, [Math.abs(up[0]) < 0.9 ? 1 : 0, Math.abs(up[0]) < 0.9 ? 0 : 1, 0]);
    level = unit(level);
    const angle = azimuth * Math.PI / 180, before = Math.asin(Math.max(-1, Math.min(1, rise / length)));
    level = add(level.map((value) => value * Math.cos(angle)), cross(up, level), Math.sin(angle));
    const most = Math.max(89 * Math.PI / 180, Math.abs(before));
    const above = Math.max(-most, Math.min(most, before + elevation * Math.PI / 180));
    return add(add(centre, level, length * scale * Math.cos(above)), up, length * scale * Math.sin(above));
  }
  // Indoors, where every ray hits something, the camera looks around; elsewhere it turns about what it looks at. What stands
  // within the scene stays there.
  const indoors = () => last.missed === 0 && within(last.eye);
  const chosen = (shift) => (shift ? "camera" : document.querySelector("input[name=drag]:checked").value);
  function turn(what, azimuth, elevation, scale = 1) {
    if (!last || (what === "light" && !last.light)) return;
    const up = unit(last.up), { eye, target } = now();
    if (what === "light") {
      const from = state.light || last.light;
      const moved = turned(from, last.directional ? [0, 0, 0] : middle, up, azimuth, elevation, scale);
      state.light = short(within(from) && !last.directional ? kept(moved) : moved);
    } else if (indoors() && scale === 1) state.camera = [eye, short(turned(target, eye, up, azimuth, elevation, 1))];
    else if (indoors()) return walk(0, 0, scale < 1 ? 1 : -1);
    else {
      const distance = size(add(eye, target, -1)), limit = Math.min(3 * wide / distance, Math.max(0.01 * wide / distance, scale));
      const moved = turned(eye, target, up, -azimuth, -elevation, limit);
      const floor = add(low, high, 0).map((value, i) => value + 0.02 * (high[i] - low[i]));
      const deep = dot(eye, up) >= dot(floor, up) ? dot(floor, up) - dot(moved, up) : 0;
      state.camera = [short(add(moved, up, Math.max(0, deep))), target];
    }
    ask();
  }
  const now = () => (state.camera ? { eye: state.camera[0], target: state.camera[1] } : { eye: last.eye, target: last.target });
  function walk(right, above, ahead) {
    if (!last) return;
    const up = unit(last.up), { eye, target } = now(), view = add(target, eye, -1);
    const level = unit(add(view, up, -dot(view, up))), side = cross(level, up), far = 0.02 * wide;
    let moved = add(add(add(eye, side, right * far), up, above * far), level, ahead * far);
    if (within(eye)) moved = kept(moved);
    state.camera = [short(moved), short(add(target, add(moved, eye, -1)))];
    ask();
  }

  for (const one of facts.methods) {
    $("method").append(new Option(`${one.name}: ${one.title}`, one.name));
    $("other").append(new Option(`${one.name}: ${one.title}`, one.name));
  }
  $("method").value = state.method;
  $("method").onchange = () => { state.method = $("method").value; ask(); };
  $("other").onchange = () => { state.beside = $("other").value === state.method ? "" : $("other").value; ask(); };
  for (const factor of [0.25, 0.5, 1, 2, 4, 8]) {
    const [width, height] = facts.state.size.map((pixels) => Math.round(pixels * factor));
    if (Math.min(width, height) < 8 && factor !== 1 || width * height > facts.largest) continue;
    $("size").append(new Option(`${width}x${height}`, JSON.stringify([width, height]), factor === 1, factor === 1));
  }
  $("size").onchange = () => { state.size = JSON.parse($("size").value); ask(); };
  $("title").textContent = facts.title;
  $("stand-in").textContent = [facts.stand_in, facts.left_out].filter(Boolean).join("; ");
  $("frame").max = facts.frames - 1;
  $("time").hidden = facts.frames < 2;
  $("frame").oninput = () => { state.frame = Number($("frame").value); step(0); };
  $("play").onclick = () => {
    playing = !playing;
    $("play").setAttribute("aria-pressed", playing);
    $("play").textContent = playing ? "Pause" : "Play";
    if (playing) step(1);
  };
  $("tests").onchange = () => { state.show = $("tests").checked ? "tests" : "shaded"; ask(); };
  $("judge").onclick = () => { judge = true; say("comparing with exact arithmetic"); ask(); };
  $("reset").onclick = () => {
    state.camera = state.light = state.area = null;
    $("light-size").value = 0;
    ask();
  };
  $("light-size").oninput = $("targets").onchange = () => {
    const share = Number($("light-size").value);
    state.area = share ? [...short([0.005 * share * wide]), Number($("targets").value)] : null;
    ask();
  };
  $("split").oninput = divide;
  $("copy").onclick = async () => {
    try {
      await navigator.clipboard.writeText($("options").textContent);
      $("copy").textContent = "Copied";
    } catch {
      getSelection().selectAllChildren($("options")); // a browser that lets no page copy
    }
  };
  // As it is seen: with two methods up to the divider the first, then the second.
  $("save").onclick = () => {
    const whole = document.createElement("canvas"), pen = whole.getContext("2d"), { width, height } = canvas;
    [whole.width, whole.height] = [width, height];
    pen.drawImage(canvas, 0, 0);
    const from = Math.round(width * $("split").value / 100);
    if (state.beside && from < width) pen.drawImage(sides[1].canvas, from, 0, width - from, height, from, 0, width - from, height);
    whole.toBlob((file) => {
      const link = document.createElement("a");
      link.download = [facts.title, state.method, state.beside, facts.frames > 1 ? state.frame : ""].filter((word) => word !== "").join("-").replace(/[^\w.-]+/g, "_") + ".png";
      link.href = URL.createObjectURL(file);
      link.click();
      setTimeout(() => URL.revokeObjectURL(link.href), 1e4);
    });
  };

  let held = null;
  canvas.onpointerdown = (event) => {
    canvas.setPointerCapture(event.pointerId);
    held = { what: chosen(event.shiftKey), x: event.clientX, y: event.clientY };
  };
  canvas.onpointermove = (event) => {
    if (!held) return;
    const degrees = 180 / canvas.clientWidth;
    turn(held.what, (event.clientX - held.x) * degrees, (held.y - event.clientY) * degrees);
    held.x = event.clientX;
    held.y = event.clientY;
  };
  canvas.onpointerup = canvas.onpointercancel = () => { held = null; };
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    turn(chosen(event.shiftKey), 0, 0, Math.exp(event.deltaY / 800));
  }, { passive: false });
  const turns = { ArrowLeft: [-5, 0], ArrowRight: [5, 0], ArrowUp: [0, 5], ArrowDown: [0, -5], "+": [0, 0, 0.9], "-": [0, 0, 1.1] };
  const steps = { w: [0, 0, 1], s: [0, 0, -1], a: [-1, 0, 0], d: [1, 0, 0], q: [0, -1, 0], e: [0, 1, 0] };
  canvas.onkeydown = (event) => {
    const key = event.key.toLowerCase();
    if (event.ctrlKey || event.metaKey || event.altKey || !(turns[event.key] || steps[key])) return;
    event.preventDefault();
    if (turns[event.key]) turn(chosen(event.shiftKey), ...turns[event.key]);
    else walk(...steps[key]);
  };

  sides[1].box.hidden = true;
  socket.onopen = () => { busy = false; step(0); };
  socket.onclose = () => say("shadowbench view has ended; start it again.", true);
})();
