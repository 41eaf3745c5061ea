/** Builds the page; redraws it when the selection of episodes, the colours or the width of the page change. */

function show(selected) {
  showOverview(selected);
  showTrajectories(selected);
  showHeatmaps(selected);
  showPairs(selected);
  showTiming(selected);
  showFindings(selected);
  showEpisodes(selected);
}

function redraw() {
  show(selection);
  if (byId("player").open) drawPlayback();
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
