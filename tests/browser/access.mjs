// Nothing serious in the eyes of axe, dark and light, at a desk and on a phone; everything is reached by keys.

import { createRequire } from "node:module";
import { readFileSync } from "node:fs";
import { assert, at, drawn, inBrowser, picture, show } from "./page.mjs";

const axe = readFileSync(createRequire(import.meta.url).resolve("axe-core/axe.min.js"), "utf8");
const looks = [
  ["idle", {}],
  ["light", { colorScheme: "light" }],
  ["phone", { viewport: { width: 390, height: 844 }, isMobile: true, hasTouch: true, deviceScaleFactor: 2 }],
];
for (const [name, options] of looks) {
  await inBrowser(async (page) => {
    await page.waitForTimeout(500);
    await picture(page, name);
    await page.locator("#table-box summary").click();
    await page.evaluate(axe);
    const { violations } = await page.evaluate(() => globalThis.axe.run());
    const bad = violations.filter(({ impact }) => ["serious", "critical"].includes(impact));
    assert(!bad.length, `${name}: ${JSON.stringify(bad.map(({ id, nodes }) => [id, nodes.map((node) => node.html)]))}`);
    // STOP is in sight wherever one has scrolled to.
    await page.evaluate(() => scrollTo(0, document.body.scrollHeight));
    const box = await page.locator("#stop").boundingBox();
    const height = options.viewport?.height ?? 720;
    assert(box.y >= 0 && box.y + box.height <= height, `${name}: STOP is at ${JSON.stringify(box)}`);
  }, options);
}

await inBrowser(async (page) => {
  const seen = new Set();
  for (let i = 0; i < 60; i++) {
    await page.keyboard.press("Tab");
    seen.add(await page.evaluate(() => document.activeElement.id || document.activeElement.dataset.tool));
  }
  for (const id of ["stop", "arm", "estop", "law", "draw", "import", "map", "log-lines"]) {
    assert(seen.has(id), `${id} is not reached by Tab: ${[...seen]}`);
  }
  // A path by keys alone.
  await page.locator("#map").focus();
  await page.keyboard.press("Enter");
  const first = await drawn(page);
  await page.keyboard.press("ArrowRight");
  const [last] = (await drawn(page)).slice(-1);
  assert(Math.abs(last[0] - first[first.length - 1][0] - 0.01) < 1e-6, "an arrow key moves it by a centimetre");
});

// Two fingers zoom, one finger sets a waypoint.
await inBrowser(async (page) => {
  await page.click("[data-tool=draw]");
  const box = await page.locator("#map").boundingBox();
  const count = (await drawn(page)).length;
  await page.touchscreen.tap(box.x + box.width / 3, box.y + box.height / 3);
  assert((await drawn(page)).length === count + 1, "a tap sets a waypoint");
  const scale = () => page.evaluate(() => globalThis.hilare.view.scale);
  const before = await scale();
  const session = await page.context().newCDPSession(page);
  const [x, y] = [box.x + box.width / 2, box.y + box.height / 2];
  const fingers = (apart) => [{ x: x - apart, y, id: 1 }, { x: x + apart, y, id: 2 }];
  await session.send("Input.dispatchTouchEvent", { type: "touchStart", touchPoints: fingers(30) });
  for (let apart = 35; apart <= 90; apart += 5) await session.send("Input.dispatchTouchEvent", { type: "touchMove", touchPoints: fingers(apart) });
  await session.send("Input.dispatchTouchEvent", { type: "touchEnd", touchPoints: [] });
  assert((await scale()) > 2 * before, `two fingers apart zoom in: ${before} -> ${await scale()}`);
  assert((await drawn(page)).length === count + 1, "and set no waypoint");
  await show(page, [-1, -1, 1, 1]);
  await at(page, 0, 0);
}, looks[2][1]);
