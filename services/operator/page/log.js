// The merged log.

import { $, make } from "./dom.js";

const LOG_MAX = 1000;
/** Whoever is that near to the end follows it. */
const NEAR_PX = 40;

/** Time of day of a time in ms since 1970, to the millisecond. */
function clockTime(ms) {
  const at = new Date(ms);
  const digits = (n, count = 2) => String(n).padStart(count, "0");
  return `${digits(at.getHours())}:${digits(at.getMinutes())}:${digits(at.getSeconds())}.${digits(at.getMilliseconds(), 3)}`;
}

/** Appends lines. */
export function addLines(lines) {
  const list = $("log");
  const box = list.parentElement;
  const atEnd = box.scrollHeight - box.scrollTop - box.clientHeight < NEAR_PX;
  for (const line of lines) {
    const item = make("li");
    item.dataset.level = line.level;
    item.append(make("time", clockTime(line.time)), make("b", line.level), make("span", line.text));
    list.append(item);
  }
  while (list.childElementCount > LOG_MAX) list.firstElementChild.remove();
  if (atEnd) box.scrollTop = box.scrollHeight;
}

$("only-faults").addEventListener("change", () => {
  $("log").classList.toggle("only-faults", $("only-faults").checked);
  const box = $("log-lines");
  box.scrollTop = box.scrollHeight;
});
