/** How well the recording kept its clock, and how well a re-simulation follows the recorded path. */

const TIMING = offered([
  ["", ["achieved_hz", "Achieved rate", "Hz"]],
  ["", ["late_ticks", "Late ticks", "an episode"]],
  ["drift", ["replay_drift_px", "Re-simulation drift", OUTLINE?.unit]],
]);

function showTiming(chosen) {
  const rates = ordered(chosen.map((episode) => episode.achieved_hz));
  const late = sumOf(chosen, "late_ticks");
  const lateIn = chosen.filter((episode) => episode.late_ticks > 0).length;
  const drifts = ordered(chosen.map((episode) => episode.replay_drift_px));
  const sentences = [
    rates.length
      ? `Recorded at ${formatNumber(rates[0], 4)} to ${formatNumber(rates[rates.length - 1], 4)} Hz of ${data.record_hz} Hz.`
      : "No rate was recorded.",
    `${formatNumber(late)} late ticks in ${lateIn} of ${chosen.length} episodes.`,
    drifts.length
      ? `Recorded and re-simulated positions are at most ${formatNumber(drifts[drifts.length - 1])} ${OUTLINE?.unit} apart.`
      : MISSING.drift ?? "Re-simulation drift is not known.",
  ];
  if (chosen.some((episode) => episode.source === "simulated")) {
    sentences.push("Simulated pairs have no clock that could be late: their rate is exact by construction.");
  }
  byId("timing-text").textContent = sentences.join(" ");
  byId("timing-plots").replaceChildren(...TIMING.map(([name, label, unit]) => histogram(chosen, name, label, unit)));
}

const BINS = 24;

/** Counts of one episode column. */
function histogram(chosen, name, label, unit) {
  const values = ordered(chosen.map((episode) => episode[name]));
  const caption = make("figcaption", {}, make("strong", {}, label), `, ${unit}`);
  if (!values.length) return make("figure", {}, caption, make("p", {}, "Not known for any of these episodes."));
  const [low, high] = [values[0], values[values.length - 1]];
  if (high - low < 1e-6) {
    const text = high === low ? formatNumber(low, 4) : `At most ${formatNumber(high)}`;
    return make("figure", {}, caption, make("p", {}, `${text} in all ${values.length} episodes.`));
  }
  const counts = new Array(BINS).fill(0);
  for (const value of values) counts[Math.min(BINS - 1, Math.floor(((value - low) / (high - low)) * BINS))] += 1;
  const most = Math.max(...counts);
  const bars = counts.map((count, k) =>
    makeSvg("rect", { x: 10 * k + 0.5, width: 9, y: 80 - (76 * count) / most, height: (76 * count) / most, class: "dot" }),
  );
  const label95 = `95 % up to ${formatNumber(quantile(values, 0.95), 4)}`;
  return make(
    "figure", {}, caption,
    makeSvg("svg", { viewBox: `0 0 ${10 * BINS} 82`, class: "histogram", role: "img",
      "aria-label": `${label}: ${formatNumber(low, 4)} to ${formatNumber(high, 4)} ${unit}, ${label95}` }, ...bars,
      makeSvg("line", { x1: 0, x2: 10 * BINS, y1: 80.5, y2: 80.5, class: "axis" })),
    make("div", { class: "scale spread" }, make("span", {}, formatNumber(low, 4)), make("span", {}, label95), make("span", {}, formatNumber(high, 4))),
  );
}
