// Pictures of scenes: two methods side by side under one line, with what each answered wrongly.

async function viewPictures(host) {
  const titles = unique(shown(["method", "device"]).map((p) => p.title));
  const entries = DATA.gallery.filter((one) => titles.includes(one.title) && (!state.exp.length || state.exp.includes(one.folder)));
  const pairs = entries.filter((one) => one.pictures.length > 1);
  if (pairs.length) {
    const name = (one) => `${one.folder} · ${one.title}${one.frame === null ? "" : `, frame ${one.frame}`}`;
    const entry = pairs.find((one) => name(one) === state.pic) || pairs[0];
    const labels = entry.pictures.map((one) => one.label);
    const worst = entry.pictures.reduce((a, b) => ((b.wrong || 0) > (a.wrong || 0) ? b : a));
    const left = entry.pictures.find((one) => one.label === state.pl) || entry.pictures[0];
    const right = entry.pictures.find((one) => one.label === state.pr) || worst;
    const option = (one) => [one.label, `${one.label}${one.error ? ` (${one.error})` : ""}`];
    host.append(el("div.controls", {},
      select("Scene", pairs.map(name), name(entry), (pic) => change({ pic, pl: "", pr: "" }), { "data-focus": "pic" }),
      select("Left", entry.pictures.map(option), left.label, (pl) => change({ pl }), { "data-focus": "pl" }),
      select("Right", entry.pictures.map(option), right.label, (pr) => change({ pr }), { "data-focus": "pr" }),
      toggle("mark wrong answers", !state.plain, (on) => change({ plain: on ? "" : "1" }), { "data-focus": "plain" })));
    const block = section(`${entry.title}: ${left.label} and ${right.label}`, null);
    host.append(block);
    const [one, two] = await Promise.all([left, right].map((picture) => withErrors(picture, entry)));
    if (!block.isConnected) return;
    const columns = [
      { key: "label", title: "picture", text: (one_) => one_.label },
      { key: "wrong", title: "wrong answers", numeric: "up", value: (one_) => one_.wrong, text: (one_) => (one_.wrong === null ? "unscored" : whole(one_.wrong)), className: (one_) => (one_.wrong ? "is-wrong" : "") }];
    block.append(el("div.split", {}, twoPictures(one.node, two.node, [left.label, right.label], "cut", null), el("div", {}, legendOf([one.counts, two.counts]),
      grid(columns, entry.pictures, { caption: `Pictures of ${entry.title}: Enter or a click puts one on the right`, name: "pictures", open: (one_) => change({ pr: one_.label }) }))));
    say(`${labels.length} pictures of ${entry.title}`);
  }
  const single = entries.filter((one) => one.pictures.length === 1);
  if (single.length) host.append(section("Scenes", null, el("div.sheet", {}, single.map((one) => el("figure", {}, el("img", { src: one.pictures[0].uri, alt: one.title, loading: "lazy" }), el("figcaption", {}, one.title))))));
  const drawn = DATA.figures.filter((one) => one.name.endsWith(".png") && (!state.exp.length || state.exp.includes(one.folder)));
  if (drawn.length) host.append(section("Drawn sheets", null, drawn.map((one, i) => { const node = figure(one); if (i === 0 && !pairs.length) node.open = true; return node; })));
  if (!pairs.length) host.append(el("p.note", {}, "These results have no pictures of several methods. A run of the experiment accuracy keeps them (images/ and maps/); shadowbench keep --with images --with maps includes them."));
}

const ERROR_TINTS = { true: [213, 0, 60], invalid: [160, 0, 200], acne: [235, 90, 0], leak: [0, 120, 255], edge: [120, 120, 120], "near-tie": [150, 150, 90] };

/** A picture as a canvas, its wrong pixels painted over where it has a map of them. */
async function withErrors(picture, entry) {
  const base = await pixelsOf(picture.uri);
  const counts = new Map();
  if (!picture.classes || state.plain) return { node: painted(base.width, base.height, (i) => base.bytes.subarray(4 * i, 4 * i + 3)), counts };
  const map = await countsOf(picture.classes);
  const kinds = new Map(DATA.legend.map((kind) => [kind.value, kind]));
  for (const value of map.counts) if (value) counts.set(value, (counts.get(value) || 0) + 1);
  const scale = map.width / base.width;
  const node = painted(base.width, base.height, (i) => {
    const x = Math.floor((i % base.width) * scale), y = Math.floor(Math.floor(i / base.width) * scale);
    const kind = kinds.get(map.counts[y * map.width + x]);
    if (kind && ERROR_TINTS[kind.name] && kind.wrong) return ERROR_TINTS[kind.name];
    const grey = 0.6 * (0.3 * base.bytes[4 * i] + 0.6 * base.bytes[4 * i + 1] + 0.1 * base.bytes[4 * i + 2]) + 95;
    return [grey, grey, grey];
  });
  return { node, counts };
}

function legendOf(sides) {
  const rows = DATA.legend.filter((kind) => kind.wrong && sides.some((counts) => counts.get(kind.value)));
  if (!rows.length) return el("p.note", {}, "No wrong answer is marked.");
  return el("ul.legend", {}, rows.map((kind) => {
    const node = el("i.swatch", { "aria-hidden": "true" });
    node.style.background = `rgb(${ERROR_TINTS[kind.name]})`;
    return el("li", {}, node, `${kind.name}: ${kind.meaning} (${sides.map((counts) => whole(counts.get(kind.value) || 0)).join(" left, ")} right)`);
  }));
}
