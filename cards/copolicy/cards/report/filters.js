/** The filter bar: every section shows the selected episodes. */

const FILTERS = [
  ["source", "Source"],
  ["map_set", `${capital(WORDS.scenario)} set`],
  ["layout", "Obstacles"],
  ["pair_id", "Pair"],
  ["route_class", capital(WORDS.label)],
  ["outcome", "Result"],
];

let selection = episodes;

/** Builds the filter bar; calls `changed` with the selected episodes after each change. */
function setUpFilters(changed) {
  const form = byId("filters");
  const search = make("input", { type: "search", id: "filter-text", placeholder: `pair, ${WORDS.scenario}, uuid, flag …` });
  form.append(make("label", { class: "grow" }, "Find ", search));
  for (const [name, label] of FILTERS) {
    const values = distinct(name);
    if (values.length < 2) continue;
    const select = make("select", { id: `filter-${name}`, "data-column": name }, make("option", { value: "*" }, "all"));
    for (const value of values) select.append(make("option", { value }, value || "none"));
    form.append(make("label", {}, `${label} `, select));
  }
  const count = make("output", { id: "filter-count", "aria-live": "polite" });
  form.append(make("button", { type: "reset" }, "Show all"), count);

  const apply = () => {
    const active = [...form.querySelectorAll("select")].filter((select) => select.value !== "*");
    const words = search.value.toLowerCase().split(/\s+/).filter(Boolean);
    selection = episodes.filter(
      (episode) =>
        active.every((select) => String(episode[select.dataset.column] ?? "") === select.value) &&
        words.every((word) => searchText(episode).includes(word)),
    );
    count.textContent = `${selection.length} of ${episodes.length} episodes`;
    changed(selection);
  };
  form.addEventListener("input", apply);
  form.addEventListener("reset", () => setTimeout(apply));
  form.addEventListener("submit", (event) => event.preventDefault());
  apply();
}

function searchText(episode) {
  const texts = [
    `#${episode.episode_index}`, episode.episode_uuid, episode.pair_id, episode.player_0_id, episode.player_1_id,
    episode.session_id, episode.map_id, episode.termination_reason, episode.quality_flags,
    episode.discarded ? "discarded" : "",
  ];
  return texts.join(" ").toLowerCase();
}
