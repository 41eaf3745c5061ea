/** Creates elements of the page; text is always inserted as text, never as markup. */

const byId = (id) => document.getElementById(id);

/** Creates an element with attributes, listeners (`onclick`, ...) and children (nodes or text). */
function make(name, attributes = {}, ...children) {
  const node = document.createElement(name);
  return fill(node, attributes, children);
}

/** Creates an SVG element; see `make`. */
function makeSvg(name, attributes = {}, ...children) {
  return fill(document.createElementNS("http://www.w3.org/2000/svg", name), attributes, children);
}

function fill(node, attributes, children) {
  for (const [key, value] of Object.entries(attributes)) {
    if (key.startsWith("on")) node.addEventListener(key.slice(2), value);
    else if (value !== false && value !== null) node.setAttribute(key, value === true ? "" : value);
  }
  node.append(...children.filter((child) => child !== null));
  return node;
}

/** Text beside a patch of a colour. */
function paintKey(text, paint) {
  const key = make("span", { class: "key" }, text);
  key.style.setProperty("--key", paint);
  return key;
}

/** Head and body of a table, from its column headings and rows. */
const tableParts = (heads, rows) => [
  make("thead", {}, make("tr", {}, ...heads.map((head) => make("th", { scope: "col" }, head)))),
  make("tbody", {}, ...rows),
];

/** A table in a scrolling region. */
const scrolling = (label, kind, attributes, heads, rows) =>
  make("div", { class: kind, tabindex: "0", role: "region", "aria-label": label }, make("table", attributes, ...tableParts(heads, rows)));

/** Sizes a canvas to `width` x `height` CSS px at the screen's resolution; returns its context, scaled to CSS px. */
function sharpContext(canvas, width, height) {
  const ratio = window.devicePixelRatio || 1;
  canvas.width = Math.round(width * ratio);
  canvas.height = Math.round(height * ratio);
  canvas.style.height = `${height}px`;
  const context = canvas.getContext("2d");
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  return context;
}

/** A number with `digits` significant digits; a dash for a missing one. */
function formatNumber(value, digits = 3) {
  if (value === null || value === undefined || Number.isNaN(value)) return "–";
  if (typeof value !== "number") return String(value);
  if (Number.isInteger(value)) return value.toLocaleString("en");
  return Math.abs(value) >= 1000 ? Math.round(value).toLocaleString("en") : String(Number(value.toPrecision(digits)));
}

const percent = (proportion) => `${(100 * proportion).toFixed(1)} %`;

/** Quantile of sorted numbers, linearly interpolated. */
function quantile(sorted, proportion) {
  if (!sorted.length) return null;
  const position = proportion * (sorted.length - 1);
  const low = Math.floor(position);
  const high = Math.min(low + 1, sorted.length - 1);
  return sorted[low] + (position - low) * (sorted[high] - sorted[low]);
}

/** The numbers of a list, sorted; other values are dropped. */
const ordered = (values) => values.filter((value) => typeof value === "number").sort((a, b) => a - b);
