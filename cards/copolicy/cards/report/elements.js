/** Makes elements of the page; text always goes in as text, never as markup. */

const byId = (id) => document.getElementById(id);

/** An element with attributes, listeners (`onclick`, ...) and children (nodes or text). */
function make(name, attributes = {}, ...children) {
  const node = document.createElement(name);
  return fill(node, attributes, children);
}

/** The same for SVG. */
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

/** Words beside a patch of a colour. */
function paintKey(text, paint) {
  const key = make("span", { class: "key" }, text);
  key.style.setProperty("--key", paint);
  return key;
}

/** Head and body of a table, from the texts of its columns and its rows. */
const tableParts = (heads, rows) => [
  make("thead", {}, make("tr", {}, ...heads.map((head) => make("th", { scope: "col" }, head)))),
  make("tbody", {}, ...rows),
];

/** A table that scrolls by itself. */
const scrolling = (label, kind, attributes, heads, rows) =>
  make("div", { class: kind, tabindex: "0", role: "region", "aria-label": label }, make("table", attributes, ...tableParts(heads, rows)));

/** A canvas of `width` x `height` CSS px with sharp pixels on any screen; returns its context in CSS px. */
function sharpContext(canvas, width, height) {
  const ratio = window.devicePixelRatio || 1;
  canvas.width = Math.round(width * ratio);
  canvas.height = Math.round(height * ratio);
  canvas.style.height = `${height}px`;
  const context = canvas.getContext("2d");
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  return context;
}

/** A number with a few significant digits; a dash where there is none. */
function formatNumber(value, digits = 3) {
  if (value === null || value === undefined || Number.isNaN(value)) return "–";
  if (typeof value !== "number") return String(value);
  if (Number.isInteger(value)) return value.toLocaleString("en");
  return Math.abs(value) >= 1000 ? Math.round(value).toLocaleString("en") : String(Number(value.toPrecision(digits)));
}

const percent = (share) => `${(100 * share).toFixed(1)} %`;

/** The value below which a share of sorted numbers lies, linear between them. */
function quantile(sorted, share) {
  if (!sorted.length) return null;
  const place = share * (sorted.length - 1);
  const low = Math.floor(place);
  const high = Math.min(low + 1, sorted.length - 1);
  return sorted[low] + (place - low) * (sorted[high] - sorted[low]);
}

/** Numbers of a list in order, without what is missing. */
const ordered = (values) => values.filter((value) => typeof value === "number").sort((a, b) => a - b);
