/** Colours: those of figures, which come with the data, and light or dark around them. */

const SEAT_COLOURS = data.colours.seats; // robot, human
const GOAL_COLOUR = data.colours.goal;
const FAILURE_COLOUR = data.colours.failure;
// Cividis (Nunez, Anderton and Renslow 2018), from low to high.
const CIVIDIS = ["#00224e", "#123570", "#3b496c", "#575d6d", "#707173", "#8a8678", "#a59c74", "#c3b369", "#e1cc55", "#fee838"];

/** Colour of a strategy label: labels of the same obstacles never share one. */
const labelColour = (label) => data.colours.labels[label] ?? colour(MISSING.labels ? "--link" : "--muted");

/** A colour of the style sheet as it is now. */
function colour(name) {
  return getComputedStyle(document.documentElement).getPropertyValue(name).trim();
}

/** Colour at a share in [0, 1] of the scale of heat maps. */
function heatColour(share) {
  const place = Math.min(Math.max(share, 0), 1) * (CIVIDIS.length - 1);
  const low = Math.min(Math.floor(place), CIVIDIS.length - 2);
  const channel = (hex, k) => parseInt(hex.slice(1 + 2 * k, 3 + 2 * k), 16);
  const mixed = [0, 1, 2].map((k) => {
    const [a, b] = [channel(CIVIDIS[low], k), channel(CIVIDIS[low + 1], k)];
    return Math.round(a + (place - low) * (b - a));
  });
  return `rgb(${mixed.join(",")})`;
}

const THEMES = ["auto", "light", "dark"];

/** The button that goes through system colours, light and dark; `redraw` is called after each change. */
function setUpTheme(redraw) {
  const button = byId("theme");
  let theme = "auto";
  button.addEventListener("click", () => {
    theme = THEMES[(THEMES.indexOf(theme) + 1) % THEMES.length];
    document.documentElement.dataset.theme = theme;
    button.textContent = `Colours: ${theme}`;
    button.setAttribute("aria-label", `Colours: ${theme === "auto" ? "as the system has them" : theme}`);
    redraw();
  });
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);
}
