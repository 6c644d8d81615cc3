// Another law in charge in mid-drive, by mouse and by keys; the page reloaded in mid-drive; two pages at once.

import { assert, at, drawn, inBrowser, open, redraw, sound, state, until } from "./page.mjs";

await inBrowser(async (page, context) => {
  await redraw(page, [-0.2, -0.5, 2.2, 0.5], [[0, 0], [2, 0.1]]);
  await page.click("#run");
  await state(page, "driving");
  const before = await until("driving", (status) => status.speed_mps > 0.01);
  const path = await drawn(page);

  await page.selectOption("#law", "qp");
  const swapped = await until("with another law", (status) => status.processes.some((p) => p.authority && p.law === "qp"));
  assert(swapped.swaps === before.swaps + 1 && swapped.cycles_without_command === before.cycles_without_command, JSON.stringify(swapped));
  await state(page, "driving");

  // Keys go through the menu, and nothing but Enter puts one in charge.
  await page.waitForSelector("#law:enabled");
  await page.locator("#law").focus();
  await page.keyboard.press("Home");
  const chosen = await page.inputValue("#law");
  await page.waitForFunction((law) => document.getElementById("hint").textContent === `Enter puts ${law} in charge`, chosen);
  assert(chosen !== "qp" && (await until("driving", (status) => status.drive === "driving")).swaps === swapped.swaps, "no law on the way drives");
  await page.keyboard.press("Enter");
  await until("with the law that was chosen", (status) => status.processes.some((p) => p.authority && p.law === chosen));
  await state(page, "driving");

  const began = await page.evaluate(() => globalThis.hilare.plots[0].data[0][0]);
  const trail = await page.evaluate(() => globalThis.hilare.picture.trails.estimate.length);
  await page.reload();
  await page.waitForSelector("body[data-link=open]");
  await state(page, "driving");
  assert((await page.inputValue("#law")) === chosen, "the law in charge is shown");
  const kept = await page.evaluate(() => globalThis.hilare.picture.trails.estimate.length);
  assert(kept >= 0.9 * trail, `of ${trail} points of the trail ${kept} are left`);
  assert(JSON.stringify(await drawn(page)) === JSON.stringify(path), "the path is kept");
  assert(await page.locator("#log li").count() > 0, "the log is kept");
  const first = await page.evaluate(() => globalThis.hilare.plots[0].data[0][0]);
  assert(Math.abs(first - began) < 1, `plots begin at ${first} s, not at ${began} s`);
  // What was drawn and not sent comes back as well.
  await page.mouse.click(...(await at(page, 1, 0.4)));
  const more = await drawn(page);
  assert(more.length === path.length + 1, "one more waypoint");
  await page.reload();
  await state(page, "driving");
  assert(JSON.stringify(await drawn(page)) === JSON.stringify(more), "what was drawn is kept");
  assert((await page.textContent("#table-title")).includes("not sent yet"), "and is not sent by that");

  // Axes can be read: three labels at least, which reach from end to end, whatever the values.
  for (const plot of [0, 1]) {
    const { labels, min, max } = await page.evaluate((i) => {
      const { labels, plot } = globalThis.hilare.plots[i];
      return { labels, min: plot.scales.y.min, max: plot.scales.y.max };
    }, plot);
    assert(labels.length >= 3 && labels[0] === min && labels.at(-1) === max && labels.includes(0), `plot ${plot}: ${labels} from ${min} to ${max}`);
  }
  const worst = await page.evaluate(async () => {
    const { labels } = await import("./plots.js");
    const values = [0, 0.02, 0.3, 0.5, 1, 3, 26.8, 40, 41.3, 300, 1234.5];
    const pairs = values.flatMap((low) => values.map((high) => [-low, high]));
    return pairs.find(([low, high]) => {
      const found = labels(low, high);
      const reaches = found[0] <= low + 1e-3 && found.at(-1) >= high - 1e-3 && found.at(-1) - found[0] <= 3 * Math.max(1, high - low);
      return !(found.length >= 3 && found.length <= 4 && found.includes(0) && reaches);
    });
  });
  assert(!worst, `labels of ${worst}`);

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
