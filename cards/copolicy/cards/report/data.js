/** The data of the page: episodes, their frames, and which of them are chosen. */

const data = JSON.parse(byId("data").textContent);
const COLUMNS = Object.keys(data.scales);
const OUTLINE = data.outline;
const [WIDTH, HEIGHT] = OUTLINE ? OUTLINE.size : [1200, 600];
const UNIT = WIDTH / 1200; // of lines and marks in a scene
const WORDS = data.words;
const MISSING = data.left_out; // why something is not on the page, by what the task lacks
const FRAME_SECONDS = data.frame_step / data.fps;

const frameValues = decodeFrames(data.frames);
const episodes = data.episodes.map((row) => ({
  ...row,
  scene: OUTLINE ? data.scenes[row.scene] : { name: "", obstacles: 0, shapes: [] },
  layout: OUTLINE ? data.scenes[row.scene].name : "",
  outcome: row.success ? WORDS.success : "did not",
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

const capital = (text) => text.charAt(0).toUpperCase() + text.slice(1);

/** Those of some entries, each with what the task must not lack before it, that are there. */
const offered = (entries) => entries.filter(([part]) => !MISSING[part]).map(([, entry]) => entry);

/** A paragraph with why something is left out. */
const absent = (part) => make("p", { class: "absent" }, MISSING[part]);

/** A place in the scene in words. */
const placeText = (value) => value.toFixed(OUTLINE.decimals);

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
