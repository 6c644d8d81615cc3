// Another law in charge in mid-drive; the page reloaded in mid-drive; two pages at once.

import { assert, at, drawn, inBrowser, open, show, sound, state, until } from "./page.mjs";

await inBrowser(async (page, context) => {
  await page.click("[data-tool=draw]");
  await page.locator("#clear").click({ timeout: 1000 }).catch(() => {});
  await show(page, [-0.2, -0.5, 2.2, 0.5]);
  await page.mouse.click(...(await at(page, 0, 0)));
  await page.mouse.click(...(await at(page, 2, 0.1)));
  await page.click("#run");
  await state(page, "driving");
  const before = await until("driving", (status) => status.speed_mps > 0.01);
  const path = await drawn(page);

  await page.selectOption("#law", "qp");
  const swapped = await until("with another law", (status) => status.processes.some((p) => p.authority && p.law === "qp"));
  assert(swapped.swaps === before.swaps + 1 && swapped.cycles_without_command === before.cycles_without_command, JSON.stringify(swapped));
  await state(page, "driving");

  const trail = await page.evaluate(() => globalThis.hilare.picture.trails.estimate.length);
  await page.reload();
  await page.waitForSelector("body[data-link=open]");
  await state(page, "driving");
  assert((await page.inputValue("#law")) === "qp", "the law in charge is shown");
  const kept = await page.evaluate(() => globalThis.hilare.picture.trails.estimate.length);
  assert(kept >= 0.9 * trail, `of ${trail} points of the trail ${kept} are left`);
  assert(JSON.stringify(await drawn(page)) === JSON.stringify(path), "the path is kept");
  assert(await page.locator("#log li").count() > 0, "the log is kept");

  const second = await open(context);
  await state(second, "driving");
  await second.click("#stop");
  await state(page, "stopped");
  await page.click("#pause");
  await state(second, "driving");
  await second.close();
  await sound(second);
  // Losing a page does nothing to the robot.
  const after = await until("still driving", (status) => status.drive === "driving");
  assert(after.tick > swapped.tick, "time goes on");
});
