// What has just gone wrong though the robot drives on: a line near the state, for a while.

import { $, make } from "./dom.js";

/** Time that something is shown after it was last so. */
const SHOWN_MS = 10_000;
/** What the log says in the first moment was before this page. */
const PAST_MS = 1000;
/** So many at once, the newest. */
const MOST = 3;
/** Who a line of launch is about; and what comes of a trouble, which is no warning itself. */
const ABOUT = /^(.+? is degraded|.+?(?= (?:was|is|did|had|gave)\b))/;
const OUTCOME = /^(.+?) is ((back after|in charge now).*)/;
/** The reason beside the state says that already. */
const SAID_ELSEWHERE = "has to be armed again";

export class Notices {
  constructor() {
    this.begun = 0;
    /** Time of the newest line of the log that was looked at, ms. */
    this.newest = -Infinity;
    /** What is said of whom, and when it was last so. */
    this.shown = new Map();
  }

  /** Lines of the log: warnings, and what came of them. */
  lines(lines) {
    this.begun ||= performance.now();
    const past = performance.now() - this.begun < PAST_MS;
    for (const { time, level, text } of lines.filter((line) => line.time > this.newest)) {
      const said = text.replace(/^launch: /, "");
      this.newest = time;
      const outcome = said.match(OUTCOME);
      if (past || (level === "info" && !outcome) || said.includes(SAID_ELSEWHERE)) continue;
      const before = outcome && this.shown.get(outcome[1]);
      this.note(said.match(ABOUT)?.[1] ?? said, before ? `${before.text}; ${outcome[2]}` : said);
    }
  }

  /** What is so now. */
  processes(processes, name) {
    processes.filter(({ state }) => state === "degraded").forEach((one) => this.note(`${name(one)} is degraded`, `${name(one)} is degraded: ${one.reason}`));
  }

  note(who, text) {
    this.shown.set(who, { text, at: performance.now() });
  }

  /** Where the robot cannot go on its reason is said, and nothing beside it. */
  show(silent) {
    for (const [who, { at }] of this.shown) if (performance.now() - at > SHOWN_MS) this.shown.delete(who);
    const wanted = silent ? [] : [...this.shown.values()].slice(-MOST).map(({ text }) => text);
    const host = $("notice");
    if (wanted.join("\n") === [...host.children].map((one) => one.textContent).join("\n")) return;
    host.replaceChildren(...wanted.map((text) => make("p", text)));
  }
}
