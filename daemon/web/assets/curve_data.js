// The values of curves as the server keeps them: buckets of a step with smallest, largest and mean value.
// Neither asks the server nor draws.

/** The windows that can be chosen; `period_s`: how often the newest values are asked for. */
export const windows = [
  { name: "5min", title: "5 min", length_s: 300, period_s: 1 },
  { name: "1h", title: "1 h", length_s: 3600, period_s: 5 },
  { name: "8h", title: "8 h", length_s: 28800, period_s: 10 },
];

/** The window in the address "#curves/1h"; without one the shortest. */
export const windowOf = (hash) => windows.find(({ name }) => name === hash.split("/")[1]) ?? windows[0];

const keyOf = (curve) => `${curve.group}\n${curve.name}`;

/** What an answer of the server adds to `known` (null: nothing is known yet): {first, step_s, curves:
 * [{group, name, unit, min, max, mean, gap}]}, at most the `buckets` newest; `gap`: whether a bucket has a gap
 * or follows one. The newest known bucket was not complete, and is replaced. An answer that does not follow
 * what is known replaces all. */
export function merged(known, answer) {
  const added = answer.length;
  const end = answer.first + added;  // behind the last bucket
  const follows = known !== null && known.window === answer.window &&
    answer.first >= known.first && answer.first <= known.first + known.length;
  const begin = follows ? known.first : answer.first;
  const first = Math.max(begin, end - answer.buckets);
  const kept = follows ? answer.first - first : 0;  // buckets of `known`; negative: none
  const names = new Map();
  for (const curve of [...(follows ? known.curves : []), ...answer.curves]) names.set(keyOf(curve), curve);
  const before = new Map((follows ? known.curves : []).map((c) => [keyOf(c), c]));
  const now = new Map(answer.curves.map((c) => [keyOf(c), c]));
  const join = (old, news, empty) => [
    ...(kept > 0 ? old?.slice(first - known.first, first - known.first + kept) ?? Array(kept).fill(empty) : []),
    ...(news ?? Array(added).fill(empty)).slice(Math.max(0, -kept))];
  const curves = [...names.values()].map(({ group, name, unit }) => {
    const old = before.get(keyOf({ group, name })), fresh = now.get(keyOf({ group, name }));
    const gaps = new Set(fresh?.gaps ?? []);
    const gap = fresh?.mean.map((_, i) => gaps.has(answer.first + i));
    return { group, name, unit, min: join(old?.min, fresh?.min, null), max: join(old?.max, fresh?.max, null),
      mean: join(old?.mean, fresh?.mean, null), gap: join(old?.gap, gap, false) };
  }).filter((curve) => curve.mean.some((value) => value !== null));
  return { window: answer.window, first, length: end - first, step_s: answer.step_s, curves };
}

/** From which bucket on the server is asked: the newest one, which was not complete. */
export const next = (known) => (known === null || known.length === 0 ? 0 : known.first + known.length - 1);

/** The same with `factor` buckets in one, so that there are not more of them than pixels. They begin at
 * multiples of `factor`: a curve that moves on does not change its form. */
export function coarser(data, factor) {
  if (factor <= 1) return data;
  const first = Math.floor(data.first / factor);
  const length = Math.ceil((data.first + data.length) / factor) - first;
  const gathered = (values, take) => Array.from({ length }, (_, i) => {
    const begin = (first + i) * factor - data.first;
    const known = values.slice(Math.max(0, begin), begin + factor).filter((value) => value !== null);
    return known.length === 0 ? null : take(known);
  });
  return { ...data, first, length, step_s: data.step_s * factor, curves: data.curves.map((c) => ({ ...c,
    min: gathered(c.min, (all) => Math.min(...all)), max: gathered(c.max, (all) => Math.max(...all)),
    mean: gathered(c.mean, (all) => all.reduce((sum, value) => sum + value, 0) / all.length),
    gap: gathered(c.gap, (all) => all.includes(true)) })) };
}

/** Times of the middles of the buckets, ms since 1970. `begin_ms`: of bucket 0. */
export const timesOf = (data, begin_ms) =>
  Array.from({ length: data.length }, (_, i) => begin_ms + 1000 * data.step_s * (data.first + i + 0.5));

/** Which buckets have no neighbour that a line joins them with: they are drawn as dots. `gap` of a bucket:
 * no line from the last one before it. */
export function isolated({ mean, gap }) {
  const known = mean.map((_, i) => i).filter((i) => mean[i] !== null);
  const alone = new Array(mean.length).fill(false);
  known.forEach((i, k) => {
    const fromBefore = k > 0 && !gap[i];
    const toNext = k + 1 < known.length && !gap[known[k + 1]];
    alone[i] = !fromBefore && !toNext;
  });
  return alone;
}

/** Newest, smallest and largest value; null: there is none. `last`: null also if the newest value is more than
 * `most_age` buckets old, so that an old value is not taken for the present one. */
export function summary({ mean, min, max }, most_age) {
  const known = (values) => values.filter((value) => value !== null);
  const newest = mean.findLastIndex((value) => value !== null);
  return { last: newest >= 0 && newest >= mean.length - 1 - most_age ? mean[newest] : null,
    min: newest < 0 ? null : Math.min(...known(min)), max: newest < 0 ? null : Math.max(...known(max)) };
}

/** At most six significant digits, and no more decimals than the unit needs. */
export function valueText(value, unit) {
  if (value === null) return "-";
  const decimals = { mm: 4, "\u00b0": 4, "\u00b0C": 2, hPa: 2, "%": 1 }[unit] ?? 3;
  const whole = Math.max(1, Math.floor(Math.log10(Math.max(1, Math.abs(value)))) + 1);
  return value.toFixed(Math.max(0, Math.min(decimals, 6 - whole)));
}
