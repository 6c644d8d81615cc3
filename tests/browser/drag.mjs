// Waypoints are moved with the mouse and by keys, removed, brought back; a file goes in and comes out the same.

import { apart, assert, at, command, drawn, inBrowser, ink, patches, picture, show, state, status } from "./page.mjs";
import { mkdtempSync, readFileSync, writeFileSync } from "node:fs";
import { join } from "node:path";

await inBrowser(async (page) => {
  await page.click("[data-tool=draw]");
  await page.locator("#clear").click({ timeout: 1000 }).catch(() => {});
  await show(page, [-0.2, -0.2, 0.8, 0.6]);
  for (const [x, y] of [[0, 0], [0.3, 0], [0.3, 0.3], [0.6, 0.3]]) await page.mouse.click(...(await at(page, x, y)));
  const before = await drawn(page);
  assert(before.length === 4, `${before.length} waypoints`);

  await page.mouse.move(...(await at(page, ...before[2])));
  await page.mouse.down();
  await page.mouse.move(...(await at(page, 0.4, 0.4)), { steps: 8 });
  await page.mouse.up();
  const moved = await drawn(page);
  assert(Math.hypot(moved[2][0] - 0.4, moved[2][1] - 0.4) < 0.005, `dragged to ${moved[2]}`);
  assert(JSON.stringify([...moved.slice(0, 2), moved[3]]) === JSON.stringify([...before.slice(0, 2), before[3]]), "the others stay");

  // One drag is one step back.
  await page.keyboard.press("Control+z");
  assert(JSON.stringify(await drawn(page)) === JSON.stringify(before), "undone");
  await page.keyboard.press("Control+y");
  assert(JSON.stringify(await drawn(page)) === JSON.stringify(moved), "redone");

  await page.mouse.click(...(await at(page, ...moved[1])));
  await page.keyboard.press("ArrowRight");
  await page.keyboard.press("Shift+ArrowUp");
  const nudged = await drawn(page);
  assert(Math.abs(nudged[1][0] - moved[1][0] - 0.01) < 1e-4 && Math.abs(nudged[1][1] - moved[1][1] - 0.001) < 1e-4, `${nudged[1]}`);
  await page.keyboard.press("Delete");
  assert((await drawn(page)).length === 3, "removed");

  // Freehand: a shaky line becomes few waypoints.
  await page.click("#clear");
  await page.click("[data-tool=free]");
  await page.mouse.move(...(await at(page, 0, 0)));
  await page.mouse.down();
  for (let i = 1; i <= 60; i++) {
    const [x, y] = i <= 30 ? [i * 0.02, 0.001 * Math.sin(i)] : [0.6, (i - 30) * 0.015];
    await page.mouse.move(...(await at(page, x, y)));
  }
  await page.mouse.up();
  const free = await drawn(page);
  assert(free.length >= 3 && free.length <= 8, `${free.length} waypoints of a line of 60`);
  assert(free.some(([x, y]) => Math.hypot(x - 0.6, y) < 0.02), `the corner is there: ${free}`);

  const [saved] = await Promise.all([page.waitForEvent("download"), page.click("#export")]);
  const csv = readFileSync(await saved.path(), "utf8");
  await page.click("#clear");
  await page.setInputFiles("#file", { name: "back.csv", mimeType: "text/csv", buffer: Buffer.from(csv) });
  await page.waitForFunction((n) => globalThis.hilare.path.points.length === n, free.length);
  assert(JSON.stringify(await drawn(page)) === JSON.stringify(free), "exported and imported the same");

  for (const [text, said] of [
    ["a,b\n1,2\n", "bad.csv:1: the first line must be x,y"],
    ["x,y\n1,2\n3,zwei\n", 'bad.csv:3: "zwei" is not a number'],
    ["x,y\n1,2,3\n", "bad.csv:2: 3 values, 2 are wanted"],
    ["x,y\n1,2\n", "bad.csv: 1 waypoints; a path needs 2"],
    ["x,y\n1,2\n90000,0\n", "bad.csv:3: beyond 10 km"],
  ]) {
    await page.setInputFiles("#file", { name: "bad.csv", mimeType: "text/csv", buffer: Buffer.from(text) });
    await page.waitForFunction((said) => document.getElementById("hint").textContent.startsWith(said), said);
  }
  assert(JSON.stringify(await drawn(page)) === JSON.stringify(free), "what was refused changes nothing");
  assert((await page.locator("#hint").getAttribute("data-bad")) !== null, "and looks like what it is");
  await page.click("#clear");
  assert((await page.textContent("#hint")) === "", "what was said of a file is not said of what comes after it");

  // A tolerance is a number; what is none is said, and the one before stays.
  await page.fill("#tolerance", "20");
  for (const wrong of ["-5", ""]) {
    await page.fill("#tolerance", wrong);
    await page.locator("#tolerance").blur();
    assert((await page.inputValue("#tolerance")) === "20" && (await page.textContent("#hint")).includes("it stays 20 mm"), await page.textContent("#hint"));
  }

  // What the robot would make of it is what a run of the same path comes to, and is shown where it happens.
  const predicted = () => page.waitForFunction(() => {
    const line = document.getElementById("predicted");
    return globalThis.hilare.picture.prediction && line.ariaBusy !== "true" && line.textContent;
  });
  const draw = async (csv) => {
    await page.setInputFiles("#file", { name: "path.csv", mimeType: "text/csv", buffer: Buffer.from(csv) });
    const points = csv.trim().split("\n").slice(1).map((line) => [...line.split(",").map(Number), 0, 0]);
    await page.waitForFunction((points) => JSON.stringify(globalThis.hilare.path.points) === points, JSON.stringify(points));
  };
  const hairpin = "x,y\n0.2,0.2\n0.4,0.2\n0.2,0.22\n0.2,0.1\n";
  await page.fill("#tolerance", "15");
  await draw(hairpin);
  const said = await (await predicted()).jsonValue();
  const file = join(mkdtempSync(join(process.env.HOME, "path-")), "path.csv");
  writeFileSync(file, hairpin);
  const run = JSON.parse(await command("run", "--path", file, "--start", "0.2,0.2,0", "--clock", "in-process", "--json", "--out", `${file}.run`));
  const most = (run.cross_track_max_m * 1e3).toFixed(1);
  assert(most > 15 && said.includes(`${most} mm at most`) && said.includes(`${run.duration_s.toFixed(1)} s`), `a run: ${most} mm, ${run.duration_s} s; the page: ${said}`);
  const bad = await page.evaluate(() => [...globalThis.hilare.picture.prediction.bad]);
  assert(bad.length >= 1 && bad.some(([i, off]) => i === 1 && off > 0.015), `marked: ${bad}`);
  assert(said.includes(`${bad.length} corner`) && !said.includes("OBSTACLE"), said);
  // The lower side of the triangle, beside the waypoint's square.
  const scale = await page.evaluate(() => globalThis.hilare.view.scale);
  const [[below], red] = [await patches(page, [[0.4 + 8 / scale, 0.2 - 8 / scale]]), await ink(page, "red")];
  assert(below.some((pixel) => apart(pixel, red) < 20), `the mark is ${below.join(" ")}, not ${red}`);
  await page.fill("#tolerance", "200");
  await page.locator("#tolerance").blur();
  await page.waitForFunction(() => globalThis.hilare.picture.prediction?.bad.size === 0);

  // All of it is in sight beside what covers the map: circles, the whole robot.
  await page.click("#fit");
  const hidden = await page.evaluate(() => {
    const { view, picture, path } = globalThis.hilare;
    const { start, radius } = picture.robot;
    const [top, bottom] = [document.getElementById("legend").offsetHeight, view.height - document.getElementById("notes").offsetHeight];
    const discs = [...path.points.map(([x, y]) => [x, y, picture.acceptance]), [start.x, start.y, radius]];
    return discs.map(([x, y, r]) => [...view.toScreen(x, y), r * view.scale]).filter(([px, py, r]) => px - r < 0 || px + r > view.width || py - r < top || py + r > bottom);
  });
  assert(!hidden.length, `out of sight: ${hidden.join("; ")}`);

  // Which waypoint is wrong is said, and what is in another unit.
  await draw("x,y\n0,0\n0.1,0\n0.1,0\n");
  await page.waitForFunction(() => document.getElementById("hint").textContent.startsWith("waypoint 2: the same place"));
  await draw("x,y\n0,0\n300,0\n");
  await page.waitForFunction(() => document.getElementById("predicted").textContent.includes("the path is 300 m long: metres are wanted"));

  // A disc of the platform lies at 0.52, 0.2.
  await draw("x,y\n0.2,0.2\n0.35,0.2\n0.7,0.2\n");
  await page.waitForFunction(() => document.getElementById("predicted").textContent.includes("TOUCHES AN OBSTACLE"));
  const touched = await page.evaluate(() => [...globalThis.hilare.picture.prediction.touched]);
  assert(JSON.stringify(touched) === "[2]", `on the way to waypoint ${touched}`);

  // Run asks before it is driven, also where it is pressed before that is known; Space is a no, and so is Escape.
  const question = () => page.waitForSelector("#ask[open]");
  for (const no of [" ", "Escape"]) {
    await draw(no === " " ? "x,y\n0.2,0.2\n0.36,0.2\n0.7,0.2\n" : "x,y\n0.2,0.2\n0.35,0.2\n0.7,0.2\n");
    await page.keyboard.press("r");
    await question();
    assert((await page.textContent("#ask-text")).includes("obstacle on the way to waypoint 2."), await page.textContent("#ask-text"));
    await page.keyboard.press(no);
    await page.waitForSelector("#ask", { state: "hidden" });
    assert(!(await status()).waypoints && (await page.textContent("#table-title")).includes("not sent yet"), "nothing was sent");
  }
  // A STOP while Run waits to hear what would come of it ends it.
  await draw("x,y\n0.2,0.2\n0.37,0.2\n0.7,0.2\n");
  await page.keyboard.press("r");
  await page.keyboard.press(" ");
  await predicted();
  await page.waitForTimeout(300);
  assert(!(await page.locator("#ask").isVisible()) && (await status()).mode === "disarmed", "it asks no more, and arms nothing");
  await page.keyboard.press("r");
  await question();
  await page.keyboard.press("Tab");
  await page.keyboard.press("Enter");
  await state(page, "driving");
  // What was said stays as long as the path is in force, on a page that is loaded anew as well, and so do the marks.
  const told = "TOUCHES AN OBSTACLE on the way to waypoint 2";
  const still = async (when) => {
    await page.waitForFunction((told) => document.getElementById("in-force").textContent.includes(told), told);
    await show(page, [0.1, 0, 0.9, 0.5]);
    const along = await patches(page, Array.from({ length: 20 }, (_, i) => [0.56 + 0.004 * i, 0.2]));
    assert(along.some((pixels) => pixels.some((pixel) => apart(pixel, red) < 20)), `the mark is red ${when}`);
  };
  await still("while it drives");
  await page.reload();
  await state(page, "driving");
  await still("on a page that was loaded anew");
  await picture(page, "touches");
  await page.keyboard.press(" ");
  await state(page, "stopped");
  // Not of the next one, which asks nothing; wherever the robot stands by now, it stays within so much.
  await page.fill("#tolerance", "500");
  await page.locator("#tolerance").blur();
  await draw("x,y\n0.2,0.2\n0.2,0.15\n");
  await page.keyboard.press("r");
  await state(page, "driving");
  await page.waitForFunction(() => document.getElementById("in-force").textContent === "");
  await page.keyboard.press(" ");
  await state(page, "stopped");
});
