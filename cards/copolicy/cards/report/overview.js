/** Totals of the selected episodes: tiles, strategy labels by number of obstacles, and termination reasons. */

/** Title, subtitle, footer, and the sentences on who played. */
function showHeading() {
  byId("title").textContent = data.title;
  const rate = data.frame_step > 1 ? `, shown at ${formatNumber(data.fps / data.frame_step)} Hz` : "";
  byId("subtitle").textContent =
    `${WORDS.about}. LeRobot ${data.format}, ${formatNumber(data.fps)} Hz${rate}.`;
  for (const [source, members] of groupBy(episodes, (episode) => episode.source)) {
    const all = members.length === episodes.length ? "all" : `${members.length} of ${episodes.length}`;
    byId("sources").append(
      make("p", { class: `source source-${source}` }, make("strong", {}, `${source} (${all} episodes): `), data.sources[source]),
    );
  }
  byId("footer").textContent =
    `Written by ${data.software}. This file contains the whole page and loads nothing else.`;
}

function showOverview(selected) {
  const seconds = selected.reduce((sum, episode) => sum + (episode.duration_s ?? 0), 0);
  const successes = selected.filter((episode) => episode.success).length;
  const [low, high] = selected.length ? wilson(successes, selected.length) : [0, 0];
  const forces = ordered(selected.map((episode) => episode.force_mean));
  const tiles = offered([
    ["", ["Episodes", formatNumber(selected.length), `${formatNumber(sumOf(selected, "length"))} frames`]],
    ["", ["Recorded", `${(seconds / 60).toFixed(1)} min`, `median ${formatNumber(middle(selected, "duration_s"))} s per episode`]],
    ["", [capital(WORDS.success), selected.length ? percent(successes / selected.length) : "–", `95 %: ${percent(low)} to ${percent(high)}`]],
    ["", ["Pairs", formatNumber(new Set(selected.map((episode) => episode.pair_id)).size), `${new Set(selected.map((e) => e.map_id)).size} ${WORDS.scenarios}`]],
    ["interaction", [capital(WORDS.interaction), formatNumber(quantile(forces, 0.5)), "median of the episodes' mean magnitude"]],
    ["", ["Marked", formatNumber(selected.filter((e) => e.discarded || e.quality_flags).length), "discarded or with a quality flag"]],
  ]);
  byId("tiles").replaceChildren(
    ...tiles.map(([name, value, note]) =>
      make("div", { class: "tile" }, make("span", {}, name), make("strong", {}, value), make("small", {}, note)),
    ),
  );
  showLabels(selected);
  const endings = [...groupBy(selected, (episode) => episode.termination_reason)].sort((a, b) => b[1].length - a[1].length);
  byId("endings").replaceChildren(
    ...endings.map(([reason, members]) => {
      const paint = data.successes.includes(reason) ? GOAL_COLOUR : data.failures.includes(reason) ? FAILURE_COLOUR : colour("--muted");
      return proportionBar(reason.replaceAll("_", " "), [[reason, members.length, paint]], selected.length);
    }),
  );
}

/** Strategy labels: one bar per number of obstacles if labels have a letter per obstacle, else one bar. */
function showLabels(selected) {
  if (MISSING.labels) return byId("routes").replaceChildren(missingNote("labels"));
  const obstacles = (episode) => (data.sides ? (episode.route_class ?? "").length : "");
  const groups = [...groupBy(selected, obstacles)].sort((a, b) => a[0] - b[0]);
  byId("routes").replaceChildren(
    ...groups.map(([number, members]) => {
      const labels = [...groupBy(members, (episode) => episode.route_class ?? "")].sort((a, b) => a[0].localeCompare(b[0]));
      const parts = labels.map(([label, labelled]) => [label || "none", labelled.length, labelColour(label)]);
      return proportionBar(data.sides ? `${number} obstacle${number === 1 ? "" : "s"}` : "all", parts, members.length);
    }),
  );
}

/** A labelled bar of parts `[name, count, colour]` of `total`, with the numbers as text below. */
function proportionBar(label, parts, total) {
  const bar = make("div", { class: "bar", "aria-hidden": "true" });
  for (const [name, count, paint] of parts) {
    const part = make("span", { title: `${name}: ${count}` }, count / total > 0.07 && parts.length > 1 ? name : "");
    part.style.width = `${(100 * count) / total}%`;
    part.style.background = paint;
    bar.append(part);
  }
  const words = parts.map(([name, count]) => (parts.length > 1 ? `${name} ${count}` : `${count}`)).join(" · ");
  const proportion = parts.length > 1 ? "" : ` (${percent(parts[0][1] / total)})`;
  return make("div", { class: "proportion" }, make("span", { class: "proportion-label" }, label), bar, make("small", {}, words + proportion));
}

const sumOf = (list, name) => list.reduce((sum, episode) => sum + (episode[name] ?? 0), 0);
const middle = (list, name) => quantile(ordered(list.map((episode) => episode[name])), 0.5);
