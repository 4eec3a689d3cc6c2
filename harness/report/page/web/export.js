// What is shown, as a file: CSV, and LaTeX with booktabs.

function save(name, type, text) {
  const link = el("a", { href: URL.createObjectURL(new Blob([text], { type })), download: name });
  document.body.append(link);
  link.click();
  link.remove();
  setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
  say(`Saved ${name}`);
}

function asCsv(columns, rows) {
  const quoted = (value) => {
    const text = known(value) ? String(value) : "";
    return /[",\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text;
  };
  const line = (values) => values.map(quoted).join(",");
  return [line(columns.map((one) => (one.group ? `${one.title} (${one.group})` : one.title))),
    ...rows.map((row) => line(columns.map((one) => (one.csv || one.text)(row))))].join("\n") + "\n";
}

const LATEX = { "\\": "\\textbackslash{}", "&": "\\&", "%": "\\%", $: "\\$", "#": "\\#", _: "\\_", "{": "\\{", "}": "\\}", "~": "\\textasciitilde{}", "^": "\\textasciicircum{}",
  "✓": "$\\checkmark$", "✗": "$\\times$", "×": "$\\times$", "–": "--", "·": "$\\cdot$", "±": "$\\pm$", "†": "\\dag{}", "ä": "\\\"a", "ö": "\\\"o", "ü": "\\\"u" };
const latexText = (value) => String(value ?? "").replace(/[\\&%$#_{}~^✓✗×–·±†äöü]/g, (sign) => LATEX[sign]);

function asLatex(columns, rows, caption, notes) {
  const line = (values) => `${values.join(" & ")} \\\\`;
  const groups = columns.some((one) => one.group);
  const head = [];
  if (groups) head.push(line(runs(columns.map((one) => one.group || "")).map(([text, span]) => (text || span > 1 ? `\\multicolumn{${span}}{c}{${latexText(text)}}` : ""))));
  let place = 1;
  for (const [text, span] of groups ? runs(columns.map((one) => one.group || "")) : []) {
    if (text) head.push(`\\cmidrule(lr){${place}-${place + span - 1}}`);
    place += span;
  }
  head.push(line(columns.map((one) => latexText(one.title))));
  return [
    "% Needs \\usepackage{booktabs} and \\usepackage{amssymb}.",
    "\\begin{table}", "\\centering", `\\caption{${latexText(caption)}}`,
    `\\begin{tabular}{${columns.map((one) => (one.numeric ? "r" : "l")).join("")}}`, "\\toprule", ...head, "\\midrule",
    ...rows.map((row) => line(columns.map((one) => (one.bold?.(row) ? `\\textbf{${latexText(one.text(row))}}` : latexText(one.text(row)))))),
    "\\bottomrule", "\\end{tabular}", ...notes.map((note) => `\\par\\footnotesize ${latexText(note)}`), "\\end{table}", ""].join("\n");
}

/** Two buttons that save what a table shows, as it is sorted. `csv`: the columns of that file, if others; `notes`: below LaTeX. */
function savers(columns, rows, name, caption, { csv = null, notes = [] } = {}) {
  const used = columns.filter((one) => !one.screen);
  return el("div.savers", { role: "group", "aria-label": "Download what is shown" },
    el("button.small", { type: "button", "data-focus": `csv:${name}`, onclick: () => save(`${name}.csv`, "text/csv", asCsv(csv || used, rows)) }, "CSV"),
    el("button.small", { type: "button", "data-focus": `tex:${name}`, onclick: () => save(`${name}.tex`, "application/x-tex", asLatex(used, rows, caption, notes)) }, "LaTeX"));
}
