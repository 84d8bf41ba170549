// Models of the History view: search, filter and pages, and how the address names them. Neither asks the
// server nor draws.

export const kPerPage = 20;

/** What can be chosen as verdict. An active model is accepted, too, unless it was forced. */
export const verdicts = ["active", "accepted", "refused", "not judged", "damaged"];

const kNone = { search: "", method: "", verdict: "", from: "", to: "", page: 1 };
const isDay = (text) => /^\d{4}-\d{2}-\d{2}$/.test(text) && !Number.isNaN(Date.parse(text));

/** The filter in the address "#history/verdict=refused&page=2". What is unknown there is left out. */
export function filterOf(hash) {
  const given = new URLSearchParams(hash.split("/").slice(1).join("/"));
  const text = (name) => (given.get(name) ?? "").slice(0, 200);
  const day = (name) => (isDay(text(name)) ? text(name) : "");
  const page = Number(text("page"));
  return { search: text("search"), method: text("method"),
    verdict: verdicts.includes(text("verdict")) ? text("verdict") : "",
    from: day("from"), to: day("to"), page: Number.isInteger(page) && page > 0 ? page : 1 };
}

/** The address of the filter: what is not chosen is not in it. */
export function hashOf(filter) {
  const chosen = Object.entries(filter).filter(([name, value]) => value !== kNone[name]);
  return chosen.length === 0 ? "#history" : `#history/${new URLSearchParams(chosen)}`;
}

/** The same filter without a choice. */
export const noFilter = () => ({ ...kNone });

export function verdictOf(model) {
  if (model.fault) return "damaged";
  return model.accepted ? "accepted" : model.judged ? "refused" : "not judged";
}

/** Midnight of the local day, ms since 1970; `later`: days. */
function midnight(day, later = 0) {
  const [year, month, date] = day.split("-").map(Number);
  return new Date(year, month - 1, date + later).getTime();
}

/** The models that the filter lets pass, in their order. Each word of the search must be in id, machine,
 * method, fault or reasons. `from` and `to`: local days of the addition, both included. */
export function matching(models, filter) {
  const words = filter.search.toLowerCase().split(/\s+/).filter((word) => word);
  const first = filter.from ? midnight(filter.from) : -Infinity;
  const end = filter.to ? midnight(filter.to, 1) : Infinity;
  return models.filter((m) => {
    if (filter.method && m.method !== filter.method) return false;
    if (filter.verdict === "active" ? !m.active : filter.verdict && verdictOf(m) !== filter.verdict) return false;
    const added = Date.parse(m.added);
    if (added < first || added >= end) return false;
    const text = [m.id, m.machine, m.method, m.fault, ...m.reasons].join("\n").toLowerCase();
    return words.every((word) => text.includes(word));
  });
}

/** The models of page `page` (from 1; the last one if there are fewer), and the number of pages. */
export function pageOf(models, page) {
  const pages = Math.max(1, Math.ceil(models.length / kPerPage));
  const shown = Math.min(page, pages);
  return { pages, page: shown, models: models.slice((shown - 1) * kPerPage, shown * kPerPage) };
}
