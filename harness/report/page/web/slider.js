// Two pictures in one frame, parted by a line that is dragged or moved by the arrow keys; enlarged where asked.

/** left, right: canvases or images of one size; `place`: per cent from the left. Returns the figure. */
function twoPictures(left, right, labels, name, read) {
  const start = Number(state[`${name}.cut`] ?? 50);
  const zoom = Number(state[`${name}.zoom`] ?? 1);
  const over = el("div.over", {}, right);
  const line = el("div.cut", { "aria-hidden": "true" });
  const frame = el("div.frame", {}, el("div.under", {}, left), over, line,
    el("span.tag.left", {}, labels[0]), el("span.tag.right", {}, labels[1]));
  const inner = el("div.inner", {}, frame);
  inner.style.width = `${100 * zoom}%`;
  const shape = left.width / left.height;
  const window_ = el("div.window", { role: "group", "aria-label": `${labels[0]} and ${labels[1]}` }, inner);
  window_.style.width = `min(100%, ${(78 * shape).toFixed(1)}vh)`;
  const range = el("input", { type: "range", min: 0, max: 100, step: 0.5, value: String(start), "data-focus": `${name}.cut`,
    "aria-label": `Divider of the pictures: ${labels[0]} left, ${labels[1]} right`, oninput: () => cut(Number(range.value)), onchange: () => change({ [`${name}.cut`]: range.value }, true) });
  function cut(percent_) {
    over.style.clipPath = `inset(0 0 0 ${percent_}%)`;
    line.style.left = `${percent_}%`;
    frame.dataset.cut = percent_;
    range.value = percent_;
  }
  const drag = (event) => {
    const box = frame.getBoundingClientRect();
    cut(Math.max(0, Math.min(100, 100 * (event.clientX - box.left) / box.width)));
  };
  frame.addEventListener("pointerdown", (event) => { frame.setPointerCapture(event.pointerId); drag(event); event.preventDefault(); });
  frame.addEventListener("pointermove", (event) => {
    if (event.buttons) drag(event);
    if (!read) return;
    const box = frame.getBoundingClientRect();
    const lines = read((event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height);
    if (lines) placeTip(lines, { left: event.clientX + 12, top: event.clientY - 4, bottom: event.clientY + 4 });
  });
  frame.addEventListener("pointerleave", hideTip);
  frame.addEventListener("pointerup", () => change({ [`${name}.cut`]: range.value }, true));
  cut(start);
  return el("figure.compare", {}, window_, el("div.under-picture", {}, range,
    select("Enlarged", [["1", "1×"], ["2", "2×"], ["4", "4×"], ["8", "8×"]], String(zoom), (value) => change({ [`${name}.zoom`]: value === "1" ? "" : value }), { "data-focus": `${name}.zoom` })));
}

const loaded = new Map();
/** The pixels of a picture, once: [width, height, RGBA bytes]. */
function pixelsOf(uri) {
  if (!loaded.has(uri)) {
    loaded.set(uri, new Promise((resolve, reject) => {
      const image = new Image();
      image.onload = () => {
        const canvas = el("canvas", { width: image.naturalWidth, height: image.naturalHeight });
        const c = canvas.getContext("2d", { willReadFrequently: true });
        c.drawImage(image, 0, 0);
        resolve({ width: canvas.width, height: canvas.height, bytes: c.getImageData(0, 0, canvas.width, canvas.height).data });
      };
      image.onerror = () => reject(new Error("a picture of this page is damaged"));
      image.src = uri;
    }));
  }
  return loaded.get(uri);
}

/** The 24-bit numbers that a map has in red, green and blue. */
async function countsOf(uri) {
  const { width, height, bytes } = await pixelsOf(uri);
  const counts = new Uint32Array(width * height);
  for (let i = 0; i < counts.length; i++) counts[i] = (bytes[4 * i] << 16) | (bytes[4 * i + 1] << 8) | bytes[4 * i + 2];
  return { width, height, counts };
}

// Stops of the colour map "inferno" (public domain, CC0), from few to many.
const RAMP = ["#000004", "#1b0c41", "#4a0c6b", "#781c6d", "#a52c60", "#cf4446", "#ed6925", "#fb9b06", "#f7d13d", "#fcffa4"]
  .map((hex) => [1, 3, 5].map((i) => parseInt(hex.slice(i, i + 2), 16)));
function ramp(share) {
  const at = Math.max(0, Math.min(1, share)) * (RAMP.length - 1);
  const i = Math.min(RAMP.length - 2, Math.floor(at));
  return RAMP[i].map((low, k) => Math.round(low + (RAMP[i + 1][k] - low) * (at - i)));
}

function painted(width, height, colour) {
  const canvas = el("canvas", { width, height });
  const c = canvas.getContext("2d");
  const image = c.createImageData(width, height);
  for (let i = 0; i < width * height; i++) {
    const [r, g, b, a = 255] = colour(i);
    image.data.set([r, g, b, a], 4 * i);
  }
  c.putImageData(image, 0, 0);
  return canvas;
}
