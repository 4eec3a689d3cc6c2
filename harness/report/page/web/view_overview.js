// The answer first: what was found, the fastest of each kind of structure on each scene, then the experiments.

function viewOverview(host) {
  const own = shown();
  if (!own.length) { host.append(nothing()); return; }
  const lead = folders.find((f) => own.some((p) => p.folder === f.name && p.done));
  if (lead) host.append(finding(lead), kinds(own.filter((p) => p.folder === lead.name && p.done), lead));
  const columns = [
    { key: "title", title: "experiment", text: (f) => f.title, className: () => "title", node: (f) => el("a", { href: address({ view: "table", t: f.name, "table.sort": "", m: "" }) }, f.title) },
    { key: "finding", title: "finding", text: (f) => f.finding, className: () => "prose wide" },
    { key: "where", title: "measured at", text: (f) => f.where },
    { key: "points", title: "points", numeric: "down", value: (f) => f.done, text: (f) => whole(f.done) },
    { key: "wrong", title: "wrong", numeric: "down", value: (f) => f.wrong, text: (f) => whole(f.wrong), tip: (f) => [f.answers], className: (f) => (f.wrong ? "is-wrong" : "") },
    { key: "state", title: "version", text: (f) => (f.earlier === f.all ? "all of an earlier version" : f.earlier ? `${f.earlier} of ${f.all} of an earlier version` : "latest here"), className: (f) => (f.earlier ? "is-old" : "") },
    { key: "name", title: "folder", text: (f) => f.name, node: (f) => (DATA.addresses ? el("a", { href: `${f.name}/index.html` }, f.name) : f.name) },
  ];
  const rows = folders.map((f) => {
    const mine = own.filter((p) => p.folder === f.name);
    return { ...f, all: mine.length, done: mine.filter((p) => p.done).length, wrong: mine.filter((p) => p.bad).length, earlier: mine.filter((p) => p.earlier).length };
  }).filter((f) => f.all);
  host.append(section("Experiments", savers(columns, ordered(columns, rows, "overview"), "experiments", `Experiments of ${DATA.title}`),
    grid(columns, rows, { caption: "What was measured, the most asked for first. Wrong: points with wrong answers.", name: "overview" })));
  host.append(section("Measured on", null, el("div.columns", {}, Object.entries(DATA.environments).filter(([name]) => own.some((p) => p.environment === name)).map(([name, facts_]) => environmentFacts(name, facts_)))));
  const notices = rows.flatMap((f) => [...f.valid, ...f.notices].map((text) => [f.name, text]));
  if (notices.length) host.append(section("To know", null, el("ul.plain", {}, notices.map(([name, text]) => el("li", {}, el("b", {}, `${name}: `), text)))));
  if (DATA.left_out.length) host.append(section("Left out", null, el("p", {}, `Pictures that did not fit or could not be read: ${DATA.left_out.join(", ")}.`)));
}

/** What was found, in a sentence: of the first experiment, which was ranked anew, or as the report of another says. */
const finding = (lead) => el("p.lead", {}, lead === folders[0] ? DATA.finding : lead.finding);

/** Of each scene and kind of structure the fastest point without a wrong answer, and one with wrong answers that is faster. */
function fastest(own) {
  const found = new Map();
  for (const p of own) {
    const key = `${p.where}\n${p.size}\n${p.kind}`;
    const pair = found.get(key) || {};
    const side = p.error === "✓" ? "right" : "other", before = pair[side];
    if (!before || p.total_ms < before.total_ms) pair[side] = p;
    found.set(key, pair);
  }
  return [...found.values()].flatMap(({ right, other }) => [right, !(right?.total_ms <= other?.total_ms) && other].filter(Boolean));
}

function kinds(own, lead) {
  const best = fastest(own);
  const axis = percentAxis(best.map((p) => p.total_ms));
  const sizes = unique(own.map((p) => p.size)).length > 1;
  const rows = new Map();
  for (const p of best) {
    const name = p.where + (sizes ? `, ${p.size}` : "");
    rows.set(name, [...(rows.get(name) || []), p]);
  }
  const most = 12, shownRows = [...rows].slice(0, most);
  // A mark that would lie on another one is lower, else higher.
  const heights = (row) => {
    const last = [], levels = [50, 22, 78];
    return row.map((p) => {
      const left = axis.place(p.total_ms), free = levels.findIndex((_, i) => !(left - last[i] < 2.2));
      last[Math.max(free, 0)] = left;
      return { left, bottom: levels[Math.max(free, 0)] };
    });
  };
  const looks = new Map(shownRows.flatMap(([, row]) => row).map((p) => [`${p.kind}\n${p.method}`, p]));
  return section("The fastest of each kind of structure, ms a frame", null,
    el("ul.legend.flow", {}, [...looks.values()].sort((a, b) => a.kind.localeCompare(b.kind)).map((p) => el("li", {}, swatch(p.method), `${p.kind}: ${p.method}`)), el("li", {}, el("i.dot.bad.still"), "some answers are wrong")),
    el("div.kinds", { role: "group", "aria-label": "Time of the fastest of each kind on each scene" },
      shownRows.map(([name, row]) => el("div.kind-row", {}, el("div.kind-name", {}, name), el("div.track", {}, axis.ticks.map(([at]) => { const line = el("i.rule"); line.style.left = `${at}%`; return line; }),
        heights(row.sort((a, b) => a.total_ms - b.total_ms)).map((place, i) => dot(row[i], place, row[i].best ? textOf(row[i], "total_ms") : ""))))),
      el("div.kind-row", {}, el("div.kind-name"), el("div.track.ticks", {}, tickMarks(axis, "x")))),
    el("p.note", {}, `${lead.where}. Numbers: the fastest without a wrong answer, and what ties with it. Of each kind the fastest such method; a crossed ring is faster but wrong. `, rows.size > most ? `${whole(rows.size - most)} more are in the tables. ` : "", el("a", { href: address({ view: "table", t: lead.name }) }, "All methods"), "."),
    validNote(lead.valid));
}

/** What must be known of the numbers above. */
const validNote = (lines) => lines.map((line) => el(`p.note${line.includes("disturbed") ? ".warning" : ""}`, {}, line));

function section(title, aside, ...content) {
  return el("section.block", {}, el("div.bar-head", {}, el("h2", {}, title), aside), ...content);
}
