// The filters above every view: experiment, scene, method, device, a search, and the scale of times.

const clear = () => change({ q: "", ...Object.fromEntries(LISTS.map((key) => [key, []])) });

function drawFilters() {
  const host = $("#filters");
  const open = host.querySelector("details[open]")?.dataset.key;
  const focused = document.activeElement?.dataset?.focus;
  const caret = document.activeElement?.selectionStart;
  const several = ([key, { of }]) => state[key].length || unique(points.map(of)).length > 1;
  const picks = Object.entries(FILTERS).filter(several).map(([key, { title, of }]) => {
    const counts = new Map(unique(points.map(of)).map((value) => [value, 0]));
    for (const p of shown([key])) counts.set(of(p), counts.get(of(p)) + 1);
    const chosen = state[key];
    const summary = chosen.length === 0 ? "all" : chosen.length === 1 ? chosen[0] : `${chosen.length} of ${counts.size}`;
    const boxes = [...counts].map(([value, count]) => toggle(
      el("span", {}, value, el("i", {}, ` ${count}`)), chosen.includes(value),
      (on) => change({ [key]: on ? [...chosen, value] : chosen.filter((one) => one !== value) }),
      { "data-focus": `${key}:${value}` }));
    return el("details.pick", { "data-key": key, open: open === key },
      el("summary", { "data-focus": `${key}` }, `${title}: `, el("b", {}, summary)),
      el("fieldset", {}, el("legend.hidden", {}, title), el("div.options", {}, boxes),
        el("button.small", { type: "button", disabled: !chosen.length, "data-focus": `${key}!`, onclick: () => change({ [key]: [] }) }, "All")));
  });
  const any = Object.keys(FILTERS).some((key) => state[key].length) || state.q;
  host.replaceChildren(
    ...picks,
    el("label.field.search", {}, el("span.hidden", {}, "Search"), el("input", {
      type: "search", placeholder: "Search", value: state.q || "", "data-focus": "q", oninput: (event) => change({ q: event.target.value }) })),
    el("div.segmented", { role: "group", "aria-label": "Scale of times" }, ["log", "linear"].map((one) => el("button", {
      type: "button", "aria-pressed": String((state.scale || "log") === one), "data-focus": `scale:${one}`,
      onclick: () => change({ scale: one === "log" ? "" : one }) }, one))),
    el("button.small", { type: "button", disabled: !any, "data-focus": "clear", onclick: clear }, "Clear filters"),
  );
  if (focused) {
    const again = [...host.querySelectorAll("[data-focus]")].find((node) => node.dataset.focus === focused);
    again?.focus();
    if (again?.type === "search") again.setSelectionRange(caret, caret);
  }
}

// One list is open at a time; Escape and a click elsewhere close it.
document.addEventListener("toggle", (event) => {
  if (event.target.matches?.("details.pick[open]")) {
    for (const other of document.querySelectorAll("details.pick[open]")) if (other !== event.target) other.open = false;
  }
}, true);
document.addEventListener("click", (event) => {
  // What was clicked may be drawn anew by now, and no longer be in the list.
  if (!event.target.isConnected || event.target.closest("details.pick")) return;
  for (const one of document.querySelectorAll("details.pick[open]")) one.open = false;
});
document.addEventListener("keydown", (event) => {
  const open = event.key === "Escape" && document.querySelector("details.pick[open]");
  if (open) { open.open = false; $("summary", open).focus(); }
});
