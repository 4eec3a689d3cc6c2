// Scenes and methods of one experiment crossed: Table 1 as the paper prints it, or one measure. Errors beside every time.

/** The folders that the filters leave, in the order of interest. */
const foldersShown = () => unique(shown(["exp"]).map((p) => p.folder)).filter((name) => !state.exp.length || state.exp.includes(name));
const folderChoice = (names, chosen, then) => select("Experiment", names.map((name) => [name, `${name} · ${folderOf(name).title}`]), chosen, then, { "data-focus": "folder" });

function viewTable(host) {
  const names = foldersShown();
  if (!names.length) { host.append(nothing()); return; }
  const folder = names.includes(state.t) ? state.t : names[0];
  const own = shown(["exp"]).filter((p) => p.folder === folder);
  const first = folderOf(folder);
  const paperLike = first.experiment === "table1";
  const measures = [...(paperLike ? [["paper", "as the paper's Table 1"]] : []), ...Object.keys(MEASURES).filter((m) => own.some((p) => valueOf(p, m) !== null)).map((m) => [m, measureTitle(m)]),
    ...basesOf(folder).map((base) => [`ratio:${base}`, `time over that of ${base}`])];
  const measure = measures.some(([m]) => m === state.m) ? state.m : measures[0][0];
  const base = measure.startsWith("ratio:") ? measure.slice(6) : "";
  const timed = measure === "paper" || base || measure.endsWith("_ms") || measure === "frame_mrays_per_s";
  const methods = unique(own.map((p) => p.name));
  const rows = ["scenes", "methods"].includes(state.rows) ? state.rows : methods.length <= 10 ? "scenes" : "methods";
  const across = rows === "scenes";
  const places = unique(own.map((p) => `${p.where}\n${p.size}`));
  const cells = new Map(own.map((p) => [`${p.where}\n${p.size}\n${p.name}`, p]));
  const sizes = unique(own.map((p) => p.size)).length > 1;
  const placeName = (place) => (sizes ? place.replace("\n", ", ") : place.split("\n")[0]);
  const lines = across ? places : methods, heads = across ? methods : places;
  const at = (line, head) => cells.get(across ? `${line}\n${head}` : `${head}\n${line}`);
  const value = (p) => (!p ? null : base ? ratioOf(p, base)?.ratio ?? null : measure === "paper" ? p.total_ms : valueOf(p, measure));
  const text = (p) => (base ? ratioOf(p, base)?.text ?? "–" : textOf(p, measure === "paper" ? "total_ms" : measure));
  const parts = (p) => `${textOf(p, "build_ms")} / ${textOf(p, "trace_ms")}`;
  const plainText = (p) => (!p ? "–" : !p.done ? p.status : `${measure === "paper" ? `${parts(p)}; ` : ""}${text(p)}${timed ? ` ${p.error}` : ""}${p.earlier ? " †" : ""}`);
  const shares = barShares(lines, heads, at, value, across);
  const cellNode = (p) => {
    if (!p) return "–";
    if (!p.done) return el("i", {}, p.status);
    if (measure !== "paper") return el("span.cell", {}, el("span", {}, text(p)), mark(p));
    return el("span.cell.two", {}, el("span.parts", {}, parts(p)), el("span", {}, text(p), " ", mark(p)));
  };
  const ofLine = (line) => own.find((one) => (across ? one.where === line.split("\n")[0] : one.name === line));
  const lineColumn = { key: "line", title: across ? "scene" : "method", text: (line) => (across ? placeName(line) : line),
    tip: (line) => { const p = ofLine(line); return across ? [p.where, ["triangles", whole(p.triangles)], isStandIn(p) && ["stand-in", p.stand_in]].filter(Boolean) : [p.name, ["method", p.method_title], ["settings", p.settings]]; } };
  const columns = [lineColumn, ...heads.map((head) => ({
    key: across ? head : placeName(head), title: across ? head : placeName(head), head, numeric: "up", point: (line) => at(line, head), value: (line) => value(at(line, head)), text: (line) => plainText(at(line, head)),
    node: (line) => cellNode(at(line, head)), tip: (line) => { const p = at(line, head); return p && [...pointLines(p), ...ratioLines(p, base)]; },
    bold: (line) => timed && Boolean(at(line, head)?.best), className: (line) => { const p = at(line, head); return !p ? "empty" : p.best && timed ? "is-best" : ""; },
    style: (line) => shares(at(line, head)),
  }))];
  if (paperLike && across && measure === "paper") {
    DATA.paper.columns.forEach(([key, title, source], i) => columns.push({
      key: `paper.${key}`, title, group: DATA.paper.label, numeric: "up", value: (line) => parseFloat(DATA.paper.rows[ofLine(line).scene]?.[i]?.split("/").at(-1)) || null,
      text: (line) => DATA.paper.rows[ofLine(line).scene]?.[i] ?? "–", tip: () => [`The paper's own number, ${DATA.paper.label}`, source] }));
  }
  host.append(el("div.controls", {},
    folderChoice(names, folder, (one) => change({ t: one, m: "", "table.sort": "" })),
    select("Show", measures, measure, (one) => change({ m: one }), { "data-focus": "m" }),
    select("Rows", ["scenes", "methods"], rows, (one) => change({ rows: one }), { "data-focus": "rows" })));
  // As a file: each number in a column of its own, and beside it how many answers are wrong.
  const forCsv = columns.flatMap((column) => (column.key === "line" || column.group ? [column] : [
    { ...column, title: `${column.title}, ${measure === "paper" ? measureTitle("total_ms") : base ? "ratio" : measureTitle(measure)}`, csv: column.value },
    { ...column, title: `${column.title}, wrong answers`, csv: (line) => { const p = column.point(line); return p && (p.done ? p.true_errors ?? "unscored" : p.status); } }]));
  const caption = `${first.title}: ${measures.find(([m]) => m === measure)[1]}. ${first.where}.`;
  const notes = [measure === "paper" && "Build / trace of primary rays in ms, then the whole frame with shadows in ms and its answers.", base && "Ratios over frames that both have, within one run; a dash: the two may not be compared.",
    timed && "✓ no wrong answer, ✗ how many are wrong over all frames, unscored: nothing is known of the answers. Bold: the fastest of its scene without a wrong answer, and what ties with it within the spread of the repeats.",
    paperLike && across && measure === "paper" && `Columns under "${DATA.paper.label}" are the paper's own numbers. ${DATA.paper.footnotes.join(" ")}`, own.some((p) => p.earlier) && "† of an earlier version of the method than other records here.",
    ...marksIn(own.flatMap((p) => (p.done ? [text(p), measure === "paper" ? parts(p) : ""] : [])))].filter(Boolean);
  host.append(section(first.title, savers(columns, ordered(columns, lines, "table"), `${folder}-${measure}`.replace(/\W+/g, "-"), caption, { csv: forCsv, notes: [...notes, ...first.valid] }),
    first.finding && el("p.finding", {}, first.finding), grid(columns, lines, { caption, name: "table", notes, valid: first.valid,
      open: (line, column) => { const p = column.point?.(line); if (p) openDetails(p); } })));
  figuresOf(folder, host);
}

