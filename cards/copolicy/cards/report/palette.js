/** Colours: those of the figures, from the data, and the light or dark theme of the page. */

const SEAT_COLOURS = data.colours.seats; // robot, human
const GOAL_COLOUR = data.colours.goal;
const FAILURE_COLOUR = data.colours.failure;
// Cividis (Nunez, Anderton and Renslow 2018), from low to high.
const CIVIDIS = ["#00224e", "#123570", "#3b496c", "#575d6d", "#707173", "#8a8678", "#a59c74", "#c3b369", "#e1cc55", "#fee838"];

/** Colour of a strategy label, unique among labels of the same obstacles. */
const labelColour = (label) => data.colours.labels[label] ?? colour(MISSING.labels ? "--link" : "--muted");

/** A colour of the style sheet in the current theme. */
function colour(name) {
  return getComputedStyle(document.documentElement).getPropertyValue(name).trim();
}

/** Colour of heat maps at a proportion in [0, 1] of the scale. */
function heatColour(proportion) {
  const position = Math.min(Math.max(proportion, 0), 1) * (CIVIDIS.length - 1);
  const low = Math.min(Math.floor(position), CIVIDIS.length - 2);
  const channel = (hex, k) => parseInt(hex.slice(1 + 2 * k, 3 + 2 * k), 16);
  const mixed = [0, 1, 2].map((k) => {
    const [a, b] = [channel(CIVIDIS[low], k), channel(CIVIDIS[low + 1], k)];
    return Math.round(a + (position - low) * (b - a));
  });
  return `rgb(${mixed.join(",")})`;
}

const THEMES = ["auto", "light", "dark"];

/** Sets up the button that cycles through system, light and dark colours; calls `redraw` after each change. */
function setUpTheme(redraw) {
  const button = byId("theme");
  let theme = "auto";
  button.addEventListener("click", () => {
    theme = THEMES[(THEMES.indexOf(theme) + 1) % THEMES.length];
    document.documentElement.dataset.theme = theme;
    button.textContent = `Colours: ${theme}`;
    button.setAttribute("aria-label", `Colours: ${theme === "auto" ? "system setting" : theme}`);
    redraw();
  });
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);
}
