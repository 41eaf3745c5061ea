/** Paths of the episodes, one panel per set of obstacles or scenario. */

const FIRST_PANELS = 12;
let panelLimit = FIRST_PANELS;

function setUpTrajectories() {
  if (!OUTLINE) return byId("trajectory-figures").replaceChildren(missingNote("outline"));
  byId("grouping").addEventListener("input", () => {
    panelLimit = FIRST_PANELS;
    showTrajectories(selection);
  });
}

function showTrajectories(selected) {
  if (!OUTLINE) return;
  const key = byId("grouping").value === "map" ? (episode) => episode.map_id : (episode) => episode.layout;
  const groups = [...groupBy(selected, key)].sort(
    (a, b) => a[1][0].scene.obstacles - b[1][0].scene.obstacles || a[0].localeCompare(b[0], "en", { numeric: true }),
  );
  const panels = byId("panels");
  panels.replaceChildren();
  const shown = groups.slice(0, panelLimit).map(([name, members]) => {
    const panel = trajectoryPanel(name, members);
    panels.append(panel.figure);
    return panel;
  });
  shown.forEach((panel) => panel.draw(null));
  const more = groups.length - shown.length;
  byId("more-panels").replaceChildren(
    ...(more > 0
      ? [make("button", { type: "button", onclick: () => { panelLimit = Infinity; showTrajectories(selection); } }, `Show ${more} more`)]
      : []),
  );
}

function trajectoryPanel(name, members) {
  const byLabel = MISSING.labels ? [] : [...groupBy(members, (episode) => episode.route_class ?? "")];
  const counts = byLabel.sort((a, b) => b[1].length - a[1].length).map(([label, labelled]) => [label, `${label || `no ${WORDS.label}`} ${labelled.length}`]);
  const words = counts.length ? `; ${WORDS.label}s ${counts.map(([, text]) => text).join(", ")}` : "";
  const canvas = make("canvas", { role: "img", "aria-label": `${name}: ${members.length} episodes${words}` });
  const legend = make("p", { class: "legend" }, ...counts.map(([label, text]) => paintKey(text, labelColour(label))));
  const figure = make("figure", {}, make("figcaption", {}, make("strong", {}, name), ` · ${members.length} episodes`), canvas, legend);
  const paths = members.map((episode) => ({ episode, xs: column(episode, "x"), ys: column(episode, "y") }));

  const draw = (near) => {
    const context = sceneContext(canvas, canvas.clientWidth || 360);
    for (const role of ["goal", "start", "obstacle"]) drawFixed(context, members, role);
    for (const path of paths) {
      if (path !== near) drawPath(context, path, Math.max(0.25, Math.min(0.8, 12 / paths.length)), 2.5);
    }
    if (near) drawPath(context, near, 1, 7);
  };
  const nearest = (event) => {
    const box = canvas.getBoundingClientRect();
    const [x, y] = [event.clientX - box.left, event.clientY - box.top].map((value) => (value * WIDTH) / box.width);
    let [best, closest] = [(30 * UNIT) ** 2, null];
    for (const path of paths) {
      for (let k = 0; k < path.xs.length; k++) {
        const distance = (path.xs[k] - x) ** 2 + (path.ys[k] - y) ** 2;
        if (distance < best) [best, closest] = [distance, path];
      }
    }
    return closest;
  };
  let near = null;
  canvas.addEventListener("pointermove", (event) => {
    const path = nearest(event);
    if (path === near) return;
    near = path;
    canvas.style.cursor = near ? "pointer" : "";
    canvas.title = near ? episodeName(near.episode) : "";
    draw(near);
  });
  canvas.addEventListener("pointerleave", () => draw((near = null)));
  canvas.addEventListener("click", (event) => {
    const path = nearest(event);
    if (path) openPlayer(path.episode);
  });
  return { figure, draw };
}

function drawPath(context, { episode, xs, ys }, opacity, width) {
  context.globalAlpha = opacity;
  context.strokeStyle = labelColour(episode.route_class);
  context.lineWidth = width * UNIT;
  strokePath(context, xs, ys);
  context.globalAlpha = 1;
  if (episode.success) return;
  const [x, y] = [xs[xs.length - 1], ys[ys.length - 1]];
  context.strokeStyle = FAILURE_COLOUR;
  context.lineWidth = 4 * UNIT;
  for (const side of [-10 * UNIT, 10 * UNIT]) strokePath(context, [x - 10 * UNIT, x + 10 * UNIT], [y - side, y + side]);
}

/** Name of an episode in one line. */
function episodeName(episode) {
  const pair = episode.pair_id ? `, pair ${episode.pair_id}` : "";
  return `Episode ${episode.episode_index}${pair}, ${episode.map_id}, ${labelText(episode)}${episode.outcome}`;
}

/** `route LR, `; empty if the task has no labels. */
const labelText = (episode) => (MISSING.labels ? "" : `${WORDS.label} ${episode.route_class || "none"}, `);
