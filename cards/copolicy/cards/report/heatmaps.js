/** Heat maps of the body's position and of the interaction measure. */

let heat = null;

function setUpHeatmaps() {
  if (!OUTLINE) return byId("heat-figures").replaceChildren(missingNote("outline"));
  if (MISSING.interaction) byId("heat-force-figure").replaceChildren(missingNote("interaction"));
  const options = [60, 40, 20].map((cells) => make("option", { value: WIDTH / cells, selected: cells === 40 }, formatNumber(WIDTH / cells)));
  byId("heat-cell").replaceChildren(...options);
  for (const id of ["heat-layout", "heat-cell"]) byId(id).addEventListener("input", () => showHeatmaps(selection));
  for (const [id, name] of offered([["outline", ["heat-visits", "visits"]], ["interaction", ["heat-force", "force"]]])) {
    byId(id).addEventListener("pointermove", (event) => readHeat(event, name));
    byId(id).addEventListener("pointerleave", () => { byId("heat-readout").textContent = ""; });
  }
}

function showHeatmaps(selected) {
  if (!OUTLINE) return;
  const select = byId("heat-layout");
  const previous = select.value;
  const layouts = [...groupBy(selected, (episode) => episode.layout).keys()].sort((a, b) => a.length - b.length || a.localeCompare(b));
  select.replaceChildren(make("option", { value: "*" }, "all"), ...layouts.map((value) => make("option", { value }, value)));
  select.value = layouts.includes(previous) ? previous : "*";
  const members = select.value === "*" ? selected : selected.filter((episode) => episode.layout === select.value);

  heat = accumulate(members, Number(byId("heat-cell").value));
  const visits = ordered([...heat.counts].filter((count) => count > 0));
  const most = visits.length ? visits[visits.length - 1] : 1;
  const visitProportion = (count) => (most > 1 ? Math.log(count) / Math.log(most) : 1);
  drawHeat(byId("heat-visits"), members, (k) => visitProportion(heat.counts[k]),
    `Visitation of ${members.length} episodes; the most visited cell holds ${formatNumber(most * FRAME_SECONDS)} s`);
  showScale("heat-visits-scale", `${formatNumber(FRAME_SECONDS)} s`, `${formatNumber(most * FRAME_SECONDS)} s`);
  if (MISSING.interaction) return;
  const forces = ordered([...heat.counts].map((count, k) => (count ? heat.sums[k] / count : null)));
  const strongest = quantile(forces, 0.99) || 1;
  drawHeat(byId("heat-force"), members, (k) => heat.sums[k] / heat.counts[k] / strongest,
    `Mean ${WORDS.interaction} of ${members.length} episodes; 99 % of cells are below ${formatNumber(strongest)}`);
  showScale("heat-force-scale", "0", `${formatNumber(strongest)} and more`);
}

/** Number of frames, and sum of the absolute interaction measure, in each cell. */
function accumulate(members, cell) {
  const columns = Math.round(WIDTH / cell);
  const rows = Math.ceil(HEIGHT / cell - 1e-9);
  const counts = new Float64Array(columns * rows);
  const sums = new Float64Array(columns * rows);
  for (const episode of members) {
    const [xs, ys] = ["x", "y"].map((name) => column(episode, name));
    const forces = MISSING.interaction ? [] : column(episode, "interaction");
    for (let k = 0; k < xs.length; k++) {
      const i = Math.min(columns - 1, Math.max(0, Math.floor(xs[k] / cell)));
      const j = Math.min(rows - 1, Math.max(0, Math.floor(ys[k] / cell)));
      counts[j * columns + i] += 1;
      sums[j * columns + i] += Math.abs(forces[k]);
    }
  }
  return { cell, columns, rows, counts, sums };
}

function drawHeat(canvas, members, proportionAt, label) {
  canvas.setAttribute("aria-label", label);
  const context = sceneContext(canvas, canvas.clientWidth || 480);
  heat.counts.forEach((count, k) => {
    if (!count) return;
    context.fillStyle = heatColour(proportionAt(k));
    context.fillRect((k % heat.columns) * heat.cell, Math.floor(k / heat.columns) * heat.cell, heat.cell + 0.5 * UNIT, heat.cell + 0.5 * UNIT);
  });
  drawFixed(context, members, "obstacle", [null, colour("--ink")]);
  drawFixed(context, members, "goal", [null, GOAL_COLOUR]);
}

function showScale(id, low, high) {
  const ramp = make("span", { class: "ramp", "aria-hidden": "true" });
  ramp.style.background = `linear-gradient(90deg, ${CIVIDIS.join(",")})`;
  byId(id).replaceChildren(make("div", { class: "scale" }, low, ramp, high));
}

function readHeat(event, name) {
  const box = event.target.getBoundingClientRect();
  const [x, y] = [event.clientX - box.left, event.clientY - box.top].map((value) => (value * WIDTH) / box.width);
  const k = Math.floor(y / heat.cell) * heat.columns + Math.floor(x / heat.cell);
  const count = heat.counts[k] ?? 0;
  const value = name === "visits" ? `${formatNumber(count * FRAME_SECONDS)} s` : count ? formatNumber(heat.sums[k] / count) : "never visited";
  byId("heat-readout").textContent = `x ${placeText(x)}, y ${placeText(y)} ${OUTLINE.unit}: ${value}`;
}
