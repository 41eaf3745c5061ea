/** Route statistics of `copolicy-dataset stats`: divergence from human routes, and entropy by configuration. */

function showRouteStatistics() {
  const container = byId("route-statistics");
  const routes = data.routes;
  if (MISSING.labels) return container.replaceChildren(missingNote("labels"));
  if (!routes || !(routes.distances.length || routes.configurations.length)) {
    const reason = data.statistics
      ? "The stored statistics hold no route statistics; copolicy-dataset stats FOLDER computes them."
      : "copolicy-dataset stats was not run on this data set: no entropy of routes, and no distance from human routes.";
    container.replaceChildren(make("p", { class: "missing" }, reason));
    return;
  }
  container.replaceChildren(
    ...staleStatisticsNote(),
    make("p", {}, make("strong", {}, `The episodes were played by ${routes.played_by}. `),
      `All that ${WORDS.success} are counted; the filters above do not apply.`),
    ...(routes.distances.length ? distanceFromPeople(routes) : []),
    ...(routes.configurations.length ? entropyByConfiguration(routes) : []),
  );
}

function distanceFromPeople(routes) {
  const demonstrations = routes.distances.reduce((sum, distance) => sum + distance.demonstrations, 0);
  const legend = make("p", { class: "legend" },
    paintKey(`this data set: ${routes.played_by}`, data.colours.sides[0]), paintKey("people", data.colours.sides[1]),
    paintKey("null distribution of the divergence, 95 %", colour("--line")));
  return [
    make("h3", {}, "Distance from the routes of people"),
    make("p", {}, `Proportions of the routes in this data set and in ${demonstrations} human-human demonstrations; below, the ` +
      "Jensen-Shannon divergence between both, with its 95 % interval."),
    legend,
    make("div", { class: "panels" }, ...routes.distances.map((distance) => distanceFigure(distance, routes.played_by))),
    definition(`${routes.distances[0].definition} (First figure; the others differ in the number of obstacles.) ` +
      `People: ${routes.human_source}.`),
  ];
}

const BARS = { width: 340, left: 44, right: 44, row: 36, axis: 58 };

/** Two bars per route, and the divergence on an axis from 0 to 1 bit. */
function distanceFigure(distance, playedBy) {
  const span = BARS.width - BARS.left - BARS.right;
  const xAt = (proportion) => BARS.left + proportion * span;
  const nodes = distance.routes.flatMap(({ word, ours, human }, index) => {
    const top = index * BARS.row + 4;
    const bar = (count, total, y, barClass) => {
      const proportion = count / Math.max(1, total);
      return [
        makeSvg("rect", { x: BARS.left, y, width: Math.max(0.5, proportion * span), height: 13, class: barClass }),
        makeSvg("text", { x: xAt(proportion) + 4, y: y + 11 }, `${Math.round(100 * proportion)} %`),
      ];
    };
    return [
      makeSvg("text", { x: 0, y: top + 18 }, word),
      ...bar(ours, distance.episodes, top, "dot"), ...bar(human, distance.demonstrations, top + 14, "people"),
    ];
  });
  const y = distance.routes.length * BARS.row + 18;
  if (distance.chance) nodes.push(makeSvg("rect", { x: xAt(distance.chance[0]), y: y - 8, width: Math.max(1, xAt(distance.chance[2]) - xAt(distance.chance[0])), height: 16, class: "null" }));
  nodes.push(makeSvg("line", { x1: xAt(0), x2: xAt(1), y1: y + 10, y2: y + 10, class: "axis" }));
  for (const tick of [0, 0.5, 1]) nodes.push(makeSvg("text", { x: xAt(tick), y: y + 24, "text-anchor": "middle" }, `${tick}${tick === 1 ? " bit" : ""}`));
  if (distance.interval) nodes.push(makeSvg("line", { x1: xAt(distance.interval[0]), x2: xAt(distance.interval[1]), y1: y, y2: y, class: "whisker" }));
  if (distance.bits !== null) nodes.push(makeSvg("circle", { cx: xAt(distance.bits), cy: y, r: 4.5, class: "estimate" }));

  const name = `${distance.obstacles} obstacle${distance.obstacles === 1 ? "" : "s"}`;
  const divergence = distance.bits === null ? distance.note || "not computed" : `${distance.bits.toFixed(3)} bits${spanText(distance.interval, 3)}`;
  const nullText = distance.chance ? `; null distribution mean ${formatNumber(distance.chance[1])}, p = ${formatNumber(distance.p)}` : "";
  const mirrored = distance.reading === "mirrored" ? " The human L and R are exchanged, which gives the smaller divergence." : "";
  const words = distance.routes.map(({ word, ours, human }) => `${word} ${ours} in this data set, ${human} of people`).join("; ");
  const height = distance.routes.length * BARS.row + BARS.axis;
  return make(
    "figure", {},
    make("figcaption", {}, make("strong", {}, `${name}: ${divergence}`), `${nullText}. ${distance.episodes} episodes of ${playedBy}, ${distance.demonstrations} human demonstrations.${mirrored}`),
    makeSvg("svg", { viewBox: `0 0 ${BARS.width} ${height}`, class: "distribution", role: "img", "aria-label": `${name}, divergence ${divergence}. ${words}` }, ...nodes),
  );
}

