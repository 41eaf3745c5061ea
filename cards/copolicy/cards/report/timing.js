/** Timing of the recording, and distance of the re-simulation from the recorded path. */

const TIMING = offered([
  ["", ["achieved_hz", "Achieved rate", "Hz"]],
  ["", ["late_ticks", "Late ticks", "per episode"]],
  ["drift", ["replay_drift_px", "Re-simulation drift", OUTLINE?.unit]],
]);

function showTiming(selected) {
  const rates = ordered(selected.map((episode) => episode.achieved_hz));
  const late = sumOf(selected, "late_ticks");
  const lateIn = selected.filter((episode) => episode.late_ticks > 0).length;
  const drifts = ordered(selected.map((episode) => episode.replay_drift_px));
  const sentences = [
    rates.length
      ? `Recorded at ${formatNumber(rates[0], 4)} to ${formatNumber(rates[rates.length - 1], 4)} Hz of ${data.record_hz} Hz.`
      : "No rate was recorded.",
    `${formatNumber(late)} late ticks in ${lateIn} of ${selected.length} episodes.`,
    drifts.length
      ? `Recorded and re-simulated positions are at most ${formatNumber(drifts[drifts.length - 1])} ${OUTLINE?.unit} apart.`
      : MISSING.drift ?? "Re-simulation drift is unknown.",
  ];
  if (selected.some((episode) => episode.source === "simulated")) {
    sentences.push("Simulated pairs are not recorded in real time: their rate is exact.");
  }
  byId("timing-text").textContent = sentences.join(" ");
  byId("timing-plots").replaceChildren(...TIMING.map(([name, label, unit]) => histogram(selected, name, label, unit)));
}

const BINS = 24;

/** Histogram of one episode column. */
function histogram(selected, name, label, unit) {
  const values = ordered(selected.map((episode) => episode[name]));
  const caption = make("figcaption", {}, make("strong", {}, label), `, ${unit}`);
  if (!values.length) return make("figure", {}, caption, make("p", {}, "Unknown for all of these episodes."));
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
