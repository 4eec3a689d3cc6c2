// Scenes and methods of one experiment crossed: Table 1 as the paper prints it, or one measure. Errors beside every time.

function viewTable(host) {
  const names = unique(shown(["exp"]).map((p) => p.folder)).filter((name) => !state.exp.length || state.exp.includes(name));
  if (!names.length) { host.append(nothing()); return; }
  const folder = names.includes(state.t) ? state.t : names.includes("table1") ? "table1" : names[0];
  const own = shown(["exp"]).filter((p) => p.folder === folder);
  const first = folderOf(folder);
  const paperLike = first.experiment === "table1";
  const bases = basesOf(folder);
  const measures = [...(paperLike ? [["paper", "as the paper's Table 1"]] : []), ...Object.keys(MEASURES).filter((m) => own.some((p) => valueOf(p, m) !== null)).map((m) => [m, measureTitle(m)]),
    ...bases.map((base) => [`ratio:${base}`, `time over that of ${base}`])];
  const measure = measures.some(([m]) => m === state.m) ? state.m : measures[0][0];
  const methods = unique(own.map((p) => p.name));
  const across = state.flip ? methods.length > 10 : methods.length <= 10;
  const places = unique(own.map((p) => p.where + "\n" + p.size));
  const cells = new Map(own.map((p) => [`${p.where}\n${p.size}\n${p.name}`, p]));
  const sizes = unique(own.map((p) => p.size)).length > 1;
  const placeName = (place) => (sizes ? place.replace("\n", ", ") : place.split("\n")[0]);
  const lines = across ? places : methods;
  const heads = across ? methods : places;
  const at = (line, head) => cells.get(across ? `${line}\n${head}` : `${head}\n${line}`);
  const best = bestOf(places, methods, cells);
  const value = (p) => (!p ? null : measure.startsWith("ratio:") ? ratioOf(p, measure.slice(6))?.ratio ?? null : measure === "paper" ? p.total_ms : valueOf(p, measure));
  const text = (p) => (measure.startsWith("ratio:") ? ratioText(value(p)) : measure === "paper" ? number(p.total_ms) : MEASURES[measure].text(value(p)));
  const timed = measure === "paper" || measure.endsWith("_ms") || measure.startsWith("ratio:");
  const plainText = (p) => (!p ? "–" : !p.done ? p.status : measure === "paper" ? `${number(p.build_ms)} / ${number(p.trace_ms)}; ${number(p.total_ms)} ${p.error}${p.earlier ? " †" : ""}` : `${text(p)}${timed || measure === "frame_mrays_per_s" ? ` ${p.error}` : ""}${p.earlier ? " †" : ""}`);
  const shares = barShares(lines, heads, at, value, across);
  const cellNode = (p) => {
    if (!p) return "–";
    if (!p.done) return el("i", {}, p.status);
    if (measure !== "paper") return el("span.cell", {}, el("span", {}, text(p)), mark(p));
    return el("span.cell.two", {}, el("span.parts", {}, `${number(p.build_ms)} / ${number(p.trace_ms)}`), el("span", {}, number(p.total_ms), " ", mark(p)));
  };
  const lineColumn = { key: "line", title: across ? "scene" : "method", text: (line) => (across ? placeName(line) : line), csv: (line) => (across ? placeName(line) : line),
    tip: (line) => { const p = own.find((one) => (across ? one.where === line.split("\n")[0] : one.name === line)); return across ? [p.where, ["triangles", whole(p.triangles)], isStandIn(p) && ["stand-in", p.stand_in]].filter(Boolean) : [p.name, ["method", p.method_title], ["settings", p.settings]]; } };
  const columns = [lineColumn, ...heads.map((head) => ({
    key: across ? head : placeName(head), title: across ? head : placeName(head), numeric: "up", point: (line) => at(line, head), value: (line) => value(at(line, head)), text: (line) => plainText(at(line, head)),
    node: (line) => cellNode(at(line, head)), tip: (line) => { const p = at(line, head); return p && [...pointLines(p), ...ratioLines(p, measure)]; },
    className: (line) => { const p = at(line, head); return p ? [best.has(p.id) && timed ? "is-best" : "", ""].join(" ").trim() : "empty"; },
    style: (line) => shares(at(line, head)),
  }))];
  if (paperLike && across && measure === "paper") {
    DATA.paper.columns.forEach(([key, title, source], i) => columns.push({
      key: `paper.${key}`, title, group: DATA.paper.label, numeric: "up", value: (line) => { const p = own.find((one) => one.where === line.split("\n")[0]); return parseFloat(DATA.paper.rows[p.scene]?.[i]?.split("/").at(-1)) || null; },
      text: (line) => { const p = own.find((one) => one.where === line.split("\n")[0]); return DATA.paper.rows[p.scene]?.[i] ?? "–"; }, tip: () => [`The paper's own number, ${DATA.paper.label}`, source] }));
  }
  host.append(el("div.controls", {},
    select("Experiment", names.map((name) => [name, `${name} · ${folderOf(name).title}`]), folder, (one) => change({ t: one, m: "", "table.sort": "" }), { "data-focus": "t" }),
    select("Show", measures, measure, (one) => change({ m: one }), { "data-focus": "m" }),
    toggle(across ? "methods down" : "scenes down", Boolean(state.flip), (on) => change({ flip: on ? "1" : "" }), { "data-focus": "flip" })));
  // As a file: each number in a column of its own, and beside it how many answers are wrong.
  const forCsv = columns.flatMap((column) => (column.key === "line" || column.group ? [column] : [
    { ...column, title: `${column.title}, ${measure === "paper" ? measureTitle("total_ms") : measure.startsWith("ratio:") ? "ratio" : measureTitle(measure)}`, csv: column.value },
    { ...column, title: `${column.title}, wrong answers`, csv: (line) => { const p = column.point(line); return p && (p.done ? p.true_errors ?? "unscored" : p.status); } }]));
  const caption = `${first.title}: ${measures.find(([m]) => m === measure)[1]}. ${first.where}.`;
  const note = [measure === "paper" ? "Build / trace of primary rays in ms, then the whole frame with shadows in ms and its answers." : measure.startsWith("ratio:") ? "Ratios over frames that both have, within one run; a dash: the two may not be compared." : "",
    "✓ no wrong answer, ✗ how many are wrong over all frames, unscored: nothing is known of the answers. Bold: the fastest of its scene without a wrong answer.",
    paperLike && across && measure === "paper" ? `Columns under "${DATA.paper.label}" are the paper's own numbers. ${DATA.paper.footnotes.join(" ")}` : "", own.some((p) => p.earlier) ? "† of an earlier version of the method than other records here." : "", first.effort].filter(known).join(" ");
  host.append(section(first.title, savers(columns, ordered(columns, lines, "table"), `${folder}-${measure.replace(/\W+/g, "-")}`, caption, forCsv),
    first.finding && el("p.finding", {}, first.finding), grid(columns, lines, { caption, name: "table", note,
      open: (line, column) => { const p = at(line, heads.find((head) => column.key === (across ? head : placeName(head)))); if (p) openDetails(p); } })));
  figuresOf(folder, host);
}