function entropyByConfiguration(routes) {
  const most = Math.max(1, ...routes.configurations.map((entry) => entry.obstacles));
  const { entropy } = routes;
  const modes = entropy.effective_modes ? `, ${formatNumber(entropy.effective_modes)} effective modes` : "";
  const heads = ["Configuration", "Episodes", "Routes", "Entropy, bits", "95 % interval", "Effective modes", "95 % interval"];
  const rows = routes.configurations.map((entry) => {
    const parts = Object.entries(entry.counts).sort().map(([word, count]) => [word, count, labelColour(word)]);
    return make(
      "tr", {},
      make("th", { scope: "row" }, entry.name),
      make("td", { class: "number" }, String(entry.episodes)),
      make("td", {}, proportionBar("", parts, entry.episodes)),
      make("td", { class: "plotted" }, bitsPlot(entry, most), make("small", {}, formatNumber(entry.entropy_bits))),
      make("td", {}, entry.interval ? spanText(entry.interval).slice(2, -1) : entry.note ?? "–"),
      make("td", { class: "number" }, formatNumber(entry.effective_modes)),
      make("td", {}, entry.effective_modes_interval ? spanText(entry.effective_modes_interval).slice(2, -1) : "–"),
    );
  });
  return [
    make("h3", {}, "Entropy of the routes in each configuration"),
    make("p", {}, make("strong", {}, entropy.value === null ? "No entropy" : `${formatNumber(entropy.value)} bits${spanText(entropy.interval)}${modes}`),
      ` over ${rows.length} configurations of ${routes.played_by}${entropy.value === null ? `: ${entropy.note}` : ""}. Sorted by entropy; few episodes give a wide interval.`),
    definition(entropy.definition ?? ""),
    scrolling("Entropy of the routes in each configuration", "scroll tall", { id: "configuration-table" }, heads, rows),
  ];
}

/** An entropy with its interval, on an axis from 0 to the bits of the largest number of obstacles. */
function bitsPlot(entry, most) {
  const xAt = (bits) => 5 + (bits / most) * (PLOT[0] - 10);
  const axis = makeSvg("line", { x1: 5, x2: PLOT[0] - 5, y1: 9, y2: 9, class: "axis" });
  if (entry.entropy_bits === null || !entry.interval) return plot(axis);
  return plot(
    axis,
    makeSvg("line", { x1: xAt(entry.interval[0]), x2: xAt(entry.interval[1]), y1: 9, y2: 9, class: "whisker wide" }),
    makeSvg("circle", { cx: xAt(entry.entropy_bits), cy: 9, r: 4.5, class: "dot" }),
  );
}

/** ` (low to high)`, empty without an interval. */
function spanText(interval, decimals = null) {
  if (!interval) return "";
  const [low, high] = interval.map((value) => (decimals === null ? formatNumber(value) : value.toFixed(decimals)));
  return ` (${low} to ${high})`;
}

function definition(text) {
  return make("details", { class: "definition" }, make("summary", {}, "Definition"), text);
}
