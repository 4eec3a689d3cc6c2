// Time against what was varied: the light's distance (Figure 11), the frames of an animation, triangles, pixels, lights.
// A slider goes through the places; beside the curves stand all methods at the place that it shows.

/** What the experiment changed of the lights, but what an axis is about. */
const litBut = (p, name) => p.lit.split(", ").filter((one) => !one.startsWith(`${name} `)).join(", ");
// What two points of one line have in common: all but what the axis is about.
const AXES = {
  light_distance: { title: "distance of the light, scene radii", log: true, apart: (p) => [p.name, p.title, litBut(p, "distance"), p.size], text: (x) => `${short(x)} ${x === 1 ? "radius" : "radii"}` },
  lights: { title: "lights", log: true, apart: (p) => [p.name, p.title, litBut(p, "count"), p.size], text: (x) => `${x} light${x === 1 ? "" : "s"}` },
  frame: { title: "frame", log: false, apart: (p) => [p.name, p.where, p.size], text: (x) => `frame ${x}` },
  // Scenes of one kind, such as balls-10k and balls-1m: others differ in more than their number of triangles.
  triangles: { title: "triangles", log: true, apart: (p) => [p.name, p.scene.split("-")[0], p.light_label, p.size], text: (x) => `${whole(x)} triangles` },
  pixels: { title: "pixels", log: true, apart: (p) => [p.name, p.where], text: (x) => `${whole(x)} pixels` },
};
const short = (x) => (x >= 1e4 ? x.toExponential(0).replace("e+", "e") : String(x));
/** What else may tell two points apart: points that differ in it are never on one line. */
const also = (p) => [p.moved && `moved: ${p.moved}`, p.experiment, p.preset, p.device_name].filter(known);
let chart = null;

/** The lines of a folder along an axis: those with two places or more. */
function curves(own, axis, measure) {
  const lines = new Map();
  for (const p of own.filter((one) => one.done)) {
    const frames = axis === "frame" ? framesOf.get(p.id) || [] : [null];
    for (const frame of frames) {
      const x = frame ? frame.frame : p[axis];
      if (!known(x)) continue;
      const key = [...AXES[axis].apart(p), ...also(p)].join("\n");
      if (!lines.has(key)) lines.set(key, { key, p, apart: AXES[axis].apart(p), points: [] });
      const y = valueOf(frame || p, measure), text = textOf(frame || p, measure);
      const t = frame || p;
      const quartiles = measure === "total_ms" && t.samples > 1;
      lines.get(key).points.push({ x, y, text, p, frame, low: quartiles ? t.q1_ms : null, high: quartiles ? t.q3_ms : null, bad: (t.error || "").startsWith("✗"), error: t.error,
        lines: () => [...pointLines(p, frame), [AXES[axis].title, AXES[axis].text(x)], measure === "total_ms" ? null : [measureTitle(measure), text]], open: () => openDetails(p) });
    }
  }
  return [...lines.values()].flatMap(apartAt).filter((line) => unique(line.points.map((p) => p.x)).length > 1);
}

/** A line with two points at one place is as many lines as it has scenes and lightings: nothing is averaged. */
function apartAt(line) {
  if (unique(line.points.map((p) => p.x)).length === line.points.length) return [line];
  const own = new Map();
  for (const point of line.points) {
    const { where } = point.p;
    if (!own.has(where)) own.set(where, { ...line, key: `${line.key}\n${where}`, p: point.p, apart: [...line.apart, where], points: [] });
    own.get(where).points.push(point);
  }
  return [...own.values()];
}

