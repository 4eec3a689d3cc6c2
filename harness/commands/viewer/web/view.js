"use strict";
(() => {
  const $ = (id) => document.getElementById(id);
  const facts = JSON.parse($("facts").textContent);
  const plain = () => [0, 0, 1];
  const state = { method: facts.method, frame: facts.frame, camera: plain(), light: plain(), show: "shaded" };
  const canvas = $("picture");
  const socket = new WebSocket(`ws://${location.host}/frames?token=${encodeURIComponent(facts.token)}`);
  let busy = true, dirty = true, judge = false, playing = false;
  socket.binaryType = "arraybuffer";

  // One frame is under way at a time; what has changed meanwhile is asked for after it.
  function ask() {
    dirty = true;
    if (!busy) send();
  }
  function send() {
    busy = true;
    dirty = false;
    socket.send(JSON.stringify({ ...state, judge }));
    judge = false;
  }
  async function shown(event) {
    const length = new DataView(event.data).getUint32(0, true);
    const found = JSON.parse(new TextDecoder().decode(new Uint8Array(event.data, 4, length)));
    if (event.data.byteLength > 4 + length) {
      const image = await createImageBitmap(new Blob([new Uint8Array(event.data, 4 + length)], { type: "image/webp" }));
      canvas.width = image.width;
      canvas.height = image.height;
      canvas.getContext("2d").drawImage(image, 0, 0);
    }
    tell(found);
    canvas.dataset.count = Number(canvas.dataset.count || 0) + 1;
    canvas.dataset.facts = JSON.stringify(found);
    if (playing) step(1);
    busy = false;
    if (dirty) send();
  }

  const place = (values) => values.map((value) => Number(value.toPrecision(5))).join(", ");
  function tell(found) {
    if (found.error) {
      $("verdict").textContent = found.error;
      $("verdict").className = "error";
      return;
    }
    $("verdict").className = "";
    $("verdict").textContent = "";
    if (found.wrong) {
      const wrong = Object.entries(found.wrong.classes).map(([name, count]) => `${count} ${name}`);
      if (found.wrong.unjudged) wrong.push(`${found.wrong.unjudged} not judged`);
      $("verdict").textContent = `Compared with exact arithmetic: ${wrong.join(", ") || "no pixel is wrong"}, of ${found.wrong.pixels}.`;
      $("verdict").className = wrong.length ? "error" : "";
    }
    if (state.show === "tests")
      $("verdict").textContent += found.tests ? ` Tests of a primary ray: ${found.tests.mean.toFixed(1)} on average, ${found.tests.most} at most.` : " This method does not count its tests.";
    $("caption").textContent = `Eye ${place(found.eye)}` + (found.light ? `; light ${place(found.light)}` : "") + `; changed: ${found.changed.join(", ") || "nothing"}`;
    $("total").textContent = `${found.ms.toFixed(2)} ms`;
    const most = Math.max(...found.stages.map((stage) => stage.ms || 0), 1e-6);
    $("stages").tBodies[0].replaceChildren(...found.stages.map((stage) => {
      const row = document.createElement("tr");
      const name = row.insertCell(), time = row.insertCell(), bar = document.createElement("div");
      name.textContent = stage.name;
      time.textContent = stage.ms === null ? "kept" : stage.ms.toFixed(2);
      if (stage.ms === null) row.className = "kept";
      else bar.className = "bar";
      bar.style.width = `${100 * (stage.ms || 0) / most}%`;
      row.insertCell().append(bar);
      return row;
    }));
  }

  function step(by) {
    state.frame = (state.frame + by + facts.frames) % facts.frames;
    $("frame").value = state.frame;
    $("number").textContent = `${state.frame + 1} of ${facts.frames}`;
    ask();
  }
  const chosen = (shift) => (shift ? "camera" : document.querySelector("input[name=drag]:checked").value);
  function turn(what, azimuth, elevation, scale = 1) {
    const old = state[what];
    const limit = Math.min(179, Math.max(-179, old[1] + elevation));
    state[what] = [old[0] + azimuth, limit, Math.min(50, Math.max(0.02, old[2] * scale))];
    ask();
  }

  for (const one of facts.methods) {
    const option = new Option(one.reason ? `${one.name}: ${one.reason}`.slice(0, 70) : `${one.name}: ${one.title}`, one.name);
    option.disabled = Boolean(one.reason);
    $("method").append(option);
  }
  $("method").value = state.method;
  $("method").onchange = () => { state.method = $("method").value; ask(); };
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
  $("judge").onclick = () => { judge = true; $("verdict").textContent = "comparing with exact arithmetic"; ask(); };
  $("reset").onclick = () => { state.camera = plain(); state.light = plain(); ask(); };

  let held = null;
  canvas.onpointerdown = (event) => {
    canvas.setPointerCapture(event.pointerId);
    held = { what: chosen(event.shiftKey), x: event.clientX, y: event.clientY };
  };
  canvas.onpointermove = (event) => {
    if (!held) return;
    const degrees = 180 / canvas.clientWidth, sign = held.what === "camera" ? -1 : 1;
    turn(held.what, sign * (event.clientX - held.x) * degrees, -sign * (event.clientY - held.y) * degrees);
    held.x = event.clientX;
    held.y = event.clientY;
  };
  canvas.onpointerup = canvas.onpointercancel = () => { held = null; };
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    turn(chosen(event.shiftKey), 0, 0, Math.exp(event.deltaY / 800));
  }, { passive: false });
  const keys = { ArrowLeft: [-5, 0, 1], ArrowRight: [5, 0, 1], ArrowUp: [0, 5, 1], ArrowDown: [0, -5, 1], "+": [0, 0, 0.9], "-": [0, 0, 1.1] };
  canvas.onkeydown = (event) => {
    if (!keys[event.key]) return;
    event.preventDefault();
    turn(chosen(event.shiftKey), ...keys[event.key]);
  };

  socket.onopen = () => { busy = false; step(0); };
  socket.onmessage = shown;
  socket.onclose = () => {
    $("verdict").textContent = "shadowbench view has ended; start it again.";
    $("verdict").className = "error";
  };
})();
