// Everything that is known of one point, in a dialog: times by round, stages, work, answers, hashes, environment.

const facts = (pairs) => el("dl.facts", {}, pairs.filter(([, value]) => known(value) && value !== "-").map(([name, value]) => [el("dt", {}, name), el("dd", {}, value)]));

function openDetails(p) {
  const dialog = $("#details");
  const environment = DATA.environments[p.environment];
  const frames = framesOf.get(p.id) || [];
  const close = () => { dialog.close(); change({ point: "" }, true); };
  dialog.replaceChildren(
    el("header", {}, el("h2", { id: "details-title" }, `${p.name} · ${p.where}`), el("button", { type: "button", onclick: close, "aria-label": "Close" }, "✕")),
    el("div.body", {},
      isStandIn(p) && el("p.warning", {}, `Stand-in: ${p.stand_in}.`),
      p.earlier && el("p.warning", {}, `Of an earlier version of ${p.method}: another record here has a later one.`),
      p.known_inexact && el("p.warning", {}, `Declares itself inexact: ${p.known_inexact}`),
      !p.done && el("p.warning", {}, `${p.status}: ${p.reason || "no reason given"}`),
      p.done && el("section", {}, el("h3", {}, "Time"), facts([
        ["whole frame", `${textOf(p, "total_ms")} ms (quartiles ${textOf(p, "q1_ms")} to ${textOf(p, "q3_ms")})`],
        ["rounds", p.rounds > 1 ? `${p.rounds}, range between them ${textOf(p, "between_ms")} ms` : String(p.rounds)],
        ["samples a frame", whole(p.samples)], ["frames", `${p.frames}${p.frames_left_out ? `, ${p.frames_left_out} left out` : ""}`],
        ["on the host's clock", `${textOf(p, "wall_ms")} ms`], ["rays", `${textOf(p, "frame_mrays_per_s")} Mrays/s`],
        ["latency", known(p["text.p95_ms"]) ? `95 % of the frames within ${textOf(p, "p95_ms")} ms, 99 % within ${textOf(p, "p99_ms")} ms` : ""],
        ["two frames in flight", known(p["text.pair_ms"]) ? `${textOf(p, "pair_ms")} ms a frame` : ""],
        ["submitted by the host in", known(p["text.submitted_ms"]) ? `${textOf(p, "submitted_ms")} ms` : ""],
        ["compiled in", known(p["text.compile_s"]) ? `${textOf(p, "compile_s")} s` : ""], ["stopped by", p.stopped_by]]),
      stageBars(p)),
      p.done && el("section", {}, el("h3", {}, "Answers"), facts([
        ["verdict", p.error], ["unscored", p.unscored], ["pixels judged", whole(p.pixels_scored)],
        ["reference overruled", whole(p.reference_errors)], ["FLIP", p["text.flip"]],
        ["shadow rays", whole(p.shadow_rays)], ["memory", `${textOf(p, "memory_bytes")} MB`],
        ["bytes a ray", p["text.bytes_per_ray"]], ["triangle tests a primary ray", p["text.primary_tests"]], ["triangle tests a shadow ray", p["text.shadow_tests"]],
        ["energy a frame, above idle", known(p["text.energy_mj"]) ? `${textOf(p, "energy_mj")} mJ; the idle card draws ${textOf(p, "idle_w")} W` : ""],
        ["SAH cost of the tree", p["text.sah_cost"]], ["triangles a ray is expected to meet in it", p["text.expected_tests"]]])),
      frames.length > 1 && el("section", {}, el("h3", {}, "Frames"), smallTable(["frame", "ms", "quartiles", "answers"],
        frames.map((f) => [f.frame, textOf(f, "total_ms"), `${textOf(f, "q1_ms")}–${textOf(f, "q3_ms")}`, f.error]))),
      Object.keys(p.counters).length > 0 && el("details", {}, el("summary", {}, "Work counters"), smallTable(["counter", "value"],
        Object.entries(p.counters).map(([name, value]) => [name, whole(value)]))),
      el("section", {}, el("h3", {}, "Record"), facts([
        ["key", el("code", {}, p.key)], ["folder, experiment", `${p.folder}, ${p.experiment} (${p.preset || "no preset"})`], ["run", p.run],
        ["method", `${p.method_title} (${p.method})`], ["settings", p.settings], ["built", p.built],
        ["method's source", el("code", {}, p.method_sha256)], ["scene's arrays", el("code", {}, p.scene_sha256)],
        ["scene's file", p.source_file], ["file's hash", p.source_sha256 && el("code", {}, p.source_sha256)],
        ["triangles", whole(p.triangles)], ["size, device", `${p.size}, ${p.device_name} (${p.device})`]])),
      environment && el("section", {}, el("h3", {}, "Environment "), environmentFacts(p.environment, environment))));
  if (!dialog.open) dialog.showModal();
  dialog.onclose = () => change({ point: "" }, true);
  dialog.onclick = (event) => { if (event.target === dialog) close(); };
  change({ point: p.key, pf: p.folder }, true);
}

function smallTable(titles, rows) {
  return el("div.scroll", {}, el("table.small", {}, el("thead", {}, el("tr", {}, titles.map((title, i) => el(`th${i ? ".num" : ""}`, { scope: "col" }, title)))),
    el("tbody", {}, rows.map((row) => el("tr", {}, row.map((text, i) => el(i ? "td.num" : "th", i ? {} : { scope: "row" }, String(text))))))));
}

/** The passes of the frame as bars, part by part. */
function stageBars(p) {
  const steps = Object.entries(p.passes).map(([name, text]) => {
    const [part, ...rest] = name.split(".");
    return { part, name: rest.join("."), text, ms: parseFloat(text.replace(/[~,]/g, "")) };
  });
  if (!steps.length) return null;
  const order = ["build", "trace", "light build", "shadow"];
  steps.sort((a, b) => order.indexOf(a.part) - order.indexOf(b.part));
  const most = Math.max(...steps.map((step) => step.ms), 1e-9);
  return el("div.stages", {}, el("h4", {}, "Passes, ms"), steps.map((step) => {
    const bar = el("i", { class: `part-${step.part.replaceAll(" ", "-")}` });
    bar.style.width = `${Math.max(0, 100 * step.ms / most)}%`;
    return el("div.stage", {}, el("span", {}, `${step.part}: ${step.name}`), el("span.bar", {}, bar), el("b", {}, step.text));
  }));
}

function environmentFacts(name, e) {
  return facts([
    ["id", el("code", {}, name)], ["CPU", e.cpu && `${e.cpu.model}, ${e.cpu.usable_cores} ${e.cpu.usable_cores === 1 ? "core" : "cores"}`],
    ["GPU", (e.gpus || []).map((gpu) => gpu.name).join(", ")],
    ["driver", (e.gpus || []).map((gpu) => gpu.smi?.driver_version).filter(known).join(", ")],
    ["CUDA", e.cuda && `toolkit ${e.cuda.toolkit}, driver ${e.cuda.driver}`],
    ["Warp, Python", `${e.warp}, ${e.python}`], ["system", e.os],
    ["packages", Object.entries(e.packages || {}).map(([key, value]) => `${key} ${value}`).join(", ")],
    ["commit", e.git && el("code", {}, `${e.git.commit}${e.git.dirty ? " with changes" : ""}`)]]);
}
