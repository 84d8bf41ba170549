// The line below the view: what a click did, or why it did not.

const line = () => document.getElementById("message");

export function message(text) {
  line().textContent = text;
}

/** Removes the message if it is one of `texts`. */
export function withdraw(texts) {
  if (texts.includes(line().textContent)) message("");
}
