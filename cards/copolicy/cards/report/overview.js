/** Sums of the chosen episodes: tiles, routes by set of obstacles, and how episodes ended. */

/** The heading and, before anything else, who played. */
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
    `Written by ${data.software}. Everything on this page is inside this file; it loads nothing.`;
}

function showOverview(chosen) {
  const seconds = chosen.reduce((sum, episode) => sum + (episode.duration_s ?? 0), 0);
  const successes = chosen.filter((episode) => episode.success).length;
  const [low, high] = chosen.length ? wilson(successes, chosen.length) : [0, 0];
  const forces = ordered(chosen.map((episode) => episode.force_mean));
  const tiles = offered([
    ["", ["Episodes", formatNumber(chosen.length), `${formatNumber(sumOf(chosen, "length"))} frames`]],
    ["", ["Recorded", `${(seconds / 60).toFixed(1)} min`, `median ${formatNumber(middle(chosen, "duration_s"))} s an episode`]],
    ["", [capital(WORDS.success), chosen.length ? percent(successes / chosen.length) : "–", `95 %: ${percent(low)} to ${percent(high)}`]],
    ["", ["Pairs", formatNumber(new Set(chosen.map((episode) => episode.pair_id)).size), `${new Set(chosen.map((e) => e.map_id)).size} ${WORDS.scenarios}`]],
    ["interaction", [capital(WORDS.interaction), formatNumber(quantile(forces, 0.5)), "median of the episodes' mean size"]],
    ["", ["Marked", formatNumber(chosen.filter((e) => e.discarded || e.quality_flags).length), "discarded or with a quality flag"]],
  ]);
  byId("tiles").replaceChildren(
    ...tiles.map(([name, value, note]) =>
      make("div", { class: "tile" }, make("span", {}, name), make("strong", {}, value), make("small", {}, note)),
    ),
  );
  showLabels(chosen);
  const endings = [...groupBy(chosen, (episode) => episode.termination_reason)].sort((a, b) => b[1].length - a[1].length);
  byId("endings").replaceChildren(
    ...endings.map(([reason, members]) => {
      const paint = data.successes.includes(reason) ? GOAL_COLOUR : data.failures.includes(reason) ? FAILURE_COLOUR : colour("--muted");
      return shareBar(reason.replaceAll("_", " "), [[reason, members.length, paint]], chosen.length);
    }),
  );
}

/** One bar for each number of obstacles, where labels have a letter for each: only those can be compared. */
function showLabels(chosen) {
  if (MISSING.labels) return byId("routes").replaceChildren(absent("labels"));
  const obstacles = (episode) => (data.sides ? (episode.route_class ?? "").length : "");
  const groups = [...groupBy(chosen, obstacles)].sort((a, b) => a[0] - b[0]);
  byId("routes").replaceChildren(
    ...groups.map(([number, members]) => {
      const labels = [...groupBy(members, (episode) => episode.route_class ?? "")].sort((a, b) => a[0].localeCompare(b[0]));
      const parts = labels.map(([label, some]) => [label || "none", some.length, labelColour(label)]);
      return shareBar(data.sides ? `${number} obstacle${number === 1 ? "" : "s"}` : "all", parts, members.length);
    }),
  );
}

/** A labelled bar of parts `[name, count, colour]` out of `total`, with its numbers in words beneath. */
function shareBar(label, parts, total) {
  const bar = make("div", { class: "bar", "aria-hidden": "true" });
  for (const [name, count, paint] of parts) {
    const part = make("span", { title: `${name}: ${count}` }, count / total > 0.07 && parts.length > 1 ? name : "");
    part.style.width = `${(100 * count) / total}%`;
    part.style.background = paint;
    bar.append(part);
  }
  const words = parts.map(([name, count]) => (parts.length > 1 ? `${name} ${count}` : `${count}`)).join(" · ");
  const share = parts.length > 1 ? "" : ` (${percent(parts[0][1] / total)})`;
  return make("div", { class: "share" }, make("span", { class: "share-label" }, label), bar, make("small", {}, words + share));
}

const sumOf = (list, name) => list.reduce((sum, episode) => sum + (episode[name] ?? 0), 0);
const middle = (list, name) => quantile(ordered(list.map((episode) => episode[name])), 0.5);
