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

  // Where the wheels went meanwhile its successor does not know: it is disarmed, and nothing is there to be resumed.
  await kill("step_generator");
  await state(page, "disarmed");
  assert((await page.textContent("#state-text")) === "DISARMED" && (await status()).mode === "disarmed", "as hilare status says");
  assert((await page.textContent("#pause")) === "Pause" && (await page.locator("#pause").isDisabled()), "it is armed, not resumed");
  await until("with another clock", ({ processes }) => processes.some((one) => one.name === "step_generator" && one.restarts === 1 && one.state === "running"));
  await page.click("#arm");
  await state(page, "driving");

  // One that dies while the robot drives on is no fault: it is said for a while, and counted.
  await page.waitForFunction(() => document.getElementById("notice").textContent === "");
  await kill("pose_estimator");
  await page.waitForFunction(() => /^pose_estimator was killed \(signal 9\): starting it again; back after [\d.]+ ms$/.test(document.getElementById("notice").textContent));
  await state(page, "driving");
  assert(await page.locator("#notice").isVisible(), "the notice is in sight");
  await picture(page, "notice");
  const restarts = page.locator("#numbers div", { hasText: "Restarts" }).locator("dd[data-off]");
  await page.waitForFunction(() => [...document.querySelectorAll("#numbers dd[data-off]")].some((cell) => cell.previousElementSibling.textContent === "Restarts" && cell.textContent === "3"));
  assert((await restarts.evaluate((cell) => getComputedStyle(cell, "::before").content)).includes("▲"), "and not by its colour alone");
  assert(await page.locator("#log li[data-level=warn]", { hasText: "pose_estimator was killed (signal 9): starting it again" }).count() === 1, "it stays in the log");
  // A law that is degraded is said as long as it is, and ten seconds more.
  const said = await page.evaluate(async () => {
    const { Notices } = await import("./notices.js");
    const [own, host, { now }] = [new Notices(), document.getElementById("notice"), performance];
    own.processes([{ name: "controller", law: "qp", state: "degraded", reason: "out of time" }, { name: "plant", state: "running" }], ({ name }) => name);
    const after = (ms) => {
      performance.now = () => now.call(performance) + ms;
      own.show(false);
      performance.now = now;
      return host.textContent;
    };
    return [after(0), after(9000), after(11_000)];
  });
  assert(JSON.stringify(said) === JSON.stringify(["controller is degraded: out of time", "controller is degraded: out of time", ""]), `said: ${said}`);

  // Beyond its budget a box is given up, and the robot ends; why stays on the page.
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
