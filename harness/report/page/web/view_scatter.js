// Errors against time: every method of one scene, and the front of those that none beats in both.

function viewScatter(host) {
  const choices = foldersShown().filter((name) => shown(["exp"]).some((p) => p.folder === name && judged(p)));
  if (!choices.length) { host.append(nothing("No point has both a time and judged answers.")); return; }
  const folder = choices.includes(state.s) ? state.s : choices[0];
  const own = shown(["exp"]).filter((p) => p.folder === folder && judged(p));
  const name = (p) => `${p.where}, ${p.size}`;
  const scenes = unique(own.map(name));
  const scene = scenes.includes(state.ss) ? state.ss : scenes[0];
  const rows = own.filter((p) => name(p) === scene).sort((a, b) => a.total_ms - b.total_ms);
  // What ties with the fastest within the spread of the repeats is on it too.
  const front = new Set(rows.filter((p) => p.best || !rows.some((q) => q.total_ms <= p.total_ms && q.wrong_per_frame <= p.wrong_per_frame && (q.total_ms < p.total_ms || q.wrong_per_frame < p.wrong_per_frame))));
  const x = percentAxis(rows.map((p) => p.total_ms)), y = percentAxis([...rows.map((p) => p.wrong_per_frame), 1], true);
  const at = (p) => ({ left: x.place(p.total_ms), bottom: y.place(p.wrong_per_frame) });
  host.append(el("div.controls", {}, folderChoice(choices, folder, (s) => change({ s, ss: "" })), select("Scene", scenes, scene, (ss) => change({ ss }), { "data-focus": "ss" })));
  // Of those at one place the first is named, so that no two names lie on each other.
  const labelled = (p) => front.has(p) && ![...front].some((q) => rows.indexOf(q) < rows.indexOf(p) && Math.hypot(at(p).left - at(q).left, at(p).bottom - at(q).bottom) < 12);
  const columns = [
    { key: "name", title: "method", text: (p) => p.name, node: (p) => el("span.key", {}, swatch(p.method), p.name), tip: pointLines },
    { key: "total_ms", title: "frame, ms", numeric: "up", value: (p) => p.total_ms, text: (p) => textOf(p, "total_ms"), csv: (p) => p.total_ms, bold: (p) => p.best, className: (p) => (p.best ? "is-best" : "") },
    { key: "wrong", title: "wrong a frame", numeric: "up", value: (p) => p.wrong_per_frame, text: (p) => textOf(p, "wrong_per_frame"), csv: (p) => p.wrong_per_frame, className: (p) => (p.bad ? "is-wrong" : "") },
    { key: "front", title: "front", text: (p) => (front.has(p) ? "on it" : "–") }];
  const valid = folderOf(folder).valid;
  host.append(section(`${folderOf(folder).title}: errors against time`, savers(columns, ordered(columns, rows, "scatter"), `${folder}-errors`.replace(/\W+/g, "-"), `Errors against time, ${scene}`, { notes: valid }),
    el("div.split", {}, el("div.stay", {}, el("div.scatter", { role: "group", "aria-label": `Wrong answers a frame against ms a frame, ${scene}` },
      el("div.plane", {}, tickMarks(x, "x"), tickMarks(y, "y"), frontLine([...front].map(at)), rows.map((p) => dot(p, at(p), labelled(p) ? p.name : ""))), el("p.axis-title", {}, "ms a frame →")),
    el("p.note", {}, "Upwards: wrong answers a frame; on the lowest line none is wrong. The line is the front: nothing is both faster and less wrong.")),
    grid(columns, rows, { caption: `${scene}, fastest first`, name: "scatter", open: openDetails, valid, notes: marksIn(rows.map((p) => textOf(p, "total_ms"))) }))));
}

const judged = (p) => p.done && p.total_ms > 0 && p.wrong_per_frame !== null;

/** The front as a stair through its points, from the fastest on. */
function frontLine(points) {
  const steps = points.flatMap(({ left, bottom }, i) => [...(i ? [[left, 100 - points[i - 1].bottom]] : [[left, 0]]), [left, 100 - bottom]]);
  if (points.length) steps.push([100, 100 - points.at(-1).bottom]);
  const svg = document.createElementNS("http://www.w3.org/2000/svg", "svg");
  svg.setAttribute("viewBox", "0 0 100 100");
  svg.setAttribute("preserveAspectRatio", "none");
  svg.setAttribute("class", "front");
  const line = document.createElementNS("http://www.w3.org/2000/svg", "polyline");
  line.setAttribute("points", steps.map((p) => p.join(",")).join(" "));
  svg.append(line);
  return svg;
}
