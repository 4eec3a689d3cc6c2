// Where every number is from: the hashes and the environment of each record.

function viewRecords(host) {
  const rows = shown();
  if (!rows.length) { host.append(nothing()); return; }
  const hash = (key, title) => ({ key, title, text: (p) => p[key] || "–", node: (p) => el("code", {}, (p[key] || "–").slice(0, 12)), tip: (p) => [title, p[key] || "not known"] });
  const columns = [
    { key: "key", title: "record", text: (p) => p.key, className: () => "wrap", node: (p) => el("code", {}, p.key) },
    { key: "folder", title: "folder", text: (p) => p.folder },
    { key: "status", title: "status", text: (p) => p.status, tip: (p) => [p.status, p.reason] },
    { key: "started", title: "measured, UTC", value: (p) => p.started, text: (p) => (p.started ? new Date(1000 * p.started).toISOString().slice(0, 16).replace("T", " ") : "–") },
    { key: "version", title: "version", text: (p) => (p.earlier ? "earlier" : "current"), className: (p) => (p.earlier ? "is-old" : "") },
    hash("method_sha256", "method's source"), hash("scene_sha256", "scene's arrays"), hash("environment", "environment"), hash("run", "run"),
    { key: "commit", title: "commit", text: (p) => DATA.environments[p.environment]?.git?.commit || "–", node: (p) => el("code", {}, (DATA.environments[p.environment]?.git?.commit || "–").slice(0, 10)) },
    { key: "stand", title: "scene is", text: (p) => (isStandIn(p) ? "a stand-in" : p.source_file ? "a file" : "procedural") },
  ];
  host.append(section(`${whole(rows.length)} records`, savers(columns, ordered(columns, rows, "records"), "records", `Records of ${DATA.title}`),
    grid(columns, rows, { caption: "Records: what was measured, with which source, where", name: "records", open: openDetails, note: "Current: of the version of its method that was measured last in these results." })));
  host.append(section("Environments", null, el("div.columns", {}, Object.entries(DATA.environments).map(([name, one]) => environmentFacts(name, one)))));
}
