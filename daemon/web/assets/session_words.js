// A calibration in the words of the page.

export const running = (session) => ["warming", "acquiring", "identifying", "judged"].includes(session.state);

const kStates = {
  idle: "not running", warming: "before the start", acquiring: "acquiring", identifying: "identifying",
  judged: "judging", active: "has ended: model accepted", refused: "has ended: refused",
};
const kMethods = { otf: "on the fly", evemu: "ball array", mfb: "Multi-Feature Bar" };

export const methodInWords = (session) => kMethods[session.method] ?? session.method;

/** "before the start", "acquiring 40 %", "READY: drive now". */
export function stateInWords(session) {
  if (session.start?.ready) return "READY: drive now";
  if (session.start?.missed) return "start missed";
  const words = kStates[session.state] ?? session.state;
  return session.state === "acquiring" ? `${words} ${Math.round(100 * session.progress)} %` : words;
}
