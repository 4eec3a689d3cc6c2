// What is there: one line an experiment, the machines, and what a reader must know first.

function viewOverview(host) {
  const own = shown();
  const done = own.filter((p) => p.done);
  const exact = done.filter((p) => p.error === "✓").length;
  const card = (value, text) => el("div.card", {}, el("b", {}, value), el("span", {}, text));
  const standIns = unique(own.filter(isStandIn).map((p) => p.title)).length;
  host.append(el("div.cards", {},
    card(whole(unique(own.map((p) => p.folder)).length), unique(own.map((p) => p.folder)).length === 1 ? "experiment" : "experiments"), card(whole(done.length), "points measured"),
    card(`${whole(exact)}`, "with no wrong answer"), card(whole(done.filter((p) => p.bad).length), "with wrong answers"),
    card(whole(done.filter((p) => p.error === "unscored").length), "unscored"),
    card(`${standIns} of ${unique(own.map((p) => p.title)).length}`, "scenes are stand-ins")));
  const columns = [
    { key: "name", title: "folder", text: (f) => f.name, node: (f) => el("a", { href: address({ view: "table", t: f.name, exp: [], "table.sort": "", m: "" }) }, f.name) },
    { key: "title", title: "experiment", text: (f) => f.title },
    { key: "finding", title: "finding", text: (f) => f.finding, className: () => "prose" },
    { key: "points", title: "points", numeric: "down", value: (f) => f.done, text: (f) => whole(f.done) },
    { key: "wrong", title: "wrong", numeric: "down", value: (f) => f.wrong, text: (f) => whole(f.wrong), tip: (f) => [f.answers], className: (f) => (f.wrong ? "is-wrong" : "") },
    { key: "where", title: "measured at", text: (f) => f.where },
    { key: "state", title: "version", text: (f) => (f.earlier === f.all ? "all of an earlier version" : f.earlier ? `${f.earlier} of ${f.all} of an earlier version` : "current"), className: (f) => (f.earlier ? "is-old" : "") },
  ];
  const rows = folders.map((f) => {
    const mine = own.filter((p) => p.folder === f.name);
    return { ...f, all: mine.length, done: mine.filter((p) => p.done).length, wrong: mine.filter((p) => p.bad).length, earlier: mine.filter((p) => p.earlier).length };
  }).filter((f) => f.all);
  host.append(section("Experiments", savers(columns, ordered(columns, rows, "overview"), "experiments", `Experiments of ${DATA.title}`), grid(columns, rows, { caption: "Experiments in these results", name: "overview" })));
  const machines = Object.entries(DATA.environments);
  host.append(section("Measured on", null, el("div.columns", {}, machines.map(([name, facts_]) => environmentFacts(name, facts_)))));
  const notices = folders.flatMap((f) => f.notices.map((text) => [f.name, text]));
  if (notices.length) host.append(section("Notices", null, el("ul.plain", {}, notices.map(([name, text]) => el("li", {}, el("b", {}, `${name}: `), text)))));
  if (DATA.left_out.length) host.append(section("Left out", null, el("p", {}, `Pictures that did not fit or could not be read: ${DATA.left_out.join(", ")}.`)));
}

function section(title, aside, ...content) {
  return el("section.block", {}, el("div.bar-head", {}, el("h2", {}, title), aside), ...content);
}
