// A question that stops nothing else of the page: the dialog of the document, for the keyboard and
// screen readers as well.

import { h } from "./dom.js";

/** Asks before a change. `question`: {title, lines, fields, reason, required, yes, no}. `fields`: elements
 * that the caller reads itself. `reason`: the label of a field for a reason; without it there is none.
 * Returns the reason ("" without a field), or null if the change is not wanted. */
export function ask({ title, lines = [], fields = [], reason = null, required = false, yes, no = "Do not change" }) {
  const field = reason === null ? null : h("input", { name: "reason", maxlength: 500, required,
    pattern: required ? ".*\\S.*" : null, autocomplete: "off" });
  const form = h("form", { method: "dialog" }, h("h2", { id: "ask-title" }, title),
    lines.map((line) => h("p", {}, line)), fields,
    field ? h("label", {}, `${reason} `, field) : null,
    h("div", { class: "tools" }, h("button", { class: "strong", value: "yes" }, yes),
      h("button", { value: "no", formnovalidate: true }, no)));
  const dialog = h("dialog", { "aria-labelledby": "ask-title", class: "ask" }, form);
  document.body.append(dialog);
  return new Promise((answer) => {
    dialog.addEventListener("close", () => {
      answer(dialog.returnValue === "yes" ? (field?.value.trim() ?? "") : null);
      dialog.remove();
    });
    dialog.showModal();
  });
}
