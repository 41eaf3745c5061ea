/** Sums of the chosen episodes: tiles, routes by set of obstacles, and how episodes ended. */

const SOURCES = {
  human: "People played these episodes, two at a time, with one controller each.",
  simulated:
    "Simulated pairs: no person took part. Two scripted pilots, one at each end of the table, stand in for people. " +
    "No figure on this page that includes them is a result about people.",
  upstream:
    "Imported from files of the original program of Ng, Liu and Kennedy (RA-L 2023), which do not say who or what " +
    "held the sticks.",
};

/** The heading and, before anything else, who played. */
function showHeading() {
  byId("title").textContent = data.title;
  const rate = data.frame_step > 1 ? `, shown at ${formatNumber(data.fps / data.frame_step)} Hz` : "";
  byId("subtitle").textContent =
    `Two players carry a table past obstacles to a goal. LeRobot ${data.format}, ${formatNumber(data.fps)} Hz${rate}.`;
  for (const [source, members] of groupBy(episodes, (episode) => episode.source)) {
    const all = members.length === episodes.length ? "all" : `${members.length} of ${episodes.length}`;
    const text = SOURCES[source] ?? `Source: ${source}.`;
    byId("sources").append(
      make("p", { class: `source source-${source}` }, make("strong", {}, `${source} (${all} episodes): `), text),
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
  const tiles = [
    ["Episodes", formatNumber(chosen.length), `${formatNumber(sumOf(chosen, "length"))} frames`],
    ["Recorded", `${(seconds / 60).toFixed(1)} min`, `median ${formatNumber(middle(chosen, "duration_s"))} s an episode`],
    ["Reached the goal", chosen.length ? percent(successes / chosen.length) : "–", `95 %: ${percent(low)} to ${percent(high)}`],
    ["Pairs", formatNumber(new Set(chosen.map((episode) => episode.pair_id)).size), `${new Set(chosen.map((e) => e.map_id)).size} maps`],
    ["Interaction force", formatNumber(quantile(forces, 0.5)), "median of the episodes' mean size"],
    ["Marked", formatNumber(chosen.filter((e) => e.discarded || e.quality_flags).length), "discarded or with a quality flag"],
  ];
  byId("tiles").replaceChildren(
    ...tiles.map(([name, value, note]) =>
      make("div", { class: "tile" }, make("span", {}, name), make("strong", {}, value), make("small", {}, note)),
    ),
  );
  showRoutes(chosen);
  const endings = [...groupBy(chosen, (episode) => episode.termination_reason)].sort((a, b) => b[1].length - a[1].length);
  byId("endings").replaceChildren(
    ...endings.map(([reason, members]) => {
      const paint = reason === "goal" ? GOAL_COLOUR : reason.startsWith("collision") ? FAILURE_COLOUR : colour("--muted");
      return shareBar(reason.replaceAll("_", " "), [[reason, members.length, paint]], chosen.length);
    }),
  );
}

/** One bar for each number of obstacles: routes are only comparable where there are as many obstacles. */
function showRoutes(chosen) {
  const groups = [...groupBy(chosen, (episode) => (episode.route_class ?? "").length)].sort((a, b) => a[0] - b[0]);
  byId("routes").replaceChildren(
    ...groups.map(([obstacles, members]) => {
      const routes = [...groupBy(members, (episode) => episode.route_class ?? "")].sort((a, b) => a[0].localeCompare(b[0]));
      const parts = routes.map(([word, some]) => [word || "none", some.length, routeColour(word)]);
      return shareBar(`${obstacles} obstacle${obstacles === 1 ? "" : "s"}`, parts, members.length);
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
