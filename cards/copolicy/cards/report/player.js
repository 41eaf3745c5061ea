/** Plays one episode: the scene, both players' forces, and the interaction measure over time. */

const playback = { episode: null, columns: {}, time: 0, playing: false, clock: 0, ghosts: [] };

const SEAT_MARKS = ["robot", "human"].map((seat, k) => (OUTLINE?.body.some(({ role }) => role === seat) ? ["▲ ", "● "][k] : ""));

function setUpPlayer() {
  const dialog = byId("player");
  byId("player-close").addEventListener("click", () => dialog.close());
  dialog.addEventListener("close", () => {
    pause();
    history.replaceState(null, "", location.pathname + location.search);
  });
  byId("play").addEventListener("click", () => (playback.playing ? pause() : play()));
  byId("previous").addEventListener("click", () => stepEpisode(-1));
  byId("next").addEventListener("click", () => stepEpisode(1));
  byId("scrub").addEventListener("input", (event) => { pause(); seek(Number(event.target.value)); });
  byId("ghosts").addEventListener("input", drawPlayback);
  byId("graph").addEventListener("pointerdown", (event) => { pause(); seekGraph(event); });
  byId("graph").addEventListener("pointermove", (event) => { if (event.buttons) seekGraph(event); });
  dialog.addEventListener("keydown", onKey);
  const match = /^#episode=(\d+)$/.exec(location.hash);
  const episode = match && episodes.find((candidate) => candidate.episode_index === Number(match[1]));
  if (episode) openPlayer(episode);
}

/** Opens an episode at its start, in a dialog over the page. */
function openPlayer(episode) {
  if (!OUTLINE) return;
  pause();
  playback.episode = episode;
  playback.time = 0;
  for (const name of COLUMNS) playback.columns[name] = column(episode, name);
  playback.ghosts = episodes
    .filter((other) => other !== episode && other.map_id === episode.map_id)
    .map((other) => ({ episode: other, xs: column(other, "x"), ys: column(other, "y") }));
  byId("player-title").textContent = `Episode ${episode.episode_index}`;
  const controllers = [episode.controller_0, episode.controller_1].filter(Boolean).join(" and ");
  const facts = [
    episode.source === "simulated" ? "simulated pair" : episode.source,
    episode.pair_id && `pair ${episode.pair_id}`, episode.map_id, labelText(episode).slice(0, -2),
    String(episode.termination_reason).replaceAll("_", " "), `${formatNumber(episode.duration_s)} s`, controllers, flags(episode) !== "–" && flags(episode),
  ];
  byId("player-facts").textContent = facts.filter(Boolean).join(" · ");
  byId("scrub").max = episode.frames - 1;
  const dialog = byId("player");
  if (!dialog.open) dialog.showModal();
  history.replaceState(null, "", `#episode=${episode.episode_index}`);
  byId("play").focus();
  drawPlayback();
}

function stepEpisode(by) {
  const rows = sorted(selection.includes(playback.episode) ? selection : episodes);
  openPlayer(rows[(rows.indexOf(playback.episode) + by + rows.length) % rows.length]);
}

function play() {
  if (playback.time >= playback.episode.frames - 1) playback.time = 0;
  playback.playing = true;
  playback.clock = performance.now();
  showPlayButton();
  requestAnimationFrame(tick);
}

function pause() {
  playback.playing = false;
  showPlayButton();
}

function showPlayButton() {
  byId("play").textContent = playback.playing ? "⏸" : "▶";
  byId("play").setAttribute("aria-label", playback.playing ? "Pause" : "Play");
}

function tick(now) {
  if (!playback.playing) return;
  const speed = Number(byId("speed").value);
  playback.time = Math.min(playback.episode.frames - 1, playback.time + (Math.max(0, now - playback.clock) / 1000) * speed / FRAME_SECONDS);
  playback.clock = now;
  drawPlayback();
  if (playback.time >= playback.episode.frames - 1) pause();
  else requestAnimationFrame(tick);
}

function seek(frame) {
  playback.time = Math.min(Math.max(0, frame), playback.episode.frames - 1);
  drawPlayback();
}

function seekGraph(event) {
  const box = byId("graph").getBoundingClientRect();
  seek(Math.round(((event.clientX - box.left) / box.width) * (playback.episode.frames - 1)));
}

function onKey(event) {
  const inField = event.target.matches("select, input[type=checkbox]");
  const step = event.shiftKey ? Math.round(1 / FRAME_SECONDS) : 1;
  const actions = {
    ArrowRight: () => seek(Math.round(playback.time) + step),
    ArrowLeft: () => seek(Math.round(playback.time) - step),
    Home: () => seek(0),
    End: () => seek(playback.episode.frames - 1),
    " ": () => (playback.playing ? pause() : play()),
    n: () => stepEpisode(1),
    p: () => stepEpisode(-1),
  };
  const action = actions[event.key];
  // The space bar activates a focused button, except the play button, which it toggles anyway.
  if (!action || inField || (event.key === " " && event.target.matches("button:not(#play)"))) return;
  event.preventDefault();
  if (event.key !== " ") pause();
  action();
}

