// The views, and what draws them again when the address changes.

const VIEWS = {
  overview: ["Overview", viewOverview], table: ["Tables", viewTable], scatter: ["Errors and time", viewScatter], curves: ["Curves", viewCurves], machines: ["Machines", viewMachines],
  points: ["Points", viewPoints], pictures: ["Pictures", viewPictures], maps: ["Heat maps", viewMaps], claims: ["Claims", viewClaims], drawings: ["Drawings", viewDrawings],
};

function draw() {
  const view = VIEWS[state.view] ? state.view : "overview";
  hideTip();
  const views = Object.entries(VIEWS).filter(([key]) => key !== "machines" || repeated().length || key === view);
  $("#nav").replaceChildren(...views.map(([key, [title]]) => el("li", {}, el("a", {
    href: address({ view: key }), "aria-current": key === view ? "page" : null }, title))));
  drawFilters();
  $("#nav [aria-current]").scrollIntoView({ block: "nearest", inline: "nearest" });
  for (const [href, title] of DATA.links || []) $("#nav").append(el("li", {}, el("a", { href }, title)));
  const main = $("#main");
  const focused = document.activeElement?.closest?.("main [data-focus]")?.dataset.focus;
  const scrolled = [...main.querySelectorAll(".scroll")].map((one) => one.scrollLeft);
  const top = scrollY;
  chart?.end();
  chart = null;
  main.replaceChildren();
  main.dataset.view = view;
  const drawn = VIEWS[view][1](main);
  Promise.resolve(drawn).then(() => { main.dataset.ready = view; }, (error) => main.append(el("p.warning", {}, `Cannot be drawn: ${error.message}`)));
  if (focused) [...main.querySelectorAll("[data-focus]")].find((one) => one.dataset.focus === focused)?.focus({ preventScroll: true });
  [...main.querySelectorAll(".scroll")].forEach((one, i) => { one.scrollLeft = scrolled[i] || 0; });
  scrollTo(0, top);
  document.title = `${VIEWS[view][0]} · ${DATA.title} · shadowbench`;
}

function drawFromAddress() {
  const before = state.view;
  readAddress();
  draw();
  if (before && before !== state.view) { scrollTo(0, 0); $("#nav [aria-current]")?.focus({ preventScroll: true }); }
  if (state.point) {
    const p = points.find((one) => one.key === state.point && (!state.pf || one.folder === state.pf));
    if (p) openDetails(p);
  } else if ($("#details").open) $("#details").close();
}

const THEME = "shadowbench-theme";
function theme(chosen) {
  if (chosen) document.documentElement.dataset.theme = chosen;
  else delete document.documentElement.dataset.theme;
  try { localStorage.setItem(THEME, chosen); } catch { /* a page from a file may have no storage */ }
  $("#theme").value = chosen;
}
$("#theme").addEventListener("change", (event) => { theme(event.target.value); draw(); });
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => draw());
$("#skip").addEventListener("click", (event) => { event.preventDefault(); $("#main").focus(); });
addEventListener("hashchange", drawFromAddress);
addEventListener("popstate", drawFromAddress);

let kept = "";
try { kept = localStorage.getItem(THEME) || ""; } catch { /* none */ }
theme(kept);
$("#name").textContent = DATA.title;
$("#footer").append(el("p", {}, `Drawn by shadowbench ${DATA.version} from ${points.length} records. Every number is from the records in ${DATA.title}, except in columns that say "paper": these are Guntury and Narayanan's, 2010, on a GTX 280. `,
  "A stand-in is geometry made by a program in place of a scene that cannot be distributed."));
readAddress();
drawFromAddress();
