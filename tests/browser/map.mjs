// A map of cells, turned against the world: it is drawn where its cells are, the roadmap on request, and a goal that is
// clicked is planned to around it and driven to. Where a cell is, is computed here from the map's own file.

import { apart, ask, assert, at, colours, drawn, inBrowser, ink, picture, redraw, state, until } from "./page.mjs";
import { readFileSync } from "node:fs";

const yaml = readFileSync(process.env.HILARE_MAP, "utf8");
const number = (key) => Number(yaml.match(new RegExp(`${key}: *([-\\d.]+)`))[1]);
const [ox, oy, yaw] = yaml.match(/origin: *\[(.*)\]/)[1].split(",").map(Number);
const cell_m = number("resolution");
const [, width, height, , ...shades] = readFileSync(process.env.HILARE_MAP.replace(".yaml", ".pgm"), "utf8").trim().split(/\s+/).map(Number);

/** World point of u cells to the right and v up from the lower left corner. */
const world = (u, v) => [ox + cell_m * (u * Math.cos(yaw) - v * Math.sin(yaw)), oy + cell_m * (u * Math.sin(yaw) + v * Math.cos(yaw))];
/** Shade of the cell at a world point. */
const shade = ([x, y]) => {
  const [dx, dy] = [x - ox, y - oy];
  const [u, v] = [dx * Math.cos(yaw) + dy * Math.sin(yaw), dy * Math.cos(yaw) - dx * Math.sin(yaw)].map((m) => Math.floor(m / cell_m));
  return shades[(height - 1 - v) * width + u];
};
const OCCUPIED = 0;
const FREE = 254;
const blocked = ([x0, y0], [x1, y1]) => Array.from({ length: 51 }, (_, i) => [x0 + ((x1 - x0) * i) / 50, y0 + ((y1 - y0) * i) / 50]).some((point) => shade(point) === OCCUPIED);
const [start, goal] = [world(4.5, 4.5), world(8.5, 5.5)];

await inBrowser(async (page) => {
  await page.waitForFunction(() => globalThis.hilare.picture.map?.image.complete);
  // The grid, the robot and the map's edge are not what is looked at.
  const cells = Array.from({ length: width * height }, (_, i) => world((i % width) + 0.6, Math.floor(i / width) + 0.6)).filter(([x, y]) => Math.hypot(x - start[0], y - start[1]) > 0.08);
  const seen = await colours(page, cells);
  const of = (kind) => seen.filter((_, i) => shade(cells[i]) === kind);
  const [wall] = of(OCCUPIED);
  assert(of(OCCUPIED).length >= 9 && of(OCCUPIED).every((colour) => apart(colour, wall) < 12), `walls: ${of(OCCUPIED).join(" ")}`);
  seen.forEach((colour, i) => assert(shade(cells[i]) === OCCUPIED || apart(colour, wall) > 30, `a wall is shown at ${cells[i]}, where is none`));
  const [floor] = of(FREE);
  const unknown = seen.filter((_, i) => ![OCCUPIED, FREE].includes(shade(cells[i])));
  assert(unknown.length === 1 && apart(unknown[0], floor) > 8, `what is unknown is ${unknown}, the floor ${floor}`);
  await picture(page, "map");

  const all = () => page.evaluate(() => {
    const { picture } = globalThis.hilare;
    const { width, height } = picture.canvas;
    picture.draw();
    const copy = new OffscreenCanvas(width, height).getContext("2d", { willReadFrequently: true });
    copy.drawImage(picture.canvas, 0, 0);
    return [...copy.getImageData(0, 0, width, height).data].filter((_, i) => i % 4 === 0);
  });
  const changed = (a, b) => a.filter((value, i) => value !== b[i]).length;
  const without = await all();
  await page.locator("#roadmap").press("Enter");
  await page.waitForFunction(() => globalThis.hilare.picture.show.roadmap);
  const edges = await page.evaluate(() => globalThis.hilare.picture.roadmap);
  assert(edges.length > 20 && edges.every(([x0, y0, x1, y1]) => !blocked([x0, y0], [x1, y1])), `${edges.length} edges, none through a wall`);
  const shown = changed(without, await all());
  assert(shown > 1000, `${shown} pixels of the roadmap`);
  await picture(page, "roadmap");
  await page.locator("#roadmap").uncheck();
  assert(changed(without, await all()) === 0, "it is hidden again");

  // A goal takes the place of what was drawn; undo brings that back.
  await redraw(page, [start[0] - 0.1, start[1] - 0.1, start[0] + 0.5, start[1] + 0.2], [start, world(4.5, 5.5)]);
  const sketch = JSON.stringify(await drawn(page));
  await page.click("[data-tool=goal]");
  await page.mouse.click(...(await at(page, ...goal)));
  await page.waitForFunction(() => globalThis.hilare.picture.active);
  await page.waitForFunction(() => document.getElementById("hint").textContent.endsWith("Undo brings back what was drawn"));
  await page.click("#undo");
  assert(JSON.stringify(await drawn(page)) === sketch, "what was drawn is back");
  await page.click("[data-tool=goal]");
  await page.mouse.click(...(await at(page, ...goal)));
  await page.waitForFunction(() => !globalThis.hilare.path.unsent);
  const way = await page.evaluate(() => globalThis.hilare.picture.active.waypoints);
  const last = way[way.length - 1];
  assert(blocked(start, goal) && way.slice(1).every((point, i) => !blocked(way[i], point)), `around the wall: ${way.join(" ")}`);
  assert(Math.hypot(last[0] - goal[0], last[1] - goal[1]) < cell_m / 10, `it ends at ${last}`);
  const green = await ink(page, "green");
  const [corner] = await colours(page, [way[1]]);
  assert(apart(corner, green) < 40, `the way is ${corner}, not ${green}`);
  await picture(page, "goal");
  await page.keyboard.press("r");
  await state(page, "driving");
  await state(page, "arrived", 120_000);
  const { pose } = await until("arrived", (status) => status.path_state === "arrived");
  assert(Math.hypot(pose[0] - goal[0], pose[1] - goal[1]) < 0.03, `it ended at ${pose}`);
  // Into a wall there is no way, and that is said.
  await page.mouse.click(...(await at(page, ...world(6.5, 2.5))));
  await page.waitForFunction(() => document.getElementById("hint").textContent.includes("goal"));
  assert((await page.evaluate(() => globalThis.hilare.picture.goal)) === null, "no goal is left");
  // What was refused does not look like what was done.
  assert((await page.locator("#hint").getAttribute("data-bad")) !== null, "a refusal is set off");
  // The log says of each who wanted it, and what became of it.
  const line = (text) => page.waitForFunction((text) => [...document.querySelectorAll("#log li")].some((one) => one.textContent.includes(text)), text);
  await line(", by the page: refused: ");
  await line("armed, by the page");
  await ask("goal", ...world(4.5, 5.5).map((v) => v.toFixed(3)));
  await line(`, by the command line: ${world(4.5, 5.5).map((v) => v.toFixed(3)).join(", ")} m`);
  await line(", by the command line: accepted, ");
  // A heading is shown as everywhere, whatever the robot has turned.
  const headings = await page.evaluate(async () => {
    const { degrees } = await import("./state.js");
    return [4.735, Math.PI, -Math.PI, 0.5 - 6 * Math.PI, -0.0001].map(degrees);
  });
  assert(JSON.stringify(headings) === JSON.stringify(["-88.7", "180.0", "180.0", "28.6", "0.0"]), `headings: ${headings}`);
});
