// A table: sorted by its headings, walked through with the arrow keys, each cell with its tooltip.

const FIRST_ROWS = 250;

/** By which column a table is sorted, and which way: "up" or "down". */
const sorting = (name) => (state[`${name}.sort`] || "").split(/:(?=[a-z]+$)/);

/** The rows as the table of that name shows them. What is not known comes last, either way. */
function ordered(columns, rows, name) {
  const [key, way] = sorting(name);
  const by = columns.find((one) => one.key === key);
  if (!by) return rows;
  const sign = way === "down" ? -1 : 1;
  const value = by.value || by.text;
  return rows.map((row, i) => [value(row), i, row]).sort(([a, i], [b, j]) => {
    if (!known(a) || !known(b)) return known(b) - known(a) || i - j;
    const order = typeof a === "number" && typeof b === "number" ? a - b : String(a).localeCompare(String(b), "en", { numeric: true });
    return sign * order || i - j;
  }).map(([, , row]) => row);
}

/**
 * columns  [{key, title, text(row), value(row) to sort by, numeric, node(row), tip(row), group, className(row)}]
 * rows     what the columns are given
 * options  caption, name (of the sort in the address), open(row, column): Enter or a click, notes below, `valid`: what must be
 *          known of the numbers
 */
function grid(columns, rows, { caption, name, open, notes = [], valid = [] }) {
  const [sortKey, sortWay] = sorting(name);
  rows = ordered(columns, rows, name);
  const whole = rows.length;
  const all = state[`${name}.all`] || whole <= FIRST_ROWS;
  const visible = all ? rows : rows.slice(0, FIRST_ROWS);

  const heading = (column) => {
    const way = column.key === sortKey ? (sortWay === "down" ? "descending" : "ascending") : "none";
    const next = way === "ascending" ? "down" : way === "descending" ? "" : column.numeric === "down" ? "down" : "up";
    return el("th", { scope: "col", "aria-sort": way, class: [column.numeric ? "num" : "", column.group ? "paper" : ""].join(" ").trim() },
      column.fixed ? column.title : el("button", { type: "button", "data-focus": `${name}:${column.key}`,
        onclick: () => { change({ [`${name}.sort`]: next ? `${column.key}:${next}` : "" }); say(`Sorted by ${column.title}, ${next || "not"}`); } },
      el("span", {}, column.title), el("span.arrow", { "aria-hidden": "true" }, way === "ascending" ? "▲" : way === "descending" ? "▼" : "")));
  };
  const cell = (row, column, i, j) => {
    const node = el(j === 0 ? "th" : "td", { scope: j === 0 ? "row" : null, tabIndex: i === 0 && j === 0 ? 0 : -1,
      class: [column.numeric ? "num" : "", column.group ? "paper" : "", column.className?.(row) || ""].join(" ").trim() || null },
    column.node ? column.node(row) : column.text(row));
    if (column.style) node.style.cssText = column.style(row) || "";
    if (column.tip) withTip(node, () => column.tip(row));
    node._open = open && (() => open(row, column));
    return node;
  };
  const groups = columns.some((one) => one.group) && el("tr", {}, runs(columns.map((one) => one.group || "")).map(([text, span]) =>
    el("th", { colSpan: span, scope: text ? "colgroup" : null, class: text ? "paper group" : "group" }, text)));
  const table = el("table.grid", {},
    caption && el("caption", {}, caption),
    el("thead", {}, groups, el("tr", {}, columns.map(heading))),
    el("tbody", {}, visible.map((row, i) => el("tr", {}, columns.map((column, j) => cell(row, column, i, j))))));
  table.addEventListener("keydown", walk);
  table.addEventListener("click", (event) => event.target.closest("td, tbody th")?._open?.());
  return el("div", {},
    el("div.scroll", { role: "region", "aria-label": caption || "Table" }, table),
    validNote(valid), notes.length > 0 && el("p.note", {}, notes.join(" ")),
    !all && el("p.note", {}, `The first ${FIRST_ROWS} of ${whole} rows. `, el("button.small", { type: "button", onclick: () => change({ [`${name}.all`]: "1" }) }, `Show all ${whole}`)));
}

/** Equal neighbours: [[value, how many], ...]. */
function runs(values) {
  const found = [];
  for (const value of values) {
    if (found.length && found.at(-1)[0] === value) found.at(-1)[1] += 1;
    else found.push([value, 1]);
  }
  return found;
}

const STEPS = { ArrowLeft: [0, -1], ArrowRight: [0, 1], ArrowUp: [-1, 0], ArrowDown: [1, 0], Home: [0, -1e6], End: [0, 1e6], PageUp: [-12, 0], PageDown: [12, 0] };

/** The arrow keys move between cells; one cell at a time is in the order of the Tab key. Enter opens the details. */
function walk(event) {
  const from = event.target.closest("td, tbody th");
  if (!from) return;
  if (event.key === "Enter" && from._open) { event.preventDefault(); from._open(); return; }
  const step = STEPS[event.key];
  if (!step) return;
  event.preventDefault();
  const lines = [...event.currentTarget.tBodies[0].rows];
  const line = Math.max(0, Math.min(lines.length - 1, lines.indexOf(from.parentElement) + step[0]));
  const cells = [...lines[line].cells];
  const place = Math.max(0, Math.min(cells.length - 1, [...from.parentElement.cells].indexOf(from) + step[1]));
  from.tabIndex = -1;
  cells[place].tabIndex = 0;
  cells[place].focus();
  cells[place].scrollIntoView({ block: "nearest", inline: "nearest" });
}

/** The mark of a point's answers, as it stands beside every time. */
function mark(row) {
  const kind = row.bad ? "wrong" : row.error === "unscored" ? "open" : "right";
  const text = row.bad ? row.error.replace(" wrong", "") : row.error;
  return el(`span.mark-${kind}`, {}, text || "", row.earlier && el("span.old", {}, "†"));
}