/** Interpolates a column between frames; angles along the shorter arc. */
function at(name, time) {
  const values = playback.columns[name];
  const low = Math.floor(time);
  const high = Math.min(low + 1, values.length - 1);
  let difference = values[high] - values[low];
  if (name === "theta") difference = ((difference + 3 * Math.PI) % (2 * Math.PI)) - Math.PI;
  return values[low] + (time - low) * difference;
}

function drawPlayback() {
  const { episode, time } = playback;
  if (!episode) return;
  const canvas = byId("stage");
  const context = sceneContext(canvas, canvas.clientWidth);
  for (const role of ["goal", "obstacle", "start"]) drawFixed(context, [episode], role);
  if (byId("ghosts").checked) for (const path of playback.ghosts) drawPath(context, path, 0.3, 2.5);
  const { x: xs, y: ys, theta } = playback.columns;
  const end = Math.floor(time) + 1;
  OUTLINE.hands.forEach((grip, seat) => {
    const points = Array.from({ length: end }, (_, k) => onScreen([xs[k], ys[k], theta[k]], grip));
    context.strokeStyle = `${SEAT_COLOURS[seat]}88`;
    context.lineWidth = 4 * UNIT;
    strokePath(context, points.map(([u]) => u), points.map(([, v]) => v));
  });
  const pose = ["x", "y", "theta"].map((name) => at(name, time));
  const frame = Math.floor(time); // an action applies until the next frame
  const force = (seat) => ["fx", "fy"].map((axis) => playback.columns[`${seat}_${axis}`][frame]);
  drawBody(context, pose);
  drawForce(context, pose, 0, force("robot"));
  drawForce(context, pose, 1, force("human"));
  drawGraph();
  const size = (seat) => Math.hypot(...force(seat)).toFixed(2);
  const seconds = (time * FRAME_SECONDS).toFixed(1);
  const total = ((episode.frames - 1) * FRAME_SECONDS).toFixed(1);
  byId("player-readout").textContent =
    `${seconds} of ${total} s · robot seat ${SEAT_MARKS[0]}${size("robot")} · human seat ${SEAT_MARKS[1]}${size("human")}${interactionText(frame)}`;
  byId("scrub").value = Math.round(time);
  byId("scrub").setAttribute("aria-valuetext", `${seconds} of ${total} seconds`);
}

/** ` · interaction 0.12 (pulling apart)`; empty if the task has no interaction measure. */
function interactionText(frame) {
  if (MISSING.interaction) return "";
  const value = playback.columns.interaction[frame];
  const [apart, together, agreed] = WORDS.interaction_senses;
  return ` · interaction ${value.toFixed(2)} (${value > 0.02 ? apart : value < -0.02 ? together : agreed})`;
}

/** Interaction measure (signed, upper half) and magnitudes of both forces (lower half) over time. */
function drawGraph() {
  const canvas = byId("graph");
  const [width, height] = [canvas.clientWidth, 150];
  const context = sharpContext(canvas, width, height);
  const xAt = (k) => (k / Math.max(1, playback.episode.frames - 1)) * width;
  context.fillStyle = colour("--floor");
  context.fillRect(0, 0, width, height);
  const xs = Array.from({ length: playback.episode.frames }, (_, k) => xAt(k));
  context.font = "12px system-ui, sans-serif";
  if (!MISSING.interaction) drawInteraction(context, xs, width);
  context.strokeStyle = colour("--line");
  context.lineWidth = 1;
  strokePath(context, [0, width], [height - 1, height - 1]);
  ["robot", "human"].forEach((seat, k) => {
    const [fx, fy] = [playback.columns[`${seat}_fx`], playback.columns[`${seat}_fy`]];
    context.strokeStyle = SEAT_COLOURS[k];
    context.lineWidth = 2;
    context.setLineDash(k ? [6, 3] : []);
    strokePath(context, xs, Array.from(fx, (value, i) => height - 3 - (Math.hypot(value, fy[i]) / Math.SQRT2) * 52));
  });
  context.setLineDash([]);
  context.fillStyle = colour("--muted");
  context.fillText("magnitude of force: robot seat (line), human seat (dashes)", 6, 103);
  context.strokeStyle = colour("--ink");
  context.lineWidth = 1.5;
  strokePath(context, [xAt(playback.time), xAt(playback.time)], [0, height]);
}

function drawInteraction(context, xs, width) {
  const { interaction } = playback.columns;
  const strongest = Math.max(0.25, ...interaction.map(Math.abs));
  const centre = 45;
  const ys = Array.from(interaction, (value) => centre - (value / strongest) * 38);
  context.strokeStyle = colour("--line");
  context.lineWidth = 1;
  strokePath(context, [0, width], [centre, centre]);
  context.fillStyle = `${colour("--accent")}55`;
  tracePolygon(context, [[0, centre], ...xs.map((x, k) => [x, ys[k]]), [width, centre]]);
  context.fill();
  context.strokeStyle = colour("--accent");
  context.lineWidth = 1.5;
  strokePath(context, xs, ys);
  context.fillStyle = colour("--muted");
  context.fillText(`${WORDS.interaction}, ±${strongest.toFixed(2)}: above ${WORDS.interaction_above}`, 6, 13);
}
