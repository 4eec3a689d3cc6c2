// The paper's claims with their verdicts, and the drawings of every experiment.

function viewClaims(host) {
  if (!DATA.claims.length) { host.append(el("p.empty-note", {}, "These results decide no claim.")); return; }
  const columns = [
    { key: "number", title: "#", numeric: "up", value: (c) => c.number, text: (c) => String(c.number) },
    { key: "verdict", title: "verdict", text: (c) => c.verdict, node: (c) => el(`span.verdict.${c.verdict.replace(/\W+/g, "-")}`, {}, c.verdict) },
    { key: "claim", title: "claim", text: (c) => c.claim, className: () => "prose" },
    { key: "section", title: "section", text: (c) => c.section },
    { key: "numbers", title: "measured", text: (c) => c.numbers, className: () => "prose wide" },
    { key: "judged_from", title: "judged from", text: (c) => c.judged_from, className: () => "prose" },
  ];
  const counts = unique(DATA.claims.map((c) => c.verdict)).map((verdict) => [verdict, DATA.claims.filter((c) => c.verdict === verdict).length]);
  host.append(section("Claims", savers(columns, ordered(columns, DATA.claims, "claims"), "claims", "Claims of the paper, measured here"),
    el("p.finding", {}, `Verdicts on ${DATA.claims.length} claims: ` + counts.map(([verdict, count]) => `${verdict} ${count}`).join(", ") + ". A claim without a section is this project's own, the others are the paper's. Scenes are stand-ins where their title says so; the paper's own numbers come from a GTX 280."),
    grid(columns, DATA.claims, { caption: "Each claim, judged from the records of these results alone", name: "claims" })));
}

function viewDrawings(host) {
  const found = DATA.figures.filter((one) => !state.exp.length || state.exp.includes(one.folder));
  if (!found.length) { host.append(nothing("There are no drawings beside these records; shadowbench show makes them.")); return; }
  for (const folder of unique(found.map((one) => one.folder))) {
    const about = folderOf(folder);
    host.append(section(about ? about.title : folder, null, about?.finding && el("p.finding", {}, about.finding), found.filter((one) => one.folder === folder).map(figure)));
  }
}
