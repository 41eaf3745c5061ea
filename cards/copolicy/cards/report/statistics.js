/** The output of `copolicy-dataset stats`: each statistic with its interval and null distribution. */

function showStatistics() {
  const container = byId("statistic-list");
  if (!data.statistics) {
    container.replaceChildren(
      make("p", { class: "missing" }, "copolicy-dataset stats was not run on this data set: no multimodality statistics."),
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
  const heads = ["Statistic", "Value", "Unit", "95 % interval", "Null distribution", "Episodes", "Note"];
  container.replaceChildren(
    ...staleStatisticsNote(),
    make("p", {}, `${entries.length} statistics of all episodes of the data set; the filters above do not apply.`),
    scrolling("Statistics", "scroll", {}, heads, rows),
  );
}

/** A note if the stored statistics do not describe the data set, as a list of at most one paragraph. */
function staleStatisticsNote() {
  if (!data.statistics_doubt) return [];
  return [make("p", { class: "stale", role: "note" }, make("strong", {}, "These statistics are stale. "), data.statistics_doubt)];
}
