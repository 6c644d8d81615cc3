// A connection that falls silent, then one that is cut, in mid-drive: it is shown, STOP goes another way, and what
// cannot be sent is said.

import { assert, drawn, forgive, inBrowser, redraw, state, status, until } from "./page.mjs";

await inBrowser(async (page) => {
  let mute = false;
  await page.routeWebSocket(/\/ws/, (socket) => {
    const server = socket.connectToServer();
    server.onMessage((message) => mute || socket.send(message));
    socket.onMessage((message) => mute || server.send(message));
  });
  await page.reload();
  await page.waitForSelector("body[data-link=open]");
  await redraw(page, [-0.2, -1, 3.2, 1], [[0.5, 0], [2.8, 0.2]]);
  await page.click("#run");
  await state(page, "driving");

  // Silent: first no news, then no connection, and the robot drives on.
  mute = true;
  await page.waitForSelector("body[data-link=stale]");
  assert((await page.textContent("#state-text")) === "NO NEWS" && (await page.locator("#fault").isVisible()), "it is told that nothing is heard");
  await page.waitForSelector("body[data-link=lost]");
  await page.waitForFunction(() => document.getElementById("state-text").textContent === "NO CONNECTION" && document.getElementById("arm").disabled);
  await until("driving", ({ drive }) => drive === "driving");
  // STOP goes another way than the socket that is silent.
  await page.keyboard.press(" ");
  await until("stopped", ({ mode }) => mode === "stop");
  await page.waitForFunction(() => document.getElementById("hint").textContent.startsWith("stopping"));
  mute = false;
  await page.waitForSelector("body[data-link=open]");
  await state(page, "stopped");

  // Nothing gets through at all: that is said, and stays.
  mute = true;
  await page.route("**/api/**", (route) => route.abort());
  await page.click("#stop");
  await page.waitForFunction(() => document.getElementById("fault").textContent.startsWith("STOP HAS NOT REACHED THE ROBOT"));
  assert(await page.locator("#arm").isDisabled(), "nothing is armed before the STOP has arrived");
  await page.unroute("**/api/**");
  mute = false;
  await page.waitForSelector("body[data-link=open]");
  await page.waitForSelector("#fault", { state: "hidden" });

  // The page's process is killed: the robot does not care, and the page finds the next one.
  await page.click("#pause");
  await state(page, "driving");
  const path = await drawn(page);
  const operator = ({ processes }) => processes.find(({ name }) => name === "operator");
  process.kill(operator(await status()).pid, "SIGKILL");
  await page.waitForSelector("body:not([data-link=open])");
  await until("with another page", (now) => operator(now)?.restarts === 1 && now.drive === "driving");
  await page.waitForSelector("body[data-link=open]");
  await state(page, "driving");
  // The new process says the path when it has asked for it.
  const kept = JSON.stringify(path);
  await page.waitForFunction((kept) => JSON.stringify(globalThis.hilare.path.points.map(([x, y]) => [x, y])) === kept, kept);
  await page.click("#stop");
  await state(page, "stopped");
  forgive(page);
});
