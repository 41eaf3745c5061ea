/** Draws the map and the table into a canvas whose context is scaled to the window's pixels. */

// A simple outline of the table in its own coordinates, px: u towards the robot's end, v down at theta = 0.
const BOARD = [-56.5, -29.5, 108, 59, 13]; // left, top, width, height, corner radius
const TRIANGLE = [[55.5, 17.5], [74.5, -16.5], [95.5, 17.5]]; // robot seat
const DISC = [-78, 0, 17.5]; // human seat
const GRIPS = [[75.5, 6], [-78, 0]]; // where the robot and the human seat hold
const ARROW = 95; // px of a full force

/** Goal, obstacles and start; lengths in px of the window. */
function drawMap(context, map) {
  drawGoal(context, map);
  drawObstacles(context, map);
  drawStart(context, map);
}

function drawGoal(context, map) {
  const side = data.goal_size;
  context.fillStyle = `${GOAL_COLOUR}44`;
  context.strokeStyle = GOAL_COLOUR;
  context.lineWidth = 3;
  context.fillRect(map.goal[0] - side / 2, map.goal[1] - side / 2, side, side);
  context.strokeRect(map.goal[0] - side / 2, map.goal[1] - side / 2, side, side);
}

function drawStart(context, map) {
  context.strokeStyle = colour("--muted");
  context.lineWidth = 3;
  context.beginPath();
  context.arc(map.start[0], map.start[1], 10, 0, 2 * Math.PI);
  context.stroke();
}

function drawObstacles(context, map) {
  context.fillStyle = colour("--obstacle");
  map.obstacles.forEach(([x, y], k) => {
    const side = map.sizes[k];
    context.fillRect(x - side / 2, y - side / 2, side, side);
  });
}

/** Position on screen of a point of the table; theta turns counter-clockwise on screen. */
function onScreen([x, y, theta], [u, v]) {
  const [c, s] = [Math.cos(theta), Math.sin(theta)];
  return [x + u * c + v * s, y - u * s + v * c];
}

/** The table at a pose (x, y, theta). */
function drawTable(context, pose) {
  context.save();
  context.translate(pose[0], pose[1]);
  context.rotate(-pose[2]);
  context.lineWidth = 3;
  context.fillStyle = "#b28458";
  context.strokeStyle = "#74502f";
  context.beginPath();
  context.roundRect(...BOARD);
  context.fill();
  context.stroke();
  context.strokeStyle = colour("--ink");
  context.fillStyle = SEAT_COLOURS[0];
  context.beginPath();
  TRIANGLE.forEach(([u, v], k) => (k ? context.lineTo(u, v) : context.moveTo(u, v)));
  context.closePath();
  context.fill();
  context.stroke();
  context.fillStyle = SEAT_COLOURS[1];
  context.beginPath();
  context.arc(...DISC, 0, 2 * Math.PI);
  context.fill();
  context.stroke();
  context.restore();
}

/** A player's force as an arrow from where that player holds the table. */
function drawForce(context, pose, seat, [fx, fy]) {
  const size = Math.hypot(fx, fy);
  if (size < 0.03) return;
  const [x, y] = onScreen(pose, GRIPS[seat]);
  const [tipX, tipY] = [x + fx * ARROW, y + fy * ARROW];
  const [u, v] = [fx / size, fy / size];
  const head = Math.min(20, 0.6 * ARROW * size);
  for (const [paint, grown] of [[colour("--panel"), 4], [SEAT_COLOURS[seat], 0]]) {
    context.strokeStyle = context.fillStyle = paint;
    context.lineWidth = 6 + grown;
    context.beginPath();
    context.moveTo(x, y);
    context.lineTo(tipX - u * head, tipY - v * head);
    context.stroke();
    context.lineWidth = grown;
    context.beginPath();
    context.moveTo(tipX, tipY);
    context.lineTo(tipX - u * head - v * head * 0.6, tipY - v * head + u * head * 0.6);
    context.lineTo(tipX - u * head + v * head * 0.6, tipY - v * head - u * head * 0.6);
    context.closePath();
    context.fill();
    if (grown) context.stroke();
  }
}

/** A line through points given as two columns, up to `end`. */
function strokePath(context, xs, ys, end = xs.length) {
  context.beginPath();
  for (let k = 0; k < end; k++) {
    if (k) context.lineTo(xs[k], ys[k]);
    else context.moveTo(xs[k], ys[k]);
  }
  context.stroke();
}
