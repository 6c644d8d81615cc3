// Draws "So" with the mouse, drives it, sees it arrive.

import { assert, at, drawn, inBrowser, picture, show, state, until } from "./page.mjs";
import { readFileSync } from "node:fs";

const so = readFileSync(process.env.HILARE_SO, "utf8").trim().split("\n").slice(1).map((line) => line.split(",").map(Number));

await inBrowser(async (page) => {
  const [xs, ys] = [so.map((p) => p[0]), so.map((p) => p[1])];
  await page.click("[data-tool=draw]");
  await show(page, [Math.min(...xs), Math.min(...ys), Math.max(...xs), Math.max(...ys)]);
  for (const [x, y] of so) {
    const [px, py] = await at(page, x, y);
    // A click on a waypoint takes hold of it; with Shift it adds one all the same.
    const scale = await page.evaluate(() => globalThis.hilare.view.scale);
    const near = (await drawn(page)).some(([qx, qy]) => Math.hypot(qx - x, qy - y) * scale < 12);
    if (near) await page.keyboard.down("Shift");
    await page.mouse.click(px, py);
    if (near) await page.keyboard.up("Shift");
  }
  const points = await drawn(page);
  assert(points.length === so.length, `${points.length} waypoints were drawn, ${so.length} wanted`);
  const scale = await page.evaluate(() => globalThis.hilare.view.scale);
  points.forEach(([x, y], i) => {
    const off = Math.hypot(x - so[i][0], y - so[i][1]);
    assert(off * scale <= 1, `waypoint ${i} is ${off} m off`);
  });
  // What it would come to is said before it is driven.
  await page.waitForFunction(() => document.getElementById("predicted").textContent.startsWith("predicted:"));
  await page.click("#run");
  await state(page, "driving");
  await until("on its way", (status) => status.path_state === "tracking" && status.waypoints === so.length);
  await until("half-way", (status) => status.waypoint >= 20);
  await picture(page, "driving");
  // At 40 mm/s it takes a minute.
  await state(page, "arrived", 180_000);
  const { pose } = await until("arrived", (status) => status.path_state === "arrived");
  const [lx, ly] = points[points.length - 1];
  assert(Math.hypot(pose[0] - lx, pose[1] - ly) < 0.03, `it ended at ${pose}, not at ${lx}, ${ly}`);
  assert((await page.textContent("#waypoint")).startsWith(`${so.length - 1} of`), "the last waypoint is shown");
});
