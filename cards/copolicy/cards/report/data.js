/** The data of the page: episodes, their frames, and which of them are chosen. */

const data = JSON.parse(byId("data").textContent);
const COLUMNS = Object.keys(data.scales);
const WIDTH = data.window[0];
const HEIGHT = data.window[1];
const FRAME_SECONDS = data.frame_step / data.fps;

const frameValues = decodeFrames(data.frames);
const sides = new Set(data.episodes.flatMap((row) => row.map.sizes));
const episodes = data.episodes.map((row) => ({
  ...row,
  layout: layoutName(row.map),
  outcome: row.success ? "reached the goal" : "did not",
}));

/** Little-endian 16-bit integers from base64. */
function decodeFrames(text) {
  const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  const view = new DataView(bytes.buffer);
  return Int16Array.from({ length: bytes.length / 2 }, (_, k) => view.getInt16(2 * k, true));
}

/** One column of an episode's frames, in units. */
function column(episode, name) {
  const offset = COLUMNS.indexOf(name);
  const values = new Float32Array(episode.frames);
  for (let k = 0; k < episode.frames; k++) {
    values[k] = frameValues[(episode.from + k) * COLUMNS.length + offset] / data.scales[name];
  }
  return values;
}

function layoutName({ obstacles, sizes }) {
  if (!obstacles.length) return "no obstacle";
  const places = obstacles.map(([x, y]) => `(${x.toFixed(0)}, ${y.toFixed(0)})`).join(" ");
  const own = [...new Set(sizes)].length > 1 ? sizes : sizes.slice(0, 1);
  const wide = sides.size > 1 ? ` of ${own.join(", ")} px` : "";
  return `${obstacles.length} obstacle${obstacles.length > 1 ? "s" : ""}${wide} at ${places}`;
}

/** Members of a list by the value of a function, in order of appearance. */
function groupBy(list, key) {
  const groups = new Map();
  for (const item of list) {
    const name = key(item);
    if (!groups.has(name)) groups.set(name, []);
    groups.get(name).push(item);
  }
  return groups;
}

/** Distinct values of an episode column, sorted as people sort. */
function distinct(name) {
  return [...new Set(episodes.map((episode) => String(episode[name] ?? "")))].sort((a, b) =>
    a.localeCompare(b, "en", { numeric: true }),
  );
}

/** Wilson's 95 % interval of a share. */
function wilson(successes, n) {
  const z = 1.959963984540054;
  const p = successes / n;
  const centre = (p + (z * z) / (2 * n)) / (1 + (z * z) / n);
  const half = (z * Math.sqrt((p * (1 - p)) / n + (z * z) / (4 * n * n))) / (1 + (z * z) / n);
  return [Math.max(0, centre - half), Math.min(1, centre + half)];
}
