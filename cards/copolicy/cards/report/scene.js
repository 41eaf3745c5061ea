/** Draws a scene on a canvas, in the unit of the scene. */

/** Clears a canvas to an empty floor; returns its context, scaled to the unit of the scene. */
function sceneContext(canvas, width) {
  const context = sharpContext(canvas, width, (width * HEIGHT) / WIDTH);
  context.scale(width / WIDTH, width / WIDTH);
  context.fillStyle = colour("--floor");
  context.fillRect(0, 0, WIDTH, HEIGHT);
  context.lineJoin = "round";
  return context;
}

function tracePolygon(context, corners) {
  context.beginPath();
  corners.forEach(([x, y], k) => (k ? context.lineTo(x, y) : context.moveTo(x, y)));
  context.closePath();
}

/** Fill and line colour of a fixed shape, by its role. */
const FIXED = {
  goal: () => [`${GOAL_COLOUR}44`, GOAL_COLOUR],
  start: () => [null, colour("--muted")],
  obstacle: () => [colour("--obstacle"), null],
};

/** Draws the fixed shapes of episodes with a role, each once; `paints` are the colours of fill and line. */
function drawFixed(context, members, role, paints = FIXED[role]()) {
  const [area, line] = paints;
  context.lineWidth = 3 * UNIT;
  const drawn = new Set();
  for (const scene of new Set(members.map((episode) => episode.scene))) {
    for (const { corners } of scene.shapes.filter((shape) => shape.role === role)) {
      if (drawn.has(String(corners))) continue;
      drawn.add(String(corners));
      tracePolygon(context, corners);
      if (area) { context.fillStyle = area; context.fill(); }
      if (line) { context.strokeStyle = line; context.stroke(); }
    }
  }
}

/** Position in the scene of a point of the body; positive theta is counter-clockwise on screen. */
function onScreen([x, y, theta], [u, v]) {
  const [c, s] = [Math.cos(theta), Math.sin(theta)];
  return [x + u * c + v * s, y - u * s + v * c];
}

/** Draws the body at a pose (x, y, theta). */
function drawBody(context, pose) {
  const paints = { body: ["#b28458", "#74502f"], robot: [SEAT_COLOURS[0], colour("--ink")], human: [SEAT_COLOURS[1], colour("--ink")] };
  context.lineWidth = 3 * UNIT;
  for (const { role, corners } of OUTLINE.body) {
    [context.fillStyle, context.strokeStyle] = paints[role];
    tracePolygon(context, corners.map((corner) => onScreen(pose, corner)));
    context.fill();
    context.stroke();
  }
}

/** Draws a player's force as an arrow from that player's grip on the body. */
function drawForce(context, pose, seat, [fx, fy]) {
  const size = Math.hypot(fx, fy);
  if (size < 0.03) return;
  const [x, y] = onScreen(pose, OUTLINE.hands[seat]);
  const [tipX, tipY] = [x + fx * OUTLINE.arrow, y + fy * OUTLINE.arrow];
  const head = Math.min(20 * UNIT, 0.6 * OUTLINE.arrow * size);
  const [u, v] = [(fx / size) * head, (fy / size) * head];
  for (const [paint, grown] of [[colour("--panel"), 4 * UNIT], [SEAT_COLOURS[seat], 0]]) {
    context.strokeStyle = context.fillStyle = paint;
    context.lineWidth = 6 * UNIT + grown;
    strokePath(context, [x, tipX - u], [y, tipY - v]);
    context.lineWidth = grown;
    tracePolygon(context, [[tipX, tipY], [tipX - u - v * 0.6, tipY - v + u * 0.6], [tipX - u + v * 0.6, tipY - v - u * 0.6]]);
    context.fill();
    if (grown) context.stroke();
  }
}

/** Draws a line through points given as two columns, up to `end`. */
function strokePath(context, xs, ys, end = xs.length) {
  context.beginPath();
  for (let k = 0; k < end; k++) {
    if (k) context.lineTo(xs[k], ys[k]);
    else context.moveTo(xs[k], ys[k]);
  }
  context.stroke();
}
