// Robots come and go under an open page: one that is taken down is no fault, what it drove is a drawing for the next
// one, and a run that has arrived ends as one that has.

import { writeFileSync } from "node:fs";
import { ask, assert, command, drawn, forgive, inBrowser, picture, redraw, robot, state, url, until } from "./page.mjs";

const listen = new URL(url).host;
const hint = (page, wanted) => page.waitForFunction((wanted) => document.getElementById("hint").textContent.includes(wanted), wanted);

/** Pictures of a state as an operator may have it before him. */
async function pictures(page, name) {
  await picture(page, name);
  await page.emulateMedia({ colorScheme: "light" });
  await picture(page, `${name}-light`);
  await page.setViewportSize({ width: 390, height: 844 });
  await picture(page, `${name}-phone`);
  await page.emulateMedia({ colorScheme: "dark" });
  await page.setViewportSize({ width: 1280, height: 720 });
}

/** The robot has ended and all is well. */
async function ended(page, name, reason) {
  await page.waitForFunction((name) => document.getElementById("state-text").textContent === name, name);
  // Also when nobody is there any more.
  await page.waitForTimeout(1500);
  assert((await page.textContent("#state-text")) === name, `${name} stays`);
  assert((await page.getAttribute("body", "data-state")) === "ended" && (await page.getAttribute("body", "data-link")) === "ended", "it is no fault");
  assert((await page.textContent("#fault")).includes(reason), await page.textContent("#fault"));
  for (const id of ["run", "pause", "arm", "reset", "law"]) assert(await page.locator(`#${id}`).isDisabled(), `${id} does nothing any more`);
  assert(!(await page.textContent("#processes")).includes("dead"), "who has left is not dead");
  await page.keyboard.press(" ");
  await hint(page, "nothing to stop");
  assert((await page.textContent("#state-text")) === name, "and is still down");
}

await inBrowser(async (page) => {
  // Run is no other Arm.
  await page.click("#run");
  await hint(page, "draw or import a path first");
  await state(page, "disarmed");

  await redraw(page, [-0.2, -0.5, 2.2, 0.5], [[0.1, 0], [1, 0.1], [2, 0]]);
  await page.click("#run");
  await state(page, "driving");
  await page.keyboard.press(" ");
  await state(page, "stopped");
  const path = JSON.stringify(await drawn(page));
  await ask("down");
  await ended(page, "TAKEN DOWN", "hilare down");
  await pictures(page, "taken-down");

  // The next one has no path: what is left is there to be seen, foretold and sent.
  await command("up", "--detach", "--robot", robot, "--listen", listen);
  await page.waitForSelector("body[data-link=open]");
  await state(page, "disarmed");
  assert(JSON.stringify(await drawn(page)) === path && (await page.evaluate(() => globalThis.hilare.path.unsent)), "the path is a drawing");
  assert((await page.textContent("#table-title")).includes("not sent yet"), "and said to be one");
  await page.waitForFunction(() => document.getElementById("predicted").textContent.startsWith("predicted:"));
  await pictures(page, "left-over");
  await page.click("#run");
  await state(page, "driving");
  await until("on its way", ({ path_state, waypoints }) => path_state === "tracking" && waypoints >= 3);
  await ask("down");
  await page.waitForFunction(() => document.getElementById("state-text").textContent === "TAKEN DOWN");

  // A run, with a path of its own: the page shows that one.
  const file = `${process.env.HOME}/run.csv`;
  writeFileSync(file, "x,y\n0,0\n0.15,0\n");
  const run = command("run", "--path", file, "--listen", listen, "--robot", robot, "--out", `${process.env.HOME}/run`);
  await state(page, "driving");
  await page.waitForFunction(() => globalThis.hilare.path.points.length === 2);
  await ended(page, "RUN OVER: ARRIVED", "has arrived");
  await pictures(page, "run-over");
  assert((await run).includes("ARRIVED"), "it has");
  forgive(page);
});
