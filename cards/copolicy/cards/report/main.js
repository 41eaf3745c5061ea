/** Builds the page, and draws it again when episodes are chosen, colours change, or it gets another width. */

function show(chosen) {
  showOverview(chosen);
  showTrajectories(chosen);
  showHeatmaps(chosen);
  showPairs(chosen);
  showTiming(chosen);
  showFindings(chosen);
  showEpisodes(chosen);
}

function redraw() {
  show(selection);
  if (byId("player").open) drawFilm();
}

for (const section of document.querySelectorAll("main > section")) {
  byId("contents").append(make("li", {}, make("a", { href: `#${section.id}` }, section.querySelector("h2").textContent)));
}
showHeading();
showRouteStatistics();
showStatistics();
setUpTheme(redraw);
setUpTrajectories();
setUpHeatmaps();
setUpFilters(show);
setUpPlayer();

let lastWidth = window.innerWidth;
window.addEventListener("resize", () => {
  if (window.innerWidth === lastWidth) return;
  lastWidth = window.innerWidth;
  clearTimeout(redraw.timer);
  redraw.timer = setTimeout(redraw, 150);
});
