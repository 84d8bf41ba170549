// Times for people: in the time zone of the browser, with UTC beside it; ticks of time axes.

const two = (number) => String(number).padStart(2, "0");
const dayOf = (d) => `${d.getFullYear()}-${two(d.getMonth() + 1)}-${two(d.getDate())}`;
const hourOf = (d) => `${two(d.getHours())}:${two(d.getMinutes())}`;

/** "+0100" */
export function zoneOf(time_ms) {
  const minutes = -new Date(time_ms).getTimezoneOffset();
  const size = Math.abs(minutes);
  return `${minutes < 0 ? "-" : "+"}${two(Math.floor(size / 60))}${two(size % 60)}`;
}

/** "2026-11-26T18:30:05Z" */
const utcText = (time_ms) => `${new Date(time_ms).toISOString().slice(0, 19)}Z`;

/** The local time, and UTC in brackets, as the programs print them: ["2026-11-26 19:30:05 +0100",
 * "(2026-11-26T18:30:05Z)"]; where the zone is UTC: ["2026-11-26T18:30:05Z"]. */
export function localTimeParts(time_ms) {
  const d = new Date(time_ms);
  if (Number.isNaN(d.getTime())) return [""];
  if (d.getTimezoneOffset() === 0) return [utcText(time_ms)];
  return [`${dayOf(d)} ${hourOf(d)}:${two(d.getSeconds())} ${zoneOf(time_ms)}`, `(${utcText(time_ms)})`];
}

export const localTime = (time_ms) => localTimeParts(time_ms).join(" ");

/** Steps of a time axis by the field that is counted: local hours begin at midnight, also where the
 * clocks change. */
const kSteps = [
  ...[1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 900, 1800, 3600, 7200, 10800, 21600, 43200]
    .map((s) => ({ s, at: (d, k) => new Date(d.getFullYear(), d.getMonth(), d.getDate(), 0, 0, k * s),
      label: (t) => (s < 60 ? `${hourOf(t)}:${two(t.getSeconds())}` : hourOf(t)) })),
  ...[1, 2, 7, 14].map((days) => ({ s: 86400 * days,
    at: (d, k) => new Date(d.getFullYear(), d.getMonth(), d.getDate() + k * days), label: dayOf })),
  ...[1, 2, 3, 6, 12, 24, 60, 120].map((months) => ({ s: 30.4 * 86400 * months,
    at: (d, k) => new Date(d.getFullYear(), d.getMonth() - (d.getMonth() % Math.min(months, 12)) + k * months, 1),
    label: (t) => `${t.getFullYear()}-${two(t.getMonth() + 1)}` })),
];

/** At most `most` ticks at round local times of [from_ms, to_ms], oldest first: [{value, label}]. */
export function timeTicks(from_ms, to_ms, most) {
  const span_s = (to_ms - from_ms) / 1000;
  if (!(span_s > 0) || most < 1) return [];
  const step = kSteps.find(({ s }) => span_s / s < most) ?? kSteps.at(-1);
  const first = new Date(from_ms);
  const begin = Math.max(0, Math.floor((from_ms - step.at(first, 0).getTime()) / 1000 / step.s) - 1);
  const ticks = [];
  // An hour can be missing or come twice: a few more steps than those that fit.
  for (let k = begin; k <= begin + span_s / step.s + 3 + 7200 / step.s && ticks.length < most; ++k) {
    const at = step.at(first, k);
    const value = at.getTime();
    if (value >= from_ms && value <= to_ms && value > (ticks.at(-1)?.value ?? -Infinity))
      ticks.push({ value, label: step.label(at) });
  }
  return ticks;
}
