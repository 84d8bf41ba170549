// Colours of charts and 3-D views by theme and contrast. Against the ground of the page and of a chart
// (style.css), lines and bodies have a contrast of 3:1 or more, texts 4.5:1 [WCAG 2.2, 1.4.11 and 1.4.3];
// where more contrast is preferred, 7:1. Colours of curves can be distinguished by people with colour
// vision deficiency [Okabe, Ito 2008].

const more = matchMedia("(prefers-contrast: more)");

const dark = {
  curves: ["#56b4e9", "#e69f00", "#2fd3a0", "#e29ac4", "#f0e442", "#ff8f5a"],
  text: "#a8b3bf", line: "#9aa7b4", open: "#8b9cae", touched: "#2fd3a0", next: "#e69f00", tip: "#e29ac4",
  point: "#56b4e9", error: "#e69f00", uncertainty: "#2fd3a0",  // of the field
};
const light = {
  curves: ["#0072b2", "#d55e00", "#00795a", "#a8457f", "#8a5a00", "#1b6fa8"],
  text: "#4d5761", line: "#57606a", open: "#6e7f90", touched: "#00795a", next: "#d55e00", tip: "#a8457f",
  point: "#0072b2", error: "#d55e00", uncertainty: "#00795a",  // of the field
};
const darkMore = {
  curves: ["#7cc8ff", "#ffb627", "#4be8b6", "#ffb3da", "#fff04d", "#ffab80"],
  text: "#ffffff", line: "#ffffff", open: "#b4c0cc", touched: "#4be8b6", next: "#ffb627", tip: "#ffb3da",
  point: "#7cc8ff", error: "#ffb627", uncertainty: "#4be8b6",  // of the field
};
const lightMore = {
  curves: ["#00508a", "#8f3d00", "#00603a", "#7d2a5c", "#5f3d00", "#123f73"],
  text: "#000000", line: "#000000", open: "#595959", touched: "#00603a", next: "#8f3d00", tip: "#7d2a5c",
  point: "#00508a", error: "#8f3d00", uncertainty: "#00603a",  // of the field
};

export const isDark = () => document.documentElement.dataset.theme === "dark";
export const prefersMore = () => more.matches;
export const palette = () => (isDark() ? (more.matches ? darkMore : dark) : more.matches ? lightMore : light);

/** Calls `listener` when the palette changes; returns what ends this. */
export function onPalette(listener) {
  addEventListener("theme", listener);
  more.addEventListener("change", listener);
  return () => {
    removeEventListener("theme", listener);
    more.removeEventListener("change", listener);
  };
}
