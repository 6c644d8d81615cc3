// STOP by click, Space and Escape: within 100 ticks of the click the steps say so. E-stop is latched until reset.

import { ask, assert, inBrowser, listen, picture, redraw, state, until } from "./page.mjs";

const STOPPED = 4; // Drive::Stop
const DRIVING = 1;

await inBrowser(async (page) => {
  // Without a path there is nothing to be paused or resumed.
  await page.click("#arm");
  await state(page, "ready");
  await page.click("#stop");
  await state(page, "stopped");
  assert(await page.locator("#pause").isDisabled(), "nothing is there to be resumed");

  await redraw(page, [-0.2, -1, 3.2, 1], [[0, 0], [3, 0]]);
  await page.click("#run");
  await state(page, "driving");
  const steps = listen("steps");
  await steps.until("while it drives", (message) => message.drive === DRIVING);
  // When the operator's hand is there; not when the test asks for it.
  await page.evaluate(() => {
    const note = (event) => (globalThis.pressed = performance.timeOrigin + event.timeStamp);
    for (const kind of ["pointerdown", "keydown"]) addEventListener(kind, note, { capture: true });
  });
  const ways = [
    ["a click", () => page.locator("#stop").click()],
    ["Space", () => page.keyboard.press(" ")],
    ["Escape", () => page.keyboard.press("Escape")],
    ["Space with another button in focus", async () => {
      await page.locator("#export").focus();
      await page.keyboard.press(" ");
    }],
    ["Escape in a field", async () => {
      await page.locator("#tolerance").focus();
      await page.keyboard.press("Escape");
    }],
    ["Space in a field", async () => {
      await page.locator("#tolerance").focus();
      await page.keyboard.press(" ");
    }],
    ["Space on the menu of laws", async () => {
      await page.locator("#law").focus();
      await page.keyboard.press(" ");
    }],
    ["Space on a box", async () => {
      await page.locator("#follow").focus();
      await page.keyboard.press(" ");
    }],
  ];
  for (const [way, press] of ways) {
    // A message is some milliseconds on its way from the tick to here: so the tick of the press is rather too early.
    const before = steps.messages.slice(-300);
    await press();
    const pressed = await page.evaluate(() => globalThis.pressed);
    const clicked = Math.ceil(pressed - Math.min(...before.map(({ at, tick }) => at - tick)));
    const stopped = await steps.until(`that it stops after ${way}`, (message) => message.tick > clicked && message.drive === STOPPED);
    const ticks = stopped.tick - clicked;
    console.log(`${way}: stopped ${ticks} ticks later`);
    assert(ticks <= 100, `${way}: the steps say so ${ticks} ticks later`);
    await state(page, "stopped");
    await until("at rest", (status) => status.speed_mps === 0);
    await page.waitForFunction(() => document.getElementById("hint").textContent === "stopped; Arm lets it go on");
    if (way === "a click") await picture(page, "stopped");
    await page.click("#pause");
    await state(page, "driving");
  }
  assert(!(await page.locator("#follow").isChecked()), "the space bar has ticked no box");
  await page.locator("#follow").press("Enter");
  assert(await page.locator("#follow").isChecked(), "Enter does");
  await page.click("#estop");
  await state(page, "estop");
  assert(await page.locator("#run").isDisabled() && await page.locator("#arm").isDisabled(), "nothing arms it now");
  await page.click("#reset");
  // The question is in nobody's way: STOP can be clicked, and is a no.
  await page.click("#stop");
  await page.waitForSelector("#ask", { state: "hidden" });
  assert((await ask("status")).includes("e-stop"), "not released");
  await page.click("#reset");
  await page.click("#ask-yes");
  await state(page, "disarmed");
  await steps.end();
  assert((await ask("status")).includes("disarmed"), "it stays disarmed");
});
