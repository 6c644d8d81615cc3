// The page's process hangs in mid-drive, and STOP is pressed meanwhile: it waits for whoever answers next, the same
// process or its successor, and the robot stops.

import { ask, assert, command, forgive, inBrowser, listen, picture, robot, state, status, until, url } from "./page.mjs";

const STOPPED = 4; // Drive::Stop
const HANGS_MS = 1200;

const operator = ({ processes }) => processes.find(({ name }) => name === "operator");
const fault = (page, wanted) => page.waitForFunction((wanted) => document.getElementById("fault").checkVisibility() && document.getElementById("fault").textContent.includes(wanted), wanted);

await inBrowser(async (page) => {
  const looks = [["hung-light", { colorScheme: "light" }], ["hung-phone", { viewport: { width: 390, height: 844 } }]];
  await page.setInputFiles("#file", process.env.HILARE_SO);
  await page.click("#run");
  const steps = listen("steps");

  /** STOP while the page's process hangs; `then(pid)` is what becomes of that. */
  async function hang(name, then) {
    await state(page, "driving");
    await page.waitForFunction(() => globalThis.hilare.picture.robot.pose);
    const { pid, restarts } = operator(await until("driving", ({ drive }) => drive === "driving"));
    process.kill(pid, "SIGSTOP");
    await page.waitForTimeout(HANGS_MS);
    const from = steps.messages.at(-1).tick;
    await page.click("#stop");
    const pressed = Date.now();
    await fault(page, "STOP sent, waiting");
    console.log(`${name}: said ${Date.now() - pressed} ms after the click`);
    assert(await page.locator("#run").isDisabled() && await page.locator("#pause").isDisabled(), "first the STOP");
    await then(pid);
    const stopped = await steps.until("that it stops", ({ tick, drive }) => tick > from && drive === STOPPED);
    console.log(`${name}: stopped ${stopped.tick - from} ticks after the click`);
    await state(page, "stopped");
    await page.waitForSelector("#fault", { state: "hidden" });
    await until("stopped", ({ mode }) => mode === "stop");
    return operator(await status()).restarts - restarts;
  }

  // It goes on before launch has lost patience.
  const same = await hang("goes on", (pid) => process.kill(pid, "SIGCONT"));
  assert(same === 0, "it is the same process");
  await page.click("#pause");

  // It does not: launch starts another one, and the page says all the while that the STOP has not arrived.
  const other = await hang("started again", async () => {
    await page.waitForSelector("body:not([data-link=open])");
    await fault(page, "STOP HAS NOT REACHED THE ROBOT");
    await picture(page, "hung");
    for (const [name, look] of looks) {
      if (look.viewport) await page.setViewportSize(look.viewport);
      else await page.emulateMedia(look);
      await picture(page, name);
    }
    await page.emulateMedia({ colorScheme: "dark" });
    await page.setViewportSize({ width: 1280, height: 720 });
  });
  assert(other === 1, "it is another process");
  await page.click("#pause");
  await state(page, "driving");

  // A STOP that was taken is over.
  await page.waitForTimeout(1000);
  assert((await status()).mode === "armed", "it is not stopped again");
  // Ten times supervision.hung_after_s: nobody on the tick knows of it.
  assert((await page.textContent("#log")).includes("operator gave no sign of life for 3 s: starting it again"), await page.textContent("#log"));
  await steps.end();

  // One that was not is for the robot that was in view, not for the next.
  process.kill(operator(await status()).pid, "SIGSTOP");
  await page.waitForTimeout(HANGS_MS);
  await page.click("#stop");
  await fault(page, "STOP sent, waiting");
  await ask("down");
  await command("up", "--detach", "--robot", robot, "--listen", new URL(url).host, "--set", "supervision.arm_on_start=true");
  await page.waitForFunction(() => document.getElementById("hint").textContent.includes("launched anew"));
  await page.waitForSelector("#fault", { state: "hidden" });
  await page.waitForTimeout(1000);
  assert((await status()).mode === "armed", "nobody stops the next one");
  forgive(page);
});
