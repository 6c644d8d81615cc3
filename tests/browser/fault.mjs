// What goes wrong is said, with its reason: a controller that is killed, then a robot that is given up.

import { assert, forgive, inBrowser, picture, redraw, state, status, until } from "./page.mjs";

const kill = async (box) => {
  const { pid } = (await status()).processes.find((one) => one.name === box && one.pid);
  process.kill(pid, "SIGKILL");
};

await inBrowser(async (page) => {
  await redraw(page, [-0.2, -0.5, 2.2, 0.5], [[0, 0], [2, 0]]);
  await page.click("#run");
  await state(page, "driving");

  // [supervision] resume_by_operator: the robot waits for its operator.
  await kill("controller");
  await state(page, "stopped");
  await page.waitForSelector("#fault:not([hidden])");
  const why = await page.textContent("#fault");
  assert(why.includes("controller") && why.includes("signal 9"), `the reason is shown: ${why}`);
  await until("with another controller", ({ processes }) => processes.some((one) => one.name === "controller" && one.restarts === 1 && one.state === "running"));
  await page.click("#pause");
  await state(page, "driving");
  await page.waitForSelector("#fault", { state: "hidden" });

  // Beyond its budget a box is given up, and the robot ends; why stays on the page.
  await kill("pose_estimator");
  await until("with another estimator", ({ processes }) => processes.some((one) => one.name === "pose_estimator" && one.restarts === 1 && one.state === "running"));
  await kill("pose_estimator");
  await state(page, "fault");
  await page.waitForFunction(() => document.getElementById("fault").textContent.includes("pose_estimator"));
  await page.waitForFunction(() => document.getElementById("state-text").textContent === "ROBOT IS DOWN");
  assert(await page.locator("#fault").isVisible(), "the reason is in sight");
  for (const id of ["run", "pause", "arm", "reset", "law"]) assert(await page.locator(`#${id}`).isDisabled(), `${id} does nothing any more`);
  await picture(page, "fault");
  // Nobody is there any more to answer the page: that is no trouble of its own.
  forgive(page);
});