function viewCurves(host) {
  const choices = foldersShown().map((name) => {
    const own = shown(["exp"]).filter((p) => p.folder === name);
    return { name, own, axes: Object.keys(AXES).filter((axis) => curves(own, axis, "total_ms").length) };
  }).filter((one) => one.axes.length);
  if (!choices.length) { host.append(nothing("Nothing was varied in these results: no distance of the light, no frames, triangles, pixels or lights.")); return; }
  const chosen = choices.find((one) => one.name === state.c) || choices[0];
  // Unless one is asked for, what was varied most.
  const places_ = (one) => Math.max(...curves(chosen.own, one, "total_ms").map((line) => line.points.length));
  const axis = chosen.axes.includes(state.x) ? state.x : chosen.axes.reduce((a, b) => (places_(b) > places_(a) ? b : a));
  const counters = axis === "frame" ? [] : unique(chosen.own.flatMap((p) => Object.keys(p.counters))).sort();
  const measures = [...Object.keys(MEASURES).filter((m) => axis !== "frame" || !["frame_mrays_per_s", "wrong_per_frame", "flip"].includes(m)).map((m) => [m, measureTitle(m)]), ...counters.map((one) => [`counter:${one}`, one])];
  const measure = measures.some(([m]) => m === state.y) ? state.y : axis === "light_distance" ? "shadow_ms" : "total_ms";
  const every = curves(chosen.own, axis, measure);
  // What differs besides the method: each value of it is a panel of its own.
  const panels = unique(every.map((line) => line.apart.slice(1).filter(known).join(", ")));
  const panel = panels.includes(state.cs) ? state.cs : panels[0];
  const lines = every.filter((line) => line.apart.slice(1).filter(known).join(", ") === panel);
  const places = unique(lines.flatMap((line) => line.points.map((p) => p.x))).sort((a, b) => a - b);
  const at = Math.max(0, Math.min(places.length - 1, Number(state.at ?? places.length - 1)));
  const tints = lineLooks(lines);
  const log = (state.scale || "log") === "log";

  host.append(el("div.controls", {},
    folderChoice(choices.map((one) => one.name), chosen.name, (c) => change({ c, x: "", y: "", cs: "", at: "" })),
    select("Along", chosen.axes.map((one) => [one, AXES[one].title]), axis, (x) => change({ x, cs: "", at: "", y: "" }), { "data-focus": "x" }),
    select("Show", measures, measure, (y) => change({ y }), { "data-focus": "y" }),
    panels.length > 1 && select("Of", panels, panel, (cs) => change({ cs, at: "" }), { "data-focus": "cs" })));
  const box = el("div.plot");
  const list = el("div.at-place");
  const range = el("input", { type: "range", min: 0, max: places.length - 1, step: 1, value: String(at), "data-focus": "at", id: "place",
    "aria-valuetext": AXES[axis].text(places[at]), oninput: () => show(Number(range.value)), onchange: () => change({ at: range.value }, true) });
  const told = el("output", { for: "place" });
  const block = section(`${folderOf(chosen.name).title}: ${panel}`, el("div.aside"),
    el("div.split", {}, el("div.stay", {}, box, el("p.note", {}, "Drag to zoom, double click or ", el("button.small", { type: "button", onclick: () => chart?.reset() }, "whole range"), ". A red cross: wrong answers. Whiskers: quartiles.")),
      el("div", {}, el("div.place", {}, el("label", { for: "place" }, AXES[axis].title), range, told), list)));
  host.append(block);
  const columns = [
    { key: "name", title: "method", text: (r) => r.name, node: (r) => el("span.key", {}, lineSwatch(tints.get(r.line.key)), r.name), tip: (r) => r.point && r.point.lines() },
    { key: "bar", title: "", fixed: true, screen: true, text: () => "", node: (r) => r.bar },
    { key: "y", title: measureTitle(measure), numeric: "up", value: (r) => r.point?.y ?? null, text: (r) => (r.point && r.point.y !== null ? `${r.point.text} ${r.point.error}` : "–"), csv: (r) => r.point?.y,
      node: (r) => (r.point && r.point.y !== null ? el("span.cell", {}, el("span", {}, r.point.text), mark({ bad: r.point.bad, error: r.point.error })) : "–"), tip: (r) => r.point && r.point.lines() },
  ];
  function show(i) {
    const x = places[i];
    range.setAttribute("aria-valuetext", AXES[axis].text(x));
    told.textContent = AXES[axis].text(x);
    const rows = lines.map((line) => ({ line, name: line.p.name, point: line.points.find((p) => p.x === x) }));
    const most = Math.max(...lines.flatMap((line) => line.points.map((p) => p.y || 0)));
    const least = Math.min(...lines.flatMap((line) => line.points.map((p) => p.y || Infinity)));
    for (const row of rows) {
      row.bar = el("span.time");
      const y = row.point?.y;
      if (y > 0) {
        const bar = el(`i.fill${row.point.bad ? ".bad" : ""}`);
        bar.style.width = `${log ? 4 + 96 * Math.log(y / least) / Math.log(most / least || 2) : 100 * y / most}%`;
        bar.style.background = tints.get(row.line.key).colour;
        row.bar.append(bar);
      }
    }
    const lost = chosen.own.filter((p) => !p.done && axis !== "frame" && p[axis] === x && AXES[axis].apart(p).slice(1).filter(known).join(", ") === panel);
    list.replaceChildren(grid(columns, rows, { caption: `${measureTitle(measure)} at ${AXES[axis].text(x)}`, name: "place", open: (r) => r.point?.open(), valid: folderOf(chosen.name).valid, notes: marksIn(rows.map((r) => r.point?.text || "")) }),
      ...lost.map((p) => el("p.note", {}, `${p.name}: ${p.status}: ${p.reason}`)));
    $(".aside", block).replaceChildren(savers(columns, ordered(columns, rows, "place"), `${chosen.name}-${axis}-${short(x)}`, `${measureTitle(measure)} at ${AXES[axis].text(x)}, ${panel}`, { notes: folderOf(chosen.name).valid }));
    state.at = String(i);
    chart?.mark(x);
  }
  chart?.end();
  chart = lineChart(box, lines.map((line) => ({ ...tints.get(line.key), label: line.p.name, points: line.points })),
    { x: AXES[axis].title, y: measureTitle(measure), logX: AXES[axis].log, logY: log, mark: places[at] });
  show(at);
  figuresOf(chosen.name, host);
}

/** A colour for each line, its method's; dashes tell apart what one method has several lines of. */
function lineLooks(lines) {
  const before = new Map();
  return new Map(lines.map((line) => {
    const n = before.get(line.p.method) || 0;
    before.set(line.p.method, n + 1);
    return [line.key, { colour: colourOf(line.p.method), dash: DASHES[n % DASHES.length], hollow: n > 0 }];
  }));
}

function lineSwatch({ colour, dash }) {
  const node = el("i.line-swatch", { "aria-hidden": "true" });
  node.style.borderTop = `3px ${dash.length ? (dash[0] > 4 ? "dashed" : "dotted") : "solid"} ${colour}`;
  return node;
}
