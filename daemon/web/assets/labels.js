// Which labels of a drawing are shown.

/** The labels that no label before them covers. `labels`: { x, y, width, height, depth, first }, the
 * centre and size in pixels; those with `first` come before the others, then the nearest. */
export function withoutOverlap(labels) {
  const covers = (a, b) =>
    Math.abs(a.x - b.x) < (a.width + b.width) / 2 && Math.abs(a.y - b.y) < (a.height + b.height) / 2;
  const shown = [];
  for (const label of [...labels].sort((a, b) => b.first - a.first || a.depth - b.depth))
    if (!shown.some((other) => covers(other, label))) shown.push(label);
  return shown;
}