function ratioLines(p, measure) {
  if (!measure.startsWith("ratio:")) return [];
  const found = ratioOf(p, measure.slice(6));
  return found ? [[`over ${measure.slice(6)}`, `${ratioText(found.ratio)} (${ratioText(found.low)} to ${ratioText(found.high)} between rounds, ${found.frames} frame${found.frames === 1 ? "" : "s"})`]] : ["No pair: another run, or no frame in common."];
}

/** Of each scene the fastest point without a wrong answer, where all were measured in one run over the same frames. */
function bestOf(places, methods, cells) {
  const found = new Set();
  for (const place of places) {
    const done = methods.map((name) => cells.get(`${place}\n${name}`)).filter((p) => p?.done);
    const alike = unique(done.map((p) => p.run)).length === 1 && unique(done.map((p) => JSON.stringify(p.frame_numbers))).length === 1;
    const right = done.filter((p) => p.error === "✓");
    if (alike && right.length > 1) found.add(right.reduce((a, b) => (b.total_ms < a.total_ms ? b : a)).id);
  }
  return found;
}

/** A bar behind each number: its place between the least and the most of its scene. */
function barShares(lines, heads, at, value, across) {
  const log = (state.scale || "log") === "log";
  const ends = new Map();
  const groups = across ? lines.map((line) => [line, heads.map((head) => at(line, head))]) : heads.map((head) => [head, lines.map((line) => at(line, head))]);
  for (const [, row] of groups) {
    const numbers = row.map(value).filter((v) => v > 0);
    for (const p of row) if (p) ends.set(p.id, [Math.min(...numbers), Math.max(...numbers)]);
  }
  return (p) => {
    const v = p && p.done ? value(p) : null;
    if (!(v > 0)) return "";
    const [low, high] = ends.get(p.id);
    const share = log ? (high > low ? 0.08 + 0.92 * Math.log(v / low) / Math.log(high / low) : 1) : v / high;
    return `--share:${(100 * share).toFixed(1)}%;--tint:${colourOf(p.method)}`;
  };
}

const filtered = () => Object.keys(FILTERS).some((key) => state[key].length) || Boolean(state.q);

/** In place of a view that has nothing to show: because of the filters, or because `lacking` is not in the results. */
const nothing = (lacking = "Nothing was measured.") => (!filtered() ? el("p.empty-note", {}, lacking) : el("p.empty-note", {}, "No row matches the filters. ", el("button.small", { type: "button", onclick: () => change({ exp: [], scene: [], method: [], device: [], q: "" }) }, "Clear filters")));

/** The drawings of a folder, opened where asked for. */
function figuresOf(folder, host) {
  const found = DATA.figures.filter((one) => one.folder === folder);
  if (found.length) host.append(section("Drawings", null, found.map(figure)));
}

function figure(one) {
  const box = el("div.drawing");
  return el("details.figure", { ontoggle: (event) => { if (event.target.open && !box.firstChild) box.append(el("img", { src: one.uri, alt: `${one.name} of ${one.folder}` })); } },
    el("summary", {}, el("span", {}, `${one.folder} / ${one.name}`)), box);
}
