/** What `copolicy-dataset stats` found about routes: how far from those of people, and how mixed on each map. */

function showRouteStatistics() {
  const place = byId("route-statistics");
  const routes = data.routes;
  if (MISSING.labels) return place.replaceChildren(absent("labels"));
  if (!routes || !(routes.distances.length || routes.configurations.length)) {
    const why = data.statistics
      ? "The stored statistics hold nothing about routes: copolicy-dataset stats FOLDER computes them anew."
      : "copolicy-dataset stats was not run on this data set: no entropy of routes, and no distance from those of people.";
    place.replaceChildren(make("p", { class: "absent" }, why));
    return;
  }
  place.replaceChildren(
    ...statisticsDoubt(),
    make("p", {}, make("strong", {}, `The episodes are of ${routes.played_by}. `),
      `All that ${WORDS.success} are counted, whatever is chosen above.`),
    ...(routes.distances.length ? distanceFromPeople(routes) : []),
    ...(routes.configurations.length ? entropyByConfiguration(routes) : []),
  );
}

function distanceFromPeople(routes) {
  const demonstrations = routes.distances.reduce((sum, one) => sum + one.demonstrations, 0);
  const legend = make("p", { class: "legend" },
    paintKey(`this data set: ${routes.played_by}`, data.colours.sides[0]), paintKey("people", data.colours.sides[1]),
    paintKey("divergence of two draws from one distribution, 95 % of them", colour("--line")));
  return [
    make("h3", {}, "Distance from the routes of people"),
    make("p", {}, `Shares of the routes beside those of ${demonstrations} human-human demonstrations, and below them the ` +
      "Jensen-Shannon divergence between the two, with its 95 % interval."),
    legend,
    make("div", { class: "panels" }, ...routes.distances.map((one) => distanceFigure(one, routes.played_by))),
    definition(`${routes.distances[0].definition} The first figure's; the others differ in the number of obstacles. ` +
      `People: ${routes.human_source}.`),
  ];
}

const BARS = { width: 340, left: 44, right: 44, row: 36, axis: 58 };

/** Two bars for each route, and the divergence on an axis from 0 to 1 bit. */
function distanceFigure(one, playedBy) {
  const span = BARS.width - BARS.left - BARS.right;
  const at = (share) => BARS.left + share * span;
  const nodes = one.routes.flatMap(({ word, ours, human }, place) => {
    const top = place * BARS.row + 4;
    const bar = (count, total, y, kind) => {
      const share = count / Math.max(1, total);
      return [
        makeSvg("rect", { x: BARS.left, y, width: Math.max(0.5, share * span), height: 13, class: kind }),
        makeSvg("text", { x: at(share) + 4, y: y + 11 }, `${Math.round(100 * share)} %`),
      ];
    };
    return [
      makeSvg("text", { x: 0, y: top + 18 }, word),
      ...bar(ours, one.episodes, top, "dot"), ...bar(human, one.demonstrations, top + 14, "people"),
    ];
  });
  const y = one.routes.length * BARS.row + 18;
  if (one.chance) nodes.push(makeSvg("rect", { x: at(one.chance[0]), y: y - 8, width: Math.max(1, at(one.chance[2]) - at(one.chance[0])), height: 16, class: "chance" }));
  nodes.push(makeSvg("line", { x1: at(0), x2: at(1), y1: y + 10, y2: y + 10, class: "axis" }));
  for (const tick of [0, 0.5, 1]) nodes.push(makeSvg("text", { x: at(tick), y: y + 24, "text-anchor": "middle" }, `${tick}${tick === 1 ? " bit" : ""}`));
  if (one.interval) nodes.push(makeSvg("line", { x1: at(one.interval[0]), x2: at(one.interval[1]), y1: y, y2: y, class: "whisker" }));
  if (one.bits !== null) nodes.push(makeSvg("circle", { cx: at(one.bits), cy: y, r: 4.5, class: "estimate" }));

  const name = `${one.obstacles} obstacle${one.obstacles === 1 ? "" : "s"}`;
  const distance = one.bits === null ? one.note || "not computed" : `${one.bits.toFixed(3)} bits${spanText(one.interval, 3)}`;
  const chance = one.chance ? `; by chance ${formatNumber(one.chance[1])}, p = ${formatNumber(one.p)}` : "";
  const mirrored = one.reading === "mirrored" ? " The human L and R are exchanged, which is the nearer reading." : "";
  const words = one.routes.map(({ word, ours, human }) => `${word} ${ours} here, ${human} of people`).join("; ");
  const height = one.routes.length * BARS.row + BARS.axis;
  return make(
    "figure", {},
    make("figcaption", {}, make("strong", {}, `${name}: ${distance}`), `${chance}. ${one.episodes} episodes of ${playedBy}, ${one.demonstrations} of people.${mirrored}`),
    makeSvg("svg", { viewBox: `0 0 ${BARS.width} ${height}`, class: "distribution", role: "img", "aria-label": `${name}, divergence ${distance}. ${words}` }, ...nodes),
  );
}

function entropyByConfiguration(routes) {
  const most = Math.max(1, ...routes.configurations.map((entry) => entry.obstacles));
  const { entropy } = routes;
  const modes = entropy.effective_modes ? `, ${formatNumber(entropy.effective_modes)} effective modes` : "";
  const heads = ["Configuration", "Episodes", "Routes taken", "Entropy, bits", "95 % interval", "Effective modes", "95 % interval"];
  const rows = routes.configurations.map((entry) => {
    const parts = Object.entries(entry.counts).sort().map(([word, count]) => [word, count, labelColour(word)]);
    return make(
      "tr", {},
      make("th", { scope: "row" }, entry.name),
      make("td", { class: "number" }, String(entry.episodes)),
      make("td", {}, shareBar("", parts, entry.episodes)),
      make("td", { class: "plotted" }, bitsPlot(entry, most), make("small", {}, formatNumber(entry.entropy_bits))),
      make("td", {}, entry.interval ? spanText(entry.interval).slice(2, -1) : entry.note ?? "–"),
      make("td", { class: "number" }, formatNumber(entry.effective_modes)),
      make("td", {}, entry.effective_modes_interval ? spanText(entry.effective_modes_interval).slice(2, -1) : "–"),
    );
  });
  return [
    make("h3", {}, "Entropy of the routes in each configuration"),
    make("p", {}, make("strong", {}, entropy.value === null ? "No entropy" : `${formatNumber(entropy.value)} bits${spanText(entropy.interval)}${modes}`),
      ` over ${rows.length} configurations of ${routes.played_by}${entropy.value === null ? `: ${entropy.note}` : ""}. The most mixed come first; few episodes make a wide interval.`),
    definition(entropy.definition ?? ""),
    scrolling("Entropy of the routes in each configuration", "scroll tall", { id: "configuration-table" }, heads, rows),
  ];
}

/** An entropy with its interval on an axis from 0 to the bits of the most obstacles. */
function bitsPlot(entry, most) {
  const place = (bits) => 5 + (bits / most) * (PLOT[0] - 10);
  const axis = makeSvg("line", { x1: 5, x2: PLOT[0] - 5, y1: 9, y2: 9, class: "axis" });
  if (entry.entropy_bits === null || !entry.interval) return plot(axis);
  return plot(
    axis,
    makeSvg("line", { x1: place(entry.interval[0]), x2: place(entry.interval[1]), y1: 9, y2: 9, class: "whisker wide" }),
    makeSvg("circle", { cx: place(entry.entropy_bits), cy: 9, r: 4.5, class: "dot" }),
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
