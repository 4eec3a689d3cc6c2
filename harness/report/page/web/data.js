// The data of the page: rows from columns, the names that rows have, and the ratios that were made with them.

const DATA = JSON.parse($("#data").textContent);

function rowsOf(packed) {
  const names = Object.keys(packed.columns);
  const lists = names.map((name) => {
    const values = packed.columns[name];
    return Array.isArray(values) ? values : values.i.map((i) => (i === null ? null : values.d[i]));
  });
  return Array.from({ length: packed.rows }, (_, row) => Object.fromEntries(names.map((name, i) => [name, lists[i][row]])));
}

const points = rowsOf(DATA.points);
const folders = DATA.folders;
const folderOf = (name) => folders.find((one) => one.name === name);

const framesOf = new Map();
for (const frame of rowsOf(DATA.frames)) {
  if (!framesOf.has(frame.point)) framesOf.set(frame.point, []);
  framesOf.get(frame.point).push(frame);
}

// Ratios were made over frames that both points have, within one run; where there is none, the two may not be compared.
const ratios = new Map();
for (const one of rowsOf(DATA.ratios)) {
  const key = `${one.folder}\n${one.base}`;
  if (!ratios.has(key)) ratios.set(key, new Map());
  ratios.get(key).set(one.point, one);
}
const basesOf = (folder) => [...ratios.keys()].filter((key) => key.startsWith(`${folder}\n`)).map((key) => key.split("\n")[1]);
const ratioOf = (point, base) => ratios.get(`${point.folder}\n${base}`)?.get(point.id) || null;

const isStandIn = (point) => known(point.stand_in);
points.forEach((point, id) => {
  point.id = id;
  point.done = point.status === "ok" && point.total_ms !== null;
  point.bad = (point.error || "").startsWith("✗");
  point.size = `${point.width}×${point.height}`;
  point.where = [point.title, point.light_label].filter(known).join(", ");
});
{
  // The name of a column: its label, with whatever else tells apart two points of one scene in one folder.
  const several = new Map();
  for (const p of points) {
    const key = `${p.folder}\n${p.label}\n${p.where}\n${p.size}`;
    p.entry = key;
    if (!several.has(key)) several.set(key, { settings: new Set(), device: new Set() });
    several.get(key).settings.add(p.settings);
    several.get(key).device.add(p.device);
  }
  for (const p of points) {
    const { settings, device } = several.get(p.entry);
    p.name = p.label + (settings.size > 1 && p.settings !== "-" ? `, ${p.settings}` : "") + (device.size > 1 ? `, ${p.device}` : "");
  }
}

const FILTERS = {
  exp: { title: "Experiment", of: (p) => p.folder },
  scene: { title: "Scene", of: (p) => p.title },
  method: { title: "Method", of: (p) => p.method },
  machine: { title: "Machine", of: (p) => p.machine },
  device: { title: "Device", of: (p) => p.device_name || p.device },
};

/** The points that the filters leave; `but`: a filter that does not count here. */
function shown(but = []) {
  const words = (state.q || "").toLowerCase().split(/\s+/).filter(Boolean);
  return points.filter((p) => Object.entries(FILTERS).every(([key, { of }]) =>
    but.includes(key) || !state[key].length || state[key].includes(of(p)))
    && words.every((word) => `${p.folder} ${p.where} ${p.name} ${p.method} ${p.settings} ${p.device_name} ${p.key}`.toLowerCase().includes(word)));
}

// What can be shown of a point: how it is called, its unit. How it is written comes with the data.
const MEASURES = {
  total_ms: { title: "whole frame", unit: "ms" },
  build_ms: { title: "build", unit: "ms" },
  trace_ms: { title: "trace", unit: "ms" },
  light_build_ms: { title: "light build", unit: "ms" },
  shadow_ms: { title: "shadow", unit: "ms" },
  frame_mrays_per_s: { title: "rays", unit: "Mrays/s" },
  memory_bytes: { title: "memory", unit: "MB", scale: 1e-6 },
  wrong_per_frame: { title: "wrong answers", unit: "a frame" },
  flip: { title: "FLIP", unit: "" },
};
const counter = (measure) => (measure.startsWith("counter:") ? measure.slice(8) : "");
const valueOf = (row, measure) => {
  const value = counter(measure) ? row.counters[counter(measure)] : row[measure];
  return value === null || value === undefined ? null : value * (MEASURES[measure]?.scale || 1);
};
/** A number of a point or of one of its frames, as every table writes it. */
const textOf = (row, measure) => (counter(measure) ? whole(row.counters[counter(measure)]) : row[`text.${measure}`] ?? "–");
const measureTitle = (measure) => (measure.startsWith("counter:") ? measure.slice(8) : `${MEASURES[measure].title}${MEASURES[measure].unit ? `, ${MEASURES[measure].unit}` : ""}`);

/** What must be known of the numbers of folders before they are compared: beside every table and drawing of them. */
function validity(names) {
  const several = names.length > 1;
  return unique(names).flatMap((name) => folderOf(name).valid.map((line) => (several ? `${name}: ${line}` : line)));
}
const marksIn = (texts) => DATA.marks.filter(([pattern]) => texts.some((text) => new RegExp(pattern).test(text))).map(([, meaning]) => meaning);

/** What a tooltip says of a point: its time with its spread, its answers, where it is from. */
function pointLines(p, frame = null) {
  const t = frame || p;
  const lines = [`${p.name} · ${p.where}`];
  if (!p.done) return [...lines, `${p.status}: ${p.reason || "no reason given"}`];
  const which = frame ? `frame ${frame.frame}` : p.frames > 1 ? `mean of ${p.frames} frames` : "median";
  lines.push([`whole frame, ${which}`, `${textOf(t, "total_ms")} ms`]);
  if (t.samples > 1) lines.push(["quartiles", `${textOf(t, "q1_ms")} to ${textOf(t, "q3_ms")} ms`]);
  if (!frame && p.rounds > 1) lines.push(["range between rounds", `${textOf(p, "between_ms")} ms`]);
  lines.push(["samples", `${whole(t.samples)}${frame ? "" : ` in ${p.rounds} round${p.rounds === 1 ? "" : "s"}`}`]);
  lines.push(["answers", t.error + (t.error === "unscored" && p.unscored ? `: ${p.unscored}` : "")]);
  lines.push(["size, device", `${p.size}, ${p.device_name || p.device}`], ["folder", p.folder]);
  if (isStandIn(p)) lines.push(["stand-in for", p.stand_in.replace(/^procedural stand-in for /i, "")]);
  if (p.earlier) lines.push("Of an earlier version of the method.");
  if (p.known_inexact) lines.push(`Declares itself inexact: ${p.known_inexact}`);
  return lines;
}

const inTheDark = () => (document.documentElement.dataset.theme || (matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "")) === "dark";
/** A colour of the project's drawings; on a dark page mixed with white, so that lines stand out. */
function seen(hex) {
  if (!inTheDark()) return hex;
  const mixed = [1, 3, 5].map((i) => Math.round(0.68 * parseInt(hex.slice(i, i + 2), 16) + 0.32 * 255));
  return `#${mixed.map((v) => v.toString(16).padStart(2, "0")).join("")}`;
}
const colourOf = (method) => seen(DATA.colours[method] || "#777777");
