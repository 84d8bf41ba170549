// Colours of charts and 3-D views by theme and contrast. Against the ground of the page and of a chart
// (style.css), lines and bodies have a contrast of 3:1 or more, texts 4.5:1 [WCAG 2.2, 1.4.11 and 1.4.3];
// where more contrast is preferred, 7:1. Colours of curves can be distinguished by people with colour
// vision deficiency [Okabe, Ito 2008].

const more = matchMedia("(prefers-contrast: more)");

/** `curves`: blue, orange, green, violet and two more; the others are greys. */
function colours(curves, text, line, open) {
  const [blue, orange, green, violet] = curves;
  return { curves, text, line, open, touched: green, next: orange, tip: violet,
    point: blue, error: orange, uncertainty: green };  // of the field
}

const usual = {
  dark: colours(["#56b4e9", "#e69f00", "#2fd3a0", "#e29ac4", "#f0e442", "#ff8f5a"], "#a8b3bf", "#9aa7b4", "#8b9cae"),
  light: colours(["#0072b2", "#d55e00", "#00795a", "#a8457f", "#8a5a00", "#1b6fa8"], "#4d5761", "#57606a", "#6e7f90"),
};
const strong = {
  dark: colours(["#7cc8ff", "#ffb627", "#4be8b6", "#ffb3da", "#fff04d", "#ffab80"], "#ffffff", "#ffffff", "#b4c0cc"),
  light: colours(["#00508a", "#8f3d00", "#00603a", "#7d2a5c", "#5f3d00", "#123f73"], "#000000", "#000000", "#595959"),
};

export const isDark = () => document.documentElement.dataset.theme === "dark";
export const prefersMore = () => more.matches;
export const palette = () => (prefersMore() ? strong : usual)[isDark() ? "dark" : "light"];

/** Calls `listener` when the palette changes; returns what ends this. */
export function onPalette(listener) {
  addEventListener("theme", listener);
  more.addEventListener("change", listener);
  return () => {
    removeEventListener("theme", listener);
    more.removeEventListener("change", listener);
  };
}
