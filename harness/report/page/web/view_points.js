// Every point in one table, with its time as a bar on one axis.

function viewPoints(host) {
  const rows = shown();
  if (!rows.length) { host.append(nothing()); return; }
  const log = (state.scale || "log") === "log";
  const times = rows.filter((p) => p.done && p.total_ms > 0).map((p) => p.total_ms);
  const low = log ? Math.min(...times) / 1.15 : 0, high = Math.max(...times) * (log ? 1.15 : 1.02);
  const place = (ms) => Math.max(0, Math.min(100, 100 * (log ? Math.log(Math.max(ms, low) / low) / Math.log(high / low) : ms / high)));
  const ms = (key) => ({ key, title: `${MEASURES[key].title}, ms`, numeric: "up", value: (p) => p[key], text: (p) => number(p[key]), csv: (p) => p[key],
    tip: (p) => [`${MEASURES[key].title}: ${number(p[key])} ms`, ["half its interquartile range", `${number(MEASURES[key].spread(p))} ms`]] });
  const all = Boolean(state["points.wide"]);
  const columns = [
    { key: "where", title: "scene", text: (p) => p.where, tip: (p) => [p.where, ["triangles", whole(p.triangles)], isStandIn(p) ? ["stand-in", p.stand_in] : ["source", p.source_file || "procedural"]] },
    { key: "name", title: "method", text: (p) => p.name + (p.earlier ? " †" : ""), node: (p) => el("span.key", {}, swatch(p.method), p.name, p.earlier && el("em.old", {}, "†")), tip: (p) => [p.method_title, ["settings", p.settings], ["version", (p.method_sha256 || "").slice(0, 12)]] },
    { key: "folder", title: "experiment", text: (p) => p.folder },
    { key: "bar", title: `ms, ${log ? "log" : "linear"}`, fixed: true, screen: true, text: () => "", node: (p) => timeBar(p, place), tip: (p) => pointLines(p) },
    { key: "total_ms", title: "frame, ms", numeric: "up", value: (p) => (p.done ? p.total_ms : null), text: (p) => (p.done ? `${number(p.total_ms)} ${p.error}` : p.status), csv: (p) => p.total_ms,
      node: (p) => (p.done ? el("span.cell", {}, el("span", {}, number(p.total_ms)), mark(p)) : el("i", {}, p.status)), tip: (p) => pointLines(p) },
    { key: "spread", title: "± ms", numeric: "up", value: (p) => p.spread, text: (p) => number(p.spread), csv: (p) => p.spread },
    { key: "true_errors", title: "wrong", numeric: "down", value: (p) => p.true_errors, text: (p) => (p.true_errors === null ? (p.done ? "unscored" : "–") : whole(p.true_errors)), csv: (p) => p.true_errors, className: (p) => (p.bad ? "is-wrong" : "") },
    ...(all ? ["build_ms", "trace_ms", "light_build_ms", "shadow_ms"].map(ms) : []),
    { key: "frame_mrays_per_s", title: "Mrays/s", numeric: "down", value: (p) => p.frame_mrays_per_s, text: (p) => number(p.frame_mrays_per_s), csv: (p) => p.frame_mrays_per_s },
    { key: "memory", title: "MB", numeric: "up", value: (p) => p.memory_bytes, text: (p) => number(valueOf(p, "memory_bytes")), csv: (p) => valueOf(p, "memory_bytes") },
    { key: "size", title: "size", text: (p) => p.size, value: (p) => p.pixels },
    { key: "device", title: "device", text: (p) => p.device_name || p.device, className: () => "nowrap" },
    ...(all ? [
      { key: "lights", title: "lights", numeric: "up", value: (p) => p.lights, text: (p) => whole(p.lights) },
      { key: "frames", title: "frames", numeric: "up", value: (p) => p.frames, text: (p) => whole(p.frames) },
      { key: "rounds", title: "rounds", numeric: "up", value: (p) => p.rounds, text: (p) => whole(p.rounds) },
      { key: "samples", title: "samples", numeric: "up", value: (p) => p.samples, text: (p) => whole(p.samples) },
      { key: "triangles", title: "triangles", numeric: "up", value: (p) => p.triangles, text: (p) => whole(p.triangles), csv: (p) => p.triangles },
      { key: "settings", title: "settings", text: (p) => p.settings },
      { key: "version", title: "method's source", text: (p) => (p.method_sha256 || "").slice(0, 12) },
      { key: "environment", title: "environment", text: (p) => p.environment },
      { key: "key", title: "record", text: (p) => p.key }] : []),
  ];
  host.append(section(`${whole(rows.length)} points`, el("div.aside", {}, toggle("all columns", all, (on) => change({ "points.wide": on ? "1" : "" }), { "data-focus": "wide" }), savers(columns, ordered(columns, rows, "points"), "points", `Points of ${DATA.title}`)),
    grid(columns, rows, { caption: "Points: one method with its settings on one scene, size, light and device", name: "points", open: openDetails,
      note: "± : half the interquartile range of repeats or half the range between rounds, whichever is larger. † of an earlier version of the method than other records here. Enter or a click on a row shows everything that its record has." })));
}

const swatch = (method) => { const node = el("i.swatch", { "aria-hidden": "true" }); node.style.background = colourOf(method); return node; };

/** The time as a bar, its quartiles as a whisker, wrong answers in red. */
function timeBar(p, place) {
  const box = el("span.time", { role: "img", "aria-label": p.done ? `${number(p.total_ms)} ms` : p.status });
  if (!p.done) return box;
  const bar = el(`i.fill${p.bad ? ".bad" : ""}`), whisker = el("i.whisker");
  bar.style.width = `${place(p.total_ms)}%`;
  bar.style.background = colourOf(p.method);
  whisker.style.left = `${place(p.q1_ms)}%`;
  whisker.style.width = `${Math.max(0, place(p.q3_ms) - place(p.q1_ms))}%`;
  box.append(bar, whisker);
  return box;
}
