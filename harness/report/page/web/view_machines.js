// One experiment on several machines, side by side.

/** The experiments that several machines have, with their folders. */
function repeated() {
  const found = new Map();
  for (const name of foldersShown()) {
    const { experiment } = folderOf(name);
    found.set(experiment, [...(found.get(experiment) || []), name]);
  }
  const machines = (names) => unique(points.filter((p) => names.includes(p.folder)).map((p) => p.machine));
  return [...found].filter(([, names]) => machines(names).length > 1);
}

function viewMachines(host) {
  const choices = repeated();
  if (!choices.length) { host.append(nothing("No experiment was run on two machines.")); return; }
  const [experiment, names] = choices.find(([one]) => one === state.e) || choices[0];
  const own = shown(["exp"]).filter((p) => names.includes(p.folder));
  const measures = Object.keys(MEASURES).filter((m) => own.some((p) => valueOf(p, m) !== null)).map((m) => [m, measureTitle(m)]);
  const measure = measures.some(([m]) => m === state.mm) ? state.mm : "total_ms";
  const key = (p) => `${p.where}\n${p.size}\n${p.name}`;
  // Of several folders of one machine the record that was made last.
  const cells = new Map([...own].sort((a, b) => a.started - b.started).map((p) => [`${p.machine}\n${key(p)}`, p]));
  const machines = unique(own.map((p) => p.machine));
  const lines = unique(own.map(key)).filter((line) => machines.filter((one) => cells.has(`${one}\n${line}`)).length > 1);
  const sizes = unique(own.map((p) => p.size)).length > 1;
  const columns = [
    { key: "where", title: "scene", text: (line) => line.split("\n").slice(0, sizes ? 2 : 1).join(", ") },
    { key: "name", title: "method", text: (line) => line.split("\n")[2], className: () => "name" },
    ...machines.map((name) => {
      const at = (line) => cells.get(`${name}\n${line}`);
      const text = (p) => (!p ? "–" : !p.done ? p.status : `${textOf(p, measure)} ${p.error}${p.earlier ? " †" : ""}`);
      return { key: name, title: name, numeric: "up", value: (line) => at(line) && valueOf(at(line), measure), text: (line) => text(at(line)), csv: (line) => at(line) && valueOf(at(line), measure), point: at,
        node: (line) => { const p = at(line); return p?.done ? el("span.cell", {}, el("span", {}, textOf(p, measure)), mark(p)) : text(p); }, tip: (line) => at(line) && pointLines(at(line)),
        bold: (line) => Boolean(at(line)?.best), className: (line) => (at(line)?.best ? "is-best" : "") };
    })];
  const valid = validity(names);
  host.append(el("div.controls", {}, select("Experiment", choices.map(([one, of]) => [one, folderOf(of[0]).title]), experiment, (e) => change({ e })), select("Show", measures, measure, (mm) => change({ mm }))));
  const caption = `${folderOf(names[0]).title}: ${measureTitle(measure)}, on each machine`;
  const notes = [own.some((p) => p.earlier) && "† of an earlier version of the method than other records here: such a difference is not the machine's alone.", "Bold: the fastest of its scene on that machine without a wrong answer.", ...marksIn(own.map((p) => textOf(p, measure)))].filter(Boolean);
  host.append(section(caption, savers(columns, ordered(columns, lines, "machines"), `${experiment}-machines`, caption, { notes: [...notes, ...valid] }),
    grid(columns, lines, { caption: "What several machines have measured", name: "machines", valid, notes, open: (line, column) => { const p = column.point?.(line); if (p) openDetails(p); } })));
}
