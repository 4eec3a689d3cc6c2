// Heat maps: tests per pixel of two points on one scale.

async function viewMaps(host) {
  const titles = unique(shown(["method", "device"]).map((p) => p.title));
  const entries = DATA.maps.filter((one) => titles.includes(one.title) && (!state.exp.length || state.exp.includes(one.folder)));
  if (!entries.length) {
    host.append(DATA.maps.length ? nothing() : el("p.empty-note", {}, "These results have no maps of tests per pixel. A run of figure2 keeps them; shadowbench keep --with maps includes them."));
    return;
  }
  const name = (one) => `${one.folder} · ${one.title}, ${one.width}×${one.height}`;
  const entry = entries.find((one) => name(one) === state.map) || entries[0];
  const title = (one) => one.label + (unique(entry.maps.map((m) => m.frame)).length > 1 ? `, frame ${one.frame}` : "");
  const left = entry.maps.find((one) => title(one) === state.ml) || entry.maps[0];
  const right = entry.maps.find((one) => title(one) === state.mr) || entry.maps.find((one) => one !== left) || left;
  host.append(el("div.controls", {},
    select("Map", entries.map(name), name(entry), (map) => change({ map, ml: "", mr: "" }), { "data-focus": "map" }),
    select("Left", entry.maps.map(title), title(left), (ml) => change({ ml }), { "data-focus": "ml" }),
    select("Right", entry.maps.map(title), title(right), (mr) => change({ mr }), { "data-focus": "mr" })));
  const block = section(`Triangles tested per pixel: ${entry.title}`, null);
  host.append(block);
  const all = await Promise.all(entry.maps.map((one) => countsOf(one.uri)));
  if (!block.isConnected) return;
  const stats = all.map(({ counts }) => {
    const sorted = counts.slice().sort();
    let sum = 0;
    for (const value of sorted) sum += value;
    return { mean: sum / sorted.length, p99: sorted[Math.floor(0.99 * (sorted.length - 1))], most: sorted.at(-1) };
  });
  const most = Math.max(...stats.map((one) => one.most));
  const log = (state.scale || "log") === "log";
  const share = (count) => (log ? Math.log1p(count) / Math.log1p(most) : count / most);
  const draw_ = (one) => { const { width, height, counts } = all[entry.maps.indexOf(one)]; return painted(width, height, (i) => ramp(share(counts[i]))); };
  const read = (x, y) => {
    const { width, height } = all[0];
    const i = Math.min(height - 1, Math.floor(y * height)) * width + Math.min(width - 1, Math.floor(x * width));
    return [`pixel ${i % width}, ${Math.floor(i / width)}`, ...[left, right].map((one) => [title(one), `${whole(all[entry.maps.indexOf(one)].counts[i])} tests`])];
  };
  const stops = Array.from({ length: 11 }, (_, i) => `rgb(${ramp(i / 10)}) ${10 * i}%`).join(",");
  const key = el("div.ramp", { role: "img", "aria-label": `Colours from 0 to ${whole(most)} tests` });
  key.style.background = `linear-gradient(90deg, ${stops})`;
  const marks = [0, 0.25, 0.5, 0.75, 1].map((part) => whole(log ? Math.expm1(part * Math.log1p(most)) : part * most));
  const columns = [
    { key: "title", title: "point", text: (i) => title(entry.maps[i]) },
    ...[["mean", "mean"], ["p99", "99th percentile"], ["most", "most"]].map(([field, text]) => ({ key: field, title: text, numeric: "down", value: (i) => stats[i][field], text: (i) => whole(stats[i][field]), csv: (i) => stats[i][field] }))];
  const rows = entry.maps.map((_, i) => i);
  block.append(el("div.split", {}, twoPictures(draw_(left), draw_(right), [title(left), title(right)], "mcut", read),
    el("div", {}, el("div.scale", {}, key, el("div.ends", {}, marks.map((text) => el("span", {}, text)))),
      savers(columns, ordered(columns, rows, "maps"), "tests-per-pixel", `Tests per pixel, ${entry.title}`), grid(columns, rows, { caption: "Tests of a pixel's primary ray", name: "maps",
        open: (i) => { const p = points.find((one) => one.key === entry.maps[i].key && one.folder === entry.folder); if (p) openDetails(p); } }))));
}
