// A page in Chromium, and the robot behind it as the command line shows it.

import { spawn, execFile } from "node:child_process";
import { createInterface } from "node:readline";
import { promisify } from "node:util";
import { chromium } from "playwright-core";

const env = (name) => {
  const value = process.env[name];
  if (!value) throw new Error(`${name} is not set; these tests are run by cargo test --test page`);
  return value;
};

export const url = env("HILARE_PAGE");
const hilare = env("HILARE_BIN");
export const robot = env("HILARE_TEST_ROBOT");
/** Where pictures go, if they are wanted. */
export const pictures = process.env.HILARE_PICTURES;
/** Patience with a busy machine. */
export const PATIENCE_MS = 30_000;

/** Runs `test(page, context)` in a browser of its own; anything on the console that is no mere log is a failure. */
export async function inBrowser(test, options = {}) {
  const browser = await chromium.launch({ executablePath: env("HILARE_CHROMIUM"), args: ["--no-sandbox", "--disable-dev-shm-usage"] });
  try {
    const context = await browser.newContext({ viewport: { width: 1280, height: 720 }, colorScheme: "dark", ...options });
    context.setDefaultTimeout(PATIENCE_MS);
    const page = await open(context);
    await test(page, context);
    await sound(page);
  } finally {
    await browser.close();
  }
}

/** One more page; its troubles are kept in `page.troubles`. */
export async function open(context) {
  const page = await context.newPage();
  page.troubles = [];
  page.on("console", (message) => ["error", "warning"].includes(message.type()) && page.troubles.push(message.text()));
  page.on("pageerror", (error) => page.troubles.push(String(error)));
  page.on("requestfailed", (request) => page.troubles.push(`${request.url()}: ${request.failure()?.errorText}`));
  await page.goto(url);
  await page.waitForSelector("body[data-link=open]");
  await page.waitForFunction(() => document.getElementById("robot").textContent !== "");
  return page;
}

/** What the browser says of a connection that was meant to be lost is no trouble. */
export function forgive(page) {
  page.troubles = page.troubles.filter((trouble) => !/ERR_CONNECTION|ERR_FAILED|ERR_ABORTED|WebSocket connection/.test(trouble));
}

export async function sound(page) {
  if (page.troubles.length) throw new Error(`on the console: ${page.troubles.join("; ")}`);
}

export async function state(page, wanted, patience = PATIENCE_MS) {
  await page.waitForSelector(`body[data-state=${wanted}]`, { timeout: patience });
}

/** A hilare command; its standard output. */
export async function command(...args) {
  const { stdout } = await promisify(execFile)(hilare, args);
  return stdout;
}

/** A hilare command about the robot. */
export const ask = (...args) => command(...args, "--robot", robot);

export async function status() {
  // A robot with a fault is a status, too, if not a good one.
  const said = await ask("status", "--json").catch((error) => (error.code === 1 && error.stdout ? error.stdout : Promise.reject(error)));
  return JSON.parse(said);
}

/** Waits until the robot's own status is as `wanted`. */
export async function until(what, wanted) {
  const deadline = Date.now() + PATIENCE_MS;
  for (;;) {
    const now = await status();
    if (wanted(now)) return now;
    if (Date.now() > deadline) throw new Error(`not ${what}: ${JSON.stringify(now)}`);
    await new Promise((done) => setTimeout(done, 50));
  }
}

/** The messages of a wire as they come, until `end()`. */
export function listen(topic) {
  const child = spawn(hilare, ["topic", "echo", topic, "--all", "--json", "--robot", robot], { stdio: ["ignore", "pipe", "inherit"] });
  const messages = [];
  createInterface({ input: child.stdout }).on("line", (line) => messages.push({ at: Date.now(), ...JSON.parse(line) }));
  const ended = new Promise((done) => child.on("close", done));
  return {
    messages,
    async until(what, wanted) {
      const deadline = Date.now() + PATIENCE_MS;
      for (;;) {
        const found = messages.find(wanted);
        if (found) return found;
        if (Date.now() > deadline) throw new Error(`${topic}: no message ${what}`);
        await new Promise((done) => setTimeout(done, 10));
      }
    },
    end() {
      child.kill("SIGINT");
      return ended;
    },
  };
}

/** Where a world point is in the window. */
export async function at(page, x, y) {
  const box = await page.locator("#map").boundingBox();
  const [px, py] = await page.evaluate(([x, y]) => globalThis.hilare.view.toScreen(x, y), [x, y]);
  return [box.x + px, box.y + py];
}

/** What the map shows at world points: the colours [r, g, b] of 5 x 5 pixels, by brightness. */
export const patches = (page, points) =>
  page.evaluate((points) => {
    const { view, picture } = globalThis.hilare;
    picture.draw();
    const copy = new OffscreenCanvas(picture.canvas.width, picture.canvas.height).getContext("2d", { willReadFrequently: true });
    copy.drawImage(picture.canvas, 0, 0);
    return points.map(([x, y]) => {
      const [px, py] = view.toScreen(x, y).map((v) => Math.round(v * devicePixelRatio) - 2);
      const { data } = copy.getImageData(px, py, 5, 5);
      const pixels = Array.from({ length: 25 }, (_, i) => [...data.slice(4 * i, 4 * i + 3)]);
      const brightness = ([r, g, b]) => r + g + b;
      return pixels.sort((a, b) => brightness(a) - brightness(b));
    });
  }, points);

/** The one in the middle of each. */
export const colours = async (page, points) => (await patches(page, points)).map((pixels) => pixels[12]);

/** A colour of the page by its name, as [r, g, b]. */
export const ink = (page, name) => page.evaluate((name) => globalThis.hilare.picture.colour(name).match(/\w\w/g).map((part) => parseInt(part, 16)), name);

export const apart = (a, b) => Math.hypot(...a.map((value, i) => value - b[i]));

/** The path as the page has drawn it. */
export const drawn = (page) => page.evaluate(() => globalThis.hilare.path.points.map(([x, y]) => [x, y]));

/** Draws another path, click by click, with this part of the world in view. */
export async function redraw(page, box, points) {
  await page.evaluate(() => globalThis.hilare.path.replace([]));
  await page.click("[data-tool=draw]");
  await show(page, box);
  for (const [x, y] of points) await page.mouse.click(...(await at(page, x, y)));
}

/** Shows this part of the world: x and y from, x and y to. */
export const show = (page, box) => page.evaluate((box) => globalThis.hilare.view.fit(box), box);

export async function picture(page, name) {
  if (pictures) await page.screenshot({ path: `${pictures}/${name}.png` });
}

export function assert(truth, what) {
  if (!truth) throw new Error(what);
}
