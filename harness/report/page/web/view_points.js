// Every point in one table, with its time as a bar on one axis; on request with everything that its record names.

function viewPoints(host) {
  const rows = shown();
  if (!rows.length) { host.append(nothing()); return; }
  const log = (state.scale || "log") === "log";
  const times = rows.filter((p) => p.done && p.total_ms > 0).map((p) => p.total_ms);
  const low = log ? Math.min(...times) / 1.15 : 0, high = Math.max(...times) * (log ? 1.15 : 1.02);
  const place = (ms) => Math.max(0, Math.min(100, 100 * (log ? Math.log(Math.max(ms, low) / low) / Math.log(high / low) : ms / high)));
  const measured = (key, title, numeric = "up") => ({ key, title, numeric, value: (p) => valueOf(p, key), text: (p) => textOf(p, key), csv: (p) => valueOf(p, key) });
  const counted = (key) => ({ key, title: key, numeric: "up", value: (p) => p[key], text: (p) => whole(p[key]), csv: (p) => p[key] });
  const plain = (key, title, text = (p) => p[key] || "–") => ({ key, title, text });
  const hash = (key, title) => ({ ...plain(key, title), node: (p) => el("code", {}, (p[key] || "–").slice(0, 12)), tip: (p) => [title, p[key] || "not known"] });
  const commit = (p) => DATA.environments[p.environment]?.git?.commit || "–";
  const all = Boolean(state["points.wide"]);
  const columns = [
    { key: "where", title: "scene", text: (p) => p.where, tip: (p) => [p.where, ["triangles", whole(p.triangles)], isStandIn(p) ? ["stand-in", p.stand_in] : ["source", p.source_file || "procedural"]] },
    { key: "name", title: "method", className: () => "name", text: (p) => p.name + (p.earlier ? " †" : ""), node: (p) => el("span.key", {}, swatch(p.method), p.name, p.earlier && el("em.old", {}, "†")), tip: (p) => [p.method_title, ["settings", p.settings], ["version", (p.method_sha256 || "").slice(0, 12)]] },
    plain("folder", "experiment"),
    { key: "bar", title: `ms, ${log ? "log" : "linear"}`, fixed: true, screen: true, text: () => "", node: (p) => timeBar(p, place), tip: (p) => pointLines(p) },
    { key: "total_ms", title: "frame, ms", numeric: "up", value: (p) => (p.done ? p.total_ms : null), text: (p) => (p.done ? `${textOf(p, "total_ms")} ${p.error}` : p.status), csv: (p) => p.total_ms,
      node: (p) => (p.done ? el("span.cell", {}, el("span", {}, textOf(p, "total_ms")), mark(p)) : el("i", {}, p.status)), tip: (p) => pointLines(p), bold: (p) => p.best, className: (p) => (p.best ? "is-best" : "") },
    measured("spread", "± ms"),
    { key: "true_errors", title: "wrong", numeric: "down", value: (p) => p.true_errors, text: (p) => (p.true_errors === null ? (p.done ? "unscored" : "–") : whole(p.true_errors)), csv: (p) => p.true_errors, className: (p) => (p.bad ? "is-wrong" : "") },
    ...(all ? ["build_ms", "trace_ms", "light_build_ms", "shadow_ms"].map((key) => measured(key, measureTitle(key))) : []),
    measured("frame_mrays_per_s", "Mrays/s", "down"),
    measured("memory_bytes", "MB"),
    { ...plain("size", "size"), value: (p) => p.pixels },
    { key: "device", title: "device", text: (p) => p.device_name || p.device, className: () => "nowrap" },
    ...(all ? [
      ...["lights", "frames", "rounds", "samples", "triangles"].map(counted), plain("settings", "settings"),
      plain("stand", "scene is", (p) => (isStandIn(p) ? "a stand-in" : p.source_file ? "a file" : "procedural")), hash("scene_sha256", "scene's arrays"),
      plain("version", "version", (p) => (p.earlier ? "earlier" : "latest here")), hash("method_sha256", "method's source"),
      { ...plain("started", "measured, UTC", (p) => (p.started ? new Date(1000 * p.started).toISOString().slice(0, 16).replace("T", " ") : "–")), value: (p) => p.started },
      hash("run", "run"), hash("environment", "environment"), { ...plain("commit", "commit", commit), node: (p) => el("code", {}, commit(p).slice(0, 10)) }, hash("key", "record")] : []),
  ];
  const valid = validity(rows.map((p) => p.folder));
  const notes = ["± : half the interquartile range of repeats or half the range between rounds, whichever is larger. † of an earlier version of the method than other records here. Bold: the fastest of its scene without a wrong answer. Enter or a click on a row shows everything that its record has.", ...marksIn(rows.map((p) => textOf(p, "total_ms")))];
  host.append(section(`${whole(rows.length)} points`, el("div.aside", {}, toggle("all columns", all, (on) => change({ "points.wide": on ? "1" : "" }), { "data-focus": "wide" }), savers(columns, ordered(columns, rows, "points"), "points", `Points of ${DATA.title}`, { notes: valid })),
    grid(columns, rows, { caption: "Points: one method with its settings on one scene, size, light and device", name: "points", open: openDetails, valid, notes })));
}

const swatch = (method) => { const node = el("i.swatch", { "aria-hidden": "true" }); node.style.background = colourOf(method); return node; };

/** The time as a bar, its quartiles as a whisker, hatched where answers are wrong. */
function timeBar(p, place) {
  const box = el("span.time", { role: "img", "aria-label": p.done ? `${textOf(p, "total_ms")} ms` : p.status });
  if (!p.done) return box;
  const bar = el(`i.fill${p.bad ? ".bad" : ""}`), whisker = el("i.whisker");
  bar.style.width = `${place(p.total_ms)}%`;
  bar.style.background = colourOf(p.method);
  whisker.style.left = `${place(p.q1_ms)}%`;
  whisker.style.width = `${Math.max(0, place(p.q3_ms) - place(p.q1_ms))}%`;
  box.append(bar, whisker);
  return box;
}
