/** One row per pair: success, duration, interaction and strategy labels. */

function showPairs(selected) {
  const groups = [...groupBy(selected, (episode) => episode.pair_id ?? "")].sort((a, b) =>
    a[0].localeCompare(b[0], "en", { numeric: true }),
  );
  const span = (name) => {
    const values = ordered(selected.map((episode) => episode[name]));
    return [quantile(values, 0.01) ?? 0, quantile(values, 0.99) ?? 1];
  };
  const [durations, forces] = [span("duration_s"), span("force_mean")];
  const rows = groups.map(([pair, members]) => {
    const successes = members.filter((episode) => episode.success).length;
    const players = new Set(members.flatMap((e) => [e.player_0_id, e.player_1_id]).filter(Boolean));
    return make(
      "tr", {},
      make("th", { scope: "row", title: [...players].join(", ") }, pair || "not stated"),
      make("td", {}, [...new Set(members.map((episode) => episode.source))].join(", ")),
      make("td", { class: "number" }, String(members.length)),
      make("td", { class: "plotted" }, intervalPlot(successes, members.length), make("small", {}, percent(successes / members.length))),
      make("td", { class: "plotted" }, boxPlot(members.map((e) => e.duration_s), durations), make("small", {}, `${formatNumber(middle(members, "duration_s"))} s`)),
      ...offered([
        ["interaction", make("td", { class: "plotted" }, boxPlot(members.map((e) => e.force_mean), forces), make("small", {}, formatNumber(middle(members, "force_mean"))))],
        ["labels", make("td", {}, sideBar(members))],
      ]),
    );
  });
  const heads = ["Pair", "Source", "Episodes", "Success", "Duration, s"];
  heads.push(...offered([["interaction", capital(WORDS.interaction)], ["labels", data.sides ? "Sides passed (L, R)" : capital(WORDS.label)]]));
  byId("pair-table").replaceChildren(...tableParts(heads, rows));
}

const PLOT = [130, 18];

function plot(...children) {
  return makeSvg("svg", { viewBox: `0 0 ${PLOT[0]} ${PLOT[1]}`, width: PLOT[0], height: PLOT[1], class: "plot", "aria-hidden": "true" }, ...children);
}

/** A proportion as a dot with its Wilson interval, on an axis from 0 to 1. */
function intervalPlot(successes, n) {
  const xAt = (proportion) => 5 + proportion * (PLOT[0] - 10);
  const [low, high] = wilson(successes, n);
  return plot(
    makeSvg("line", { x1: 5, x2: PLOT[0] - 5, y1: 9, y2: 9, class: "axis" }),
    makeSvg("line", { x1: xAt(low), x2: xAt(high), y1: 9, y2: 9, class: "whisker wide" }),
    makeSvg("circle", { cx: xAt(successes / n), cy: 9, r: 4.5, class: "dot" }),
  );
}

/** Quartiles, 5th and 95th percentile and median of numbers, on the common axis of all rows. */
function boxPlot(values, [from, to]) {
  const sorted = ordered(values);
  if (!sorted.length) return plot();
  const xAt = (value) => 4 + (Math.min(1, Math.max(0, value - from) / (to - from || 1)) * (PLOT[0] - 8));
  const [p5, p25, p50, p75, p95] = [0.05, 0.25, 0.5, 0.75, 0.95].map((proportion) => xAt(quantile(sorted, proportion)));
  return plot(
    makeSvg("line", { x1: p5, x2: p95, y1: 9, y2: 9, class: "whisker" }),
    makeSvg("rect", { x: p25, width: Math.max(1, p75 - p25), y: 3, height: 12, class: "box" }),
    makeSvg("line", { x1: p50, x2: p50, y1: 2, y2: 16, class: "median" }),
  );
}

/** Numbers of obstacles passed left and right; for labels without sides, the number of episodes by label. */
function sideBar(members) {
  if (!data.sides) {
    const groups = [...groupBy(members, (episode) => episode.route_class ?? "")];
    return proportionBar("", groups.map(([label, labelled]) => [label || "none", labelled.length, labelColour(label)]), members.length);
  }
  const letters = members.map((episode) => episode.route_class ?? "").join("");
  const left = [...letters].filter((letter) => letter === "L").length;
  if (!letters) return make("small", {}, "no obstacles");
  return proportionBar("", [["L", left, data.colours.sides[0]], ["R", letters.length - left, data.colours.sides[1]]], letters.length);
}
