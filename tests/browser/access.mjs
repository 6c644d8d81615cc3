// Nothing serious in the eyes of axe, dark and light, at a desk and on a phone; colours that colour-blind eyes tell
// apart; everything is reached by keys, and by a finger.

import { createRequire } from "node:module";
import { readFileSync } from "node:fs";
import { assert, at, drawn, inBrowser, ink, picture, redraw, state } from "./page.mjs";
import { unlike } from "./eyes.mjs";

const axe = readFileSync(createRequire(import.meta.url).resolve("axe-core/axe.min.js"), "utf8");
/** Sizes in which nothing may be cut off at the right, and how much of the map is to be seen at least, px. */
const sizes = [[390, 844, 400], [844, 390, 180], [1280, 720, 350]];
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
    const lines = Object.fromEntries(await Promise.all(["blue", "orange", "green", "purple"].map(async (name) => [name, await ink(page, name)])));
    unlike(lines, await ink(page, "floor")).forEach((trouble) => assert(!trouble, `${name}: ${trouble}`));
    // STOP is in sight wherever one has scrolled to.
    await page.evaluate(() => scrollTo(0, document.body.scrollHeight));
    const box = await page.locator("#stop").boundingBox();
    const height = options.viewport?.height ?? 720;
    assert(box.y >= 0 && box.y + box.height <= height, `${name}: STOP is at ${JSON.stringify(box)}`);
  }, options);
}

await inBrowser(async (page) => {
  for (const [width, height, map] of sizes) {
    await page.setViewportSize({ width, height });
    const found = await page.evaluate(() => {
      const box = document.getElementById("map").getBoundingClientRect();
      return { wide: document.documentElement.scrollWidth, seen: Math.min(innerHeight, box.bottom) - box.top };
    });
    assert(found.wide <= width && found.seen >= map, `${width} x ${height}: ${JSON.stringify(found)}`);
  }
  await page.setViewportSize({ width: 1280, height: 720 });
  const seen = new Set();
  for (let i = 0; i < 60; i++) {
    await page.keyboard.press("Tab");
    seen.add(await page.evaluate(() => document.activeElement.id || document.activeElement.dataset.tool));
  }
  for (const id of ["stop", "arm", "estop", "law", "draw", "import", "map", "log-lines"]) {
    assert(seen.has(id), `${id} is not reached by Tab: ${[...seen]}`);
  }
  // A path by keys alone: drawn, corrected, driven, stopped.
  await page.evaluate(() => globalThis.hilare.path.replace([]));
  await page.locator("#map").focus();
  await page.keyboard.press("Enter");
  const [first] = await drawn(page);
  await page.keyboard.press("ArrowRight");
  const [moved] = await drawn(page);
  assert(Math.abs(moved[0] - first[0] - 0.01) < 1e-6, "an arrow key moves it by a centimetre");
  await page.keyboard.press("Control+z");
  await page.keyboard.press("Delete");
  assert((await drawn(page)).length === 0, "Delete removes it");
  await page.keyboard.press("Enter");
  await page.keyboard.press("1");
  for (let i = 0; i < 3; i++) await page.keyboard.press("ArrowRight");
  await page.keyboard.press("2");
  await page.keyboard.press("Enter");
  const [from, to] = await drawn(page);
  assert(to[0] > from[0] && to[1] === from[1], `${from} to ${to}`);
  await page.keyboard.press("b");
  assert((await page.evaluate(() => globalThis.hilare.path.selected)) === 0, "B selects the one before");
  await page.keyboard.press("r");
  // There are obstacles about.
  await page.waitForSelector("#ask[open], body[data-state=driving]");
  if (await page.locator("#ask").isVisible()) {
    await page.keyboard.press("Tab");
    await page.keyboard.press("Enter");
  }
  await state(page, "driving");
  await page.keyboard.press(" ");
  await state(page, "stopped");
});

// A tap sets a waypoint, one finger drags it or moves the map, two zoom.
await inBrowser(async (page) => {
  await redraw(page, [-0.5, -0.5, 0.5, 0.5], []);
  const session = await page.context().newCDPSession(page);
  const touch = (type, ...points) => session.send("Input.dispatchTouchEvent", { type, touchPoints: points.map(([x, y], id) => ({ x, y, id })) });
  const drag = async ([x0, y0], [x1, y1]) => {
    await touch("touchStart", [x0, y0]);
    for (let i = 1; i <= 10; i++) await touch("touchMove", [x0 + ((x1 - x0) * i) / 10, y0 + ((y1 - y0) * i) / 10]);
    await touch("touchEnd");
  };
  const view = () => page.evaluate(() => (({ x, y, scale }) => ({ x, y, scale }))(globalThis.hilare.view));
  await page.touchscreen.tap(...(await at(page, 0.1, 0.1)));
  const [tapped] = await drawn(page);
  assert(Math.hypot(tapped[0] - 0.1, tapped[1] - 0.1) < 0.01, `a tap sets a waypoint: ${tapped}`);

  await drag(await at(page, ...tapped), await at(page, -0.2, 0.25));
  const dragged = await drawn(page);
  assert(dragged.length === 1 && Math.hypot(dragged[0][0] + 0.2, dragged[0][1] - 0.25) < 0.02, `a finger drags it to ${dragged}`);

  const before = await view();
  await drag(await at(page, 0.2, -0.2), await at(page, 0.3, -0.2));
  const panned = await view();
  assert(Math.abs(before.x - panned.x - 0.1) < 0.02 && (await drawn(page)).length === 1, `a finger beside it moves the map: ${before.x} to ${panned.x}`);

  const [x, y] = await at(page, 0, 0);
  await touch("touchStart", [x - 30, y], [x + 30, y]);
  for (let half = 35; half <= 90; half += 5) await touch("touchMove", [x - half, y], [x + half, y]);
  await touch("touchEnd");
  const zoomed = await view();
  assert(zoomed.scale > 2 * panned.scale && (await drawn(page)).length === 1, `two fingers apart zoom in: ${panned.scale} to ${zoomed.scale}`);
  const [mx, my] = await at(page, 0, 0);
  assert(Math.hypot(mx - x, my - y) < 20, `and what is between them stays: ${mx - x}, ${my - y} px off`);
}, looks[2][1]);
