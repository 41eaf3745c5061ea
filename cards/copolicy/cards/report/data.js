/** The data of the page: episodes and their frames. */

const data = JSON.parse(byId("data").textContent);
const COLUMNS = Object.keys(data.scales);
const OUTLINE = data.outline;
const [WIDTH, HEIGHT] = OUTLINE ? OUTLINE.size : [1200, 600];
const UNIT = WIDTH / 1200; // scale of lines and marks in a scene
const WORDS = data.words;
const MISSING = data.left_out; // notes on left out contents, by the missing part of the task
const FRAME_SECONDS = data.frame_step / data.fps;

const frameValues = decodeFrames(data.frames);
const episodes = data.episodes.map((row) => ({
  ...row,
  scene: OUTLINE ? data.scenes[row.scene] : { name: "", obstacles: 0, shapes: [] },
  layout: OUTLINE ? data.scenes[row.scene].name : "",
  outcome: row.success ? WORDS.success : "did not",
}));

/** Decodes little-endian 16-bit integers from base64. */
function decodeFrames(text) {
  const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  const view = new DataView(bytes.buffer);
  return Int16Array.from({ length: bytes.length / 2 }, (_, k) => view.getInt16(2 * k, true));
}

/** One column of an episode's frames, in the unit of the column. */
function column(episode, name) {
  const offset = COLUMNS.indexOf(name);
  const values = new Float32Array(episode.frames);
  for (let k = 0; k < episode.frames; k++) {
    values[k] = frameValues[(episode.from + k) * COLUMNS.length + offset] / data.scales[name];
  }
  return values;
}

const capital = (text) => text.charAt(0).toUpperCase() + text.slice(1);

/** Of entries `[part, entry]`, those whose part the task does not lack. */
const offered = (entries) => entries.filter(([part]) => !MISSING[part]).map(([, entry]) => entry);

/** A paragraph that states why a content is left out. */
const missingNote = (part) => make("p", { class: "missing" }, MISSING[part]);

/** A coordinate in the scene as text. */
const placeText = (value) => value.toFixed(OUTLINE.decimals);

/** Groups a list by the value of a function, in order of appearance. */
function groupBy(list, key) {
  const groups = new Map();
  for (const item of list) {
    const name = key(item);
    if (!groups.has(name)) groups.set(name, []);
    groups.get(name).push(item);
  }
  return groups;
}

/** Distinct values of an episode column, numbers in text sorted by value. */
function distinct(name) {
  return [...new Set(episodes.map((episode) => String(episode[name] ?? "")))].sort((a, b) =>
    a.localeCompare(b, "en", { numeric: true }),
  );
}

/** Wilson's 95 % interval of a proportion. */
function wilson(successes, n) {
  const z = 1.959963984540054;
  const p = successes / n;
  const centre = (p + (z * z) / (2 * n)) / (1 + (z * z) / n);
  const half = (z * Math.sqrt((p * (1 - p)) / n + (z * z) / (4 * n * n))) / (1 + (z * z) / n);
  return [Math.max(0, centre - half), Math.min(1, centre + half)];
}