function ratioLines(p, base) {
  const found = base && ratioOf(p, base);
  if (!base) return [];
  return found ? [[`over ${base}`, `${found.text} (${found.low} to ${found.high} between rounds, ${found.frames} frame${found.frames === 1 ? "" : "s"})`]] : ["No pair: another run, or no frame in common."];
}

/** A bar behind each number: its place between the least and the most of its scene. */
function barShares(lines, heads, at, value, across) {
  const log = (state.scale || "log") === "log";
  const ends = new Map();
  const groups = across ? lines.map((line) => heads.map((head) => at(line, head))) : heads.map((head) => lines.map((line) => at(line, head)));
  for (const row of groups) {
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
const nothing = (lacking = "Nothing was measured.") => (!filtered() ? el("p.empty-note", {}, lacking) : el("p.empty-note", {}, "No row matches the filters. ", el("button.small", { type: "button", onclick: clear }, "Clear filters")));

/** The drawings of a folder, opened where asked for. */
function figuresOf(folder, host) {
  const found = DATA.figures.filter((one) => one.folder === folder);
  if (found.length) host.append(section("Drawings", null, found.map(figure)));
}

function figure(one) {
  const box = el(`div.drawing${one.name.endsWith(".svg") ? ".lines" : ""}`);
  return el("details.figure", { ontoggle: (event) => { if (event.target.open && !box.firstChild) box.append(el("img", { src: one.uri, alt: `${one.name} of ${one.folder}` })); } },
    el("summary", {}, el("span", {}, `${one.folder} / ${one.name}`)), box);
}
