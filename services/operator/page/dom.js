// What every part of the page needs: elements, numbers as text, a word to the operator.

export const $ = (id) => document.getElementById(id);

/** Without the minus of what is rounded to nothing. */
export const fixed = (value, digits) => value.toFixed(digits).replace(/^-(0\.?0*)$/, "$1");

/** Metres as millimetres. */
export const mm = (metres, digits = 1) => (metres == null || !Number.isFinite(metres) ? "–" : fixed(metres * 1e3, digits));

/** To a tenth of a millimetre, as a path is sent. */
export const tenths = (metres) => Math.round(metres * 1e4) / 1e4;

/** Sets a text; one that is there already is not touched, so that nothing is read out again. */
export function put(id, text) {
  if ($(id).textContent !== text) $(id).textContent = text;
}

/** An element with a text. */
export function make(tag, text = "", more = {}) {
  return Object.assign(document.createElement(tag), { textContent: text }, more);
}

let hintEnds = 0;

/** Says something on the map's lower edge; for good if `seconds` is 0. What is bad is set off from what is well. */
export function hint(text, seconds = 6, { bad = false, about = "" } = {}) {
  $("hint").textContent = text;
  $("hint").toggleAttribute("data-bad", bad);
  $("hint").dataset.about = about;
  clearTimeout(hintEnds);
  if (seconds) hintEnds = setTimeout(() => ($("hint").textContent = ""), seconds * 1e3);
}

/** What was said about something does not hold any more; `text` does, for as long as that would have been said. */
export function unhint(about, text = "") {
  if ($("hint").dataset.about !== about) return;
  $("hint").textContent &&= text;
  $("hint").dataset.about = "";
}

/** Asks before something is done. Not modal: STOP stays within reach. */
export function sure(text, yes) {
  const dialog = $("ask");
  if (dialog.open) return Promise.resolve(false);
  $("ask-text").textContent = text;
  $("ask-yes").textContent = yes;
  dialog.returnValue = "no";
  dialog.show();
  return new Promise((resolve) => dialog.addEventListener("close", () => resolve(dialog.returnValue === "yes"), { once: true }));
}

/** Fills a table's body; numbers stand at the right. */
export function fill(table, values, isBad = () => false) {
  table.tBodies[0].replaceChildren(...values.map((cells, i) => {
    const row = make("tr");
    if (isBad(i)) row.dataset.bad = "";
    row.append(...cells.map((value) => make("td", value, { className: typeof value === "number" || value === "–" ? "n" : "" })));
    return row;
  }));
}
