/** What `copolicy-dataset stats` computed, each statistic with its interval and what chance alone would give. */

function showStatistics() {
  const place = byId("statistic-list");
  if (!data.statistics) {
    place.replaceChildren(
      make("p", { class: "absent" }, "copolicy-dataset stats was not run on this data set: no multimodality statistics."),
    );
    return;
  }
  const entries = data.statistics;
  const rows = entries.map((entry) =>
    make(
      "tr", {},
      make("th", { scope: "row" }, entry.name, entry.definition
        ? make("details", { class: "definition" }, make("summary", {}, "definition"), entry.definition)
        : null),
      make("td", { class: "number" }, formatNumber(entry.value)),
      make("td", {}, entry.unit ?? ""),
      make("td", {}, entry.interval ? `${formatNumber(entry.interval[0])} to ${formatNumber(entry.interval[1])}` : "–"),
      make("td", {}, entry.null ? `${formatNumber(entry.null.mean)} (${formatNumber(entry.null.low)} to ${formatNumber(entry.null.high)}), p = ${formatNumber(entry.null.p)}` : "–"),
      make("td", { class: "number" }, formatNumber(entry.episodes)),
      make("td", {}, entry.note ?? ""),
    ),
  );
  const heads = ["Statistic", "Value", "Unit", "95 % interval", "By chance", "Episodes", "Note"];
  place.replaceChildren(
    ...statisticsDoubt(),
    make("p", {}, `All episodes of the data set, whatever is chosen above. ${entries.length} statistics.`),
    scrolling("Statistics", "scroll", {}, heads, rows),
  );
}

/** Why the stored statistics may be those of other data, as a list of at most one paragraph. */
function statisticsDoubt() {
  if (!data.statistics_doubt) return [];
  return [make("p", { class: "doubt", role: "note" }, make("strong", {}, "These statistics are stale. "), data.statistics_doubt)];
}
