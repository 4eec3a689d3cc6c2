// Elements, numbers as text, the tooltip, and the state in the address.

const $ = (selector, root = document) => root.querySelector(selector);

/** An element. `on...` attributes are listeners, false and null leave an attribute out, children are nodes or texts. */
function el(name, attributes = {}, ...children) {
  const [tag, ...classes] = name.split(".");
  const node = document.createElement(tag);
  if (classes.length) node.className = classes.join(" ");
  for (const [key, value] of Object.entries(attributes)) {
    if (value === false || value === null || value === undefined) continue;
    if (key.startsWith("on")) node.addEventListener(key.slice(2), value);
    else if (key in node && typeof value !== "string") node[key] = value;
    else node.setAttribute(key, value === true ? "" : value);
  }
  node.append(...children.flat(Infinity).filter((child) => child !== null && child !== undefined && child !== false));
  return node;
}

/** A whole number, such as a count. Measured numbers come as texts, with the digits that they carry. */
const whole = (value) => (value === null || value === undefined ? "–" : value.toLocaleString("en-US", { maximumFractionDigits: Number.isInteger(value) ? 0 : 1 }));
/** A value on an axis: 0.001, 20, 1e5. */
const onAxis = (v) => (v !== 0 && (Math.abs(v) >= 1e5 || Math.abs(v) < 1e-3) ? v.toExponential(0).replace("e+", "e") : `${+v.toPrecision(4)}`);
const unique = (values) => [...new Set(values)];
const known = (value) => value !== null && value !== undefined && value !== "";

// The state: what the address says after "#". Lists are joined by "~", which no name has.
const state = {};
const LISTS = ["exp", "scene", "method", "machine", "device"];

function readAddress() {
  for (const key of Object.keys(state)) delete state[key];
  for (const [key, value] of new URLSearchParams(location.hash.slice(1))) {
    state[key] = LISTS.includes(key) ? value.split("~").filter(Boolean) : value;
  }
  for (const key of LISTS) state[key] = state[key] || [];
  state.view = state.view || "overview";
}

function address(changes = {}) {
  const wanted = new URLSearchParams();
  for (const [key, value] of Object.entries({ ...state, ...changes })) {
    const text = Array.isArray(value) ? value.join("~") : value;
    if (known(text)) wanted.set(key, text);
  }
  return `#${wanted}`;
}

/** Change the state and draw again. `quiet`: the caller has drawn already; only the address follows. */
function change(changes, quiet = false) {
  const view = state.view;
  Object.assign(state, changes);
  for (const [key, value] of Object.entries(state)) if (!known(value)) delete state[key];
  const target = address();
  if (view !== state.view) history.pushState(null, "", target);
  else history.replaceState(null, "", target);
  if (!quiet) draw();
}

/** Say something to screen readers. */
const say = (text) => { $("#said").textContent = text; };

// One tooltip for all: nodes that have one carry a function that gives its lines.
const tips = new WeakMap();
function withTip(node, lines) {
  tips.set(node, lines);
  return node;
}

function showTip(target, at) {
  let node = target;
  while (node && node.nodeType === 1 && !tips.has(node)) node = node.parentElement;
  const tip = $("#tip");
  if (!node || !tips.has(node)) { tip.hidden = true; return; }
  const lines = tips.get(node)();
  if (!lines || !lines.length) { tip.hidden = true; return; }
  placeTip(lines, at || node.getBoundingClientRect());
}

function placeTip(lines, box) {
  const tip = $("#tip");
  tip.replaceChildren(...lines.filter(known).map((line, i) => Array.isArray(line)
    ? el("div.pair", {}, el("span", {}, line[0]), el("b", {}, line[1]))
    : el(i ? "div" : "div.head", {}, line)));
  tip.hidden = false;
  const own = tip.getBoundingClientRect();
  const wanted = box.before ? box.left - own.width - 24 : box.left;
  const left = Math.max(4, Math.min(innerWidth - own.width - 4, wanted));
  const below = box.bottom + 6;
  const top = below + own.height > innerHeight ? Math.max(4, box.top - own.height - 6) : below;
  tip.style.left = `${left}px`;
  tip.style.top = `${top}px`;
}
const hideTip = () => { $("#tip").hidden = true; };

document.addEventListener("mouseover", (event) => showTip(event.target));
document.addEventListener("focusin", (event) => {
  // A click focuses too; the tooltip of a keyboard follows the keyboard alone.
  if (event.target.matches(":focus-visible")) showTip(event.target); else hideTip();
});
document.addEventListener("focusout", hideTip);
document.addEventListener("scroll", hideTip, { capture: true, passive: true });
document.addEventListener("keydown", (event) => { if (event.key === "Escape") hideTip(); });

/** A labelled select. `options`: texts, or [value, text]. */
function select(label, options, value, onchange, attributes = {}) {
  const field = el("select", { onchange: (event) => onchange(event.target.value), ...attributes },
    options.map((one) => (Array.isArray(one) ? el("option", { value: one[0] }, one[1]) : el("option", { value: one }, one))));
  field.value = value;
  return el("label.field", {}, el("span", {}, label), field);
}

function toggle(label, on, onchange, attributes = {}) {
  return el("label.check", {}, el("input", { type: "checkbox", checked: on, onchange: (event) => onchange(event.target.checked), ...attributes }), label);
}
