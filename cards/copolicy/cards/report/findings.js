/** The findings of `copolicy-dataset check`. */

const SEVERITIES = ["error", "warning", "info"];
const STATES = { stale: "These findings are stale.", unknown: "These findings may be stale." };

function showFindings(selected) {
  const container = byId("finding-list");
  if (!data.check) {
    container.replaceChildren(
      make("p", { class: "missing" }, "There are no stored findings of copolicy-dataset check for this data set, so its quality is unknown. " +
        "To check it and store the findings: copolicy-dataset check FOLDER"),
    );
    return;
  }
  const all = data.check.findings ?? [];
  const numbers = new Map(selected.map((episode) => [String(episode.episode_index), episode]));
  const shown = all.filter((finding) => finding.episode === "" || finding.episode === null || numbers.has(String(finding.episode)));
  const count = (severity) => shown.filter((finding) => finding.severity === severity).length;
  const summary = SEVERITIES.map((severity) => `${count(severity)} ${severity}${severity === "info" || count(severity) === 1 ? "" : "s"}`);
  const rules = data.check.rules ? `${formatNumber(data.check.rules)} rules were applied: ` : "";
  const nodes = data.check.state === "current" ? [] : [make("p", { class: "stale", role: "note" }, make("strong", {}, `${STATES[data.check.state]} `), data.check.reason)];
  if (data.check.date) {
    nodes.push(make("p", {}, `Checked on ${data.check.date.slice(0, 10)} by version ${data.check.rules_version} of the rules.`));
  }
  nodes.push(make("p", {}, `${rules}${summary.join(", ")}.${shown.length < all.length ? ` ${all.length - shown.length} more are about other episodes.` : ""}`));
  const groups = [...groupBy(shown, (finding) => `${finding.severity}|${finding.rule}`).values()].sort(
    (a, b) => SEVERITIES.indexOf(a[0].severity) - SEVERITIES.indexOf(b[0].severity) || b.length - a.length,
  );
  for (const members of groups) {
    const { severity, rule } = members[0];
    nodes.push(
      make("details", { open: severity === "error" },
        make("summary", {}, make("span", { class: `badge ${severity}` }, severity), ` ${String(rule).replaceAll("_", " ")} · ${members.length}`),
        make("ul", {}, ...members.slice(0, 200).map((finding) => findingItem(finding, numbers))),
        members.length > 200 ? make("p", {}, `and ${members.length - 200} more in meta/copolicy_check.json`) : null),
    );
  }
  container.replaceChildren(...nodes);
}

function findingItem(finding, numbers) {
  const episode = numbers.get(String(finding.episode));
  const figure = finding.figure === null || finding.figure === undefined ? "" : ` (${formatNumber(finding.figure)}; limit ${formatNumber(finding.limit)})`;
  const link = episode
    ? make("button", { type: "button", class: "link", onclick: () => openPlayer(episode) }, `Episode ${episode.episode_index}`)
    : "Whole data set";
  return make("li", {}, link, `: ${finding.message ?? ""}${figure}`);
}
