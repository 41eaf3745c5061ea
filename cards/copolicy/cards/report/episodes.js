/** The sortable table of the selected episodes. */

const TABLE_COLUMNS = offered([
  ["", ["episode_index", "#"]],
  ["", ["pair_id", "Pair"]],
  ["", ["source", "Source"]],
  ["", ["map_id", capital(WORDS.scenario)]],
  ["labels", ["route_class", capital(WORDS.label)]],
  ["", ["termination_reason", "Ended by"]],
  ["", ["duration_s", "Duration, s"]],
  ["interaction", ["force_mean", "Force, mean"]],
  ["interaction", ["force_p95", "Force, 95 %"]],
  ["drift", ["replay_drift_px", `Drift, ${OUTLINE?.unit}`]],
  ["", ["quality_flags", "Flags"]],
]);
const NUMBERS = new Set(["duration_s", "force_mean", "force_p95", "replay_drift_px"]);
const PAGE = 25;
const order = { name: "episode_index", descending: false };
let page = 0;

function showEpisodes(selected, keepPage = false) {
  if (!keepPage) page = 0;
  const rows = sorted(selected);
  const pages = Math.max(1, Math.ceil(rows.length / PAGE));
  page = Math.min(page, pages - 1);
  const first = page * PAGE;
  byId("episode-count").textContent = rows.length
    ? `Episodes ${first + 1} to ${Math.min(rows.length, first + PAGE)} of ${rows.length}. Click a heading to sort, a number to open an episode.`
    : "No episode matches the filters above.";
  byId("episode-table").replaceChildren(
    make("thead", {}, make("tr", {}, ...TABLE_COLUMNS.map(([name, label]) => heading(name, label)))),
    make("tbody", {}, ...rows.slice(first, first + PAGE).map(episodeRow)),
  );
  const turn = (by) => { page += by; showEpisodes(selection, true); };
  byId("pages").replaceChildren(
    make("button", { type: "button", disabled: page === 0, onclick: () => turn(-1) }, "Previous page"),
    make("span", {}, `Page ${page + 1} of ${pages}`),
    make("button", { type: "button", disabled: page >= pages - 1, onclick: () => turn(1) }, "Next page"),
  );
}

/** The selected episodes in the order of the table; missing values come last. */
function sorted(selected) {
  const sign = order.descending ? -1 : 1;
  return [...selected].sort((a, b) => {
    const [u, v] = [a[order.name], b[order.name]];
    if (u === null || v === null) return (u === null) - (v === null);
    const difference = typeof u === "number" ? u - v : String(u).localeCompare(String(v), "en", { numeric: true });
    return sign * difference || a.episode_index - b.episode_index;
  });
}

function heading(name, label) {
  const active = order.name === name;
  const sort = () => {
    order.descending = active && !order.descending;
    order.name = name;
    showEpisodes(selection);
    byId("episode-table").querySelector(`button[data-column="${name}"]`).focus();
  };
  const arrow = active ? (order.descending ? " ▼" : " ▲") : "";
  return make(
    "th", { scope: "col", class: NUMBERS.has(name) ? "number" : "", "aria-sort": active ? (order.descending ? "descending" : "ascending") : "none" },
    make("button", { type: "button", "data-column": name, onclick: sort }, label + arrow),
  );
}

function episodeRow(episode) {
  const open = make("button", { type: "button", class: "link", "aria-label": `Open ${episodeName(episode)}` }, String(episode.episode_index));
  const cells = TABLE_COLUMNS.slice(1).map(([name]) => {
    if (name === "quality_flags") return make("td", {}, flags(episode));
    if (name === "route_class") return make("td", {}, paintKey(episode.route_class || "–", labelColour(episode.route_class)));
    if (name === "termination_reason") {
      const reason = String(episode[name]).replaceAll("_", " ");
      return make("td", { class: episode.success ? "" : "failed" }, `${episode.success ? "✓" : "✗"} ${reason}`);
    }
    const value = episode[name];
    return make("td", { class: typeof value === "number" ? "number" : "" }, value === "" ? "–" : formatNumber(value));
  });
  return make("tr", { onclick: () => openPlayer(episode), "data-episode": episode.episode_index }, make("th", { scope: "row" }, open), ...cells);
}

function flags(episode) {
  return [episode.discarded ? "discarded" : "", episode.quality_flags ?? ""].filter(Boolean).join(", ") || "–";
}
