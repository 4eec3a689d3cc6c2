// Marks of points on a logarithmic axis, in the page's own elements: they follow its width and its theme.

/** An axis in per cent of its length. Values of zero have a place of their own at its beginning, where `zero` asks for it. */
function percentAxis(values, zero = false) {
  const some = values.filter((v) => v > 0);
  const low = Math.min(...some) / 1.4, high = Math.max(...some) * 1.25, from = zero ? 14 : 0;
  const place = (v) => (v > 0 ? from + (100 - from) * Math.log(v / low) / Math.log(high / low) : from / 2);
  const ticks = some.length ? logTicks(low, high) : [];
  return { place, ticks: [...(zero ? [[place(0), "0"]] : []), ...ticks.filter((v, i) => ticks.length < 7 || i % 2 === 0).map((v) => [place(v), onAxis(v)])] };
}

/** The mark of a point: filled where every answer is right, a ring with a cross where some are wrong, a ring where nobody knows. */
function dot(p, { left, bottom = 50 }, label = "") {
  const node = withTip(el(`button.dot${p.bad ? ".bad" : p.error === "✓" ? "" : ".open"}`, { type: "button", "aria-label": `${p.name}, ${p.where}: ${textOf(p, "total_ms")} ms ${p.error}`, onclick: () => openDetails(p) }, label && el("span.dot-label", {}, label)), () => pointLines(p));
  node.style.cssText = `left:${left.toFixed(2)}%;bottom:${bottom.toFixed(2)}%;--tint:${colourOf(p.method)}`;
  if (left > 60) node.classList.add("left");
  return node;
}

const tickMarks = (axis, kind) => axis.ticks.map(([at, text]) => { const node = el(`span.tick.${kind}`, {}, text); node.style[kind === "x" ? "left" : "bottom"] = `${at.toFixed(2)}%`; return node; });
