// Lines over a number: zoomed by dragging, the nearest point named under the pointer. Drawn by uPlot.

/** A colour of the theme as a canvas takes it. */
const css = (name) => { const probe = $("#said"); probe.style.color = `var(${name})`; return getComputedStyle(probe).color; };

/**
 * Where a logarithmic axis has its ticks: the powers of ten; where there are few, 1, 2 and 5 of each; where there are none, even
 * steps. (uPlot's own ticks do not end where an axis does not begin at a power of ten.)
 */
function logTicks(low, high) {
  const first = Math.floor(Math.log10(low)), last = Math.ceil(Math.log10(high));
  const decades = Array.from({ length: last - first + 1 }, (_, i) => 10 ** (first + i));
  const within = (values) => values.filter((v) => v >= low * 0.999 && v <= high * 1.001).map((v) => +v.toPrecision(6));
  const powers = within(decades);
  if (powers.length > 3) return powers;
  const more = within(decades.flatMap((v) => [v, 2 * v, 5 * v]));
  if (more.length > 1) return more;
  const step = 10 ** Math.floor(Math.log10((high - low) / 2));
  return within(Array.from({ length: Math.ceil((high - low) / step) + 1 }, (_, i) => (Math.ceil(low / step) + i) * step));
}

const DASHES = [[], [6, 4], [2, 3], [8, 3, 2, 3]];

/**
 * series  [{label, colour, dash, points: [{x, y, low, high, bad, lines()}]}]
 * axes    {x, y: titles, logX, logY, mark: the x that a slider shows}
 */
function lineChart(host, series, axes) {
  const xs = unique(series.flatMap((one) => one.points.map((p) => p.x))).sort((a, b) => a - b);
  const place = new Map(xs.map((x, i) => [x, i]));
  const tables = series.map((one) => {
    const row = new Array(xs.length).fill(null);
    for (const p of one.points) if (p.y !== null && (!axes.logY || p.y > 0)) row[place.get(p.x)] = p;
    return row;
  });
  const ink = css("--ink-2"), faint = css("--line");
  const logX = axes.logX && xs[0] > 0;
  const ticks = (u, values) => values.map((v) => (v === null ? "" : onAxis(v)));
  const side = (log) => ({ stroke: ink, font: "12px system-ui, sans-serif", grid: { stroke: faint, width: 1 }, ticks: { stroke: faint, width: 1 }, values: ticks,
    ...(log ? { splits: (u, axis, low, high) => logTicks(low, high), filter: (u, found) => found } : {}) });
  let nearest = null;
  const options = {
    width: Math.max(260, host.clientWidth), height: Math.max(260, Math.min(620, innerHeight * 0.55)),
    legend: { show: false },
    scales: { x: { time: false, distr: logX ? 3 : 1, ...(logX ? { range: (u, low, high) => (low > 0 ? [low / 1.12, high * 1.12] : [0.1, 1]) } : {}) }, y: { distr: axes.logY ? 3 : 1, ...(axes.logY ? { range: (u, low, high) => (low > 0 ? [low / 1.3, high * 1.3] : [0.1, 1]) } : { range: (u, low, high) => [Math.min(0, low), high * 1.05 || 1] }) } },
    axes: [{ ...side(logX), label: axes.x, labelSize: 22, labelFont: "12px system-ui, sans-serif" },
      { ...side(axes.logY), label: axes.y, labelSize: 22, labelFont: "12px system-ui, sans-serif", size: 56 }],
    cursor: { drag: { x: true, y: true, uni: 24 }, focus: { prox: 40 }, points: { size: 9 } },
    focus: { alpha: 0.25 },
    series: [{}, ...series.map((one) => ({ label: one.label, stroke: one.colour, width: 1.6, dash: one.dash, spanGaps: true,
      points: { show: true, size: xs.length > 60 ? 4 : 6, fill: one.hollow ? css("--paper") : one.colour } }))],
    hooks: {
      setCursor: [(u) => {
        nearest = null;
        if (u.cursor.left < 0) { hideTip(); return; }
        let best = 40 * 40;
        tables.forEach((row, s) => row.forEach((p) => {
          if (!p) return;
          const dx = u.valToPos(p.x, "x") - u.cursor.left, dy = u.valToPos(p.y, "y") - u.cursor.top;
          if (dx * dx + dy * dy < best) { best = dx * dx + dy * dy; nearest = { p, s }; }
        }));
        if (!nearest) { hideTip(); return; }
        const box = u.over.getBoundingClientRect();
        const x = box.left + u.valToPos(nearest.p.x, "x"), y = box.top + u.valToPos(nearest.p.y, "y");
        placeTip(nearest.p.lines(), { left: x + 10, top: y - 8, bottom: y + 8, before: x > box.left + box.width / 2 });
      }],
      draw: [(u) => {
        const c = u.ctx, scale = devicePixelRatio;
        c.save();
        c.beginPath();
        c.rect(u.bbox.left, u.bbox.top, u.bbox.width, u.bbox.height);
        c.clip();
        if (known(axes.mark)) {
          const x = u.valToPos(axes.mark, "x", true);
          c.strokeStyle = css("--accent");
          c.lineWidth = 2 * scale;
          c.setLineDash([4 * scale, 4 * scale]);
          c.beginPath(); c.moveTo(x, u.bbox.top); c.lineTo(x, u.bbox.top + u.bbox.height); c.stroke();
          c.setLineDash([]);
        }
        tables.forEach((row, s) => row.forEach((p) => {
          if (!p) return;
          const x = u.valToPos(p.x, "x", true);
          if (p.high > p.low) {  // the spread
            c.strokeStyle = series[s].colour;
            c.lineWidth = scale;
            c.beginPath(); c.moveTo(x, u.valToPos(p.low, "y", true)); c.lineTo(x, u.valToPos(p.high, "y", true)); c.stroke();
          }
          if (p.bad) {  // wrong answers: a red cross
            const y = u.valToPos(p.y, "y", true), r = 5 * scale;
            c.strokeStyle = css("--wrong");
            c.lineWidth = 2 * scale;
            c.beginPath(); c.moveTo(x - r, y - r); c.lineTo(x + r, y + r); c.moveTo(x - r, y + r); c.lineTo(x + r, y - r); c.stroke();
          }
        }));
        c.restore();
      }],
    },
  };
  const plot = new uPlot(options, [xs, ...tables.map((row) => row.map((p) => p?.y ?? null))], host);
  plot.over.addEventListener("click", () => { if (nearest?.p.open) nearest.p.open(); });
  const watch = new ResizeObserver(() => { if (host.isConnected && Math.abs(host.clientWidth - plot.width) > 2) plot.setSize({ width: Math.max(260, host.clientWidth), height: plot.height }); });
  watch.observe(host);
  host._plot = plot;
  return {
    reset: () => plot.setData(plot.data, true),
    mark: (x) => { axes.mark = x; plot.redraw(false); },
    end: () => { watch.disconnect(); plot.destroy(); },
  };
}
