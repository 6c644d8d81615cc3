// A robot that is open to other machines: who has no token, a wrong one or that of yesterday is told so in the
// server's own words, and what to do.

import { ask, assert, command, forgive, inBrowser, picture, robot, state, status, url } from "./page.mjs";

const WHY = "the token is wanted: open the address that hilare status shows";
const { origin, port } = new URL(url);

const refused = async (page) => {
  await page.waitForFunction(() => document.getElementById("state-text").textContent === "NOT ALLOWED");
  await page.waitForFunction((why) => document.getElementById("fault").checkVisibility() && document.getElementById("fault").textContent.includes(why), WHY);
};

await inBrowser(async (page, context) => {
  await state(page, "disarmed");
  for (const query of ["/", "/?token=0123456789abcdef0123456789abcdef"]) {
    const stranger = await context.newPage();
    await stranger.goto(origin + query);
    await refused(stranger);
    await stranger.click("#stop");
    await stranger.waitForFunction((why) => document.getElementById("fault").textContent.startsWith(`STOP HAS NOT REACHED THE ROBOT: ${why}`), WHY);
    await stranger.close();
  }

  // The next robot has another token.
  await ask("down");
  await page.waitForFunction(() => document.getElementById("state-text").textContent === "TAKEN DOWN");
  await command("up", "--detach", "--robot", robot, "--listen", `0.0.0.0:${port}`);
  await refused(page);
  await picture(page, "refused");
  await page.emulateMedia({ colorScheme: "light" });
  await picture(page, "refused-light");
  await page.setViewportSize({ width: 390, height: 844 });
  await picture(page, "refused-phone");
  assert((await page.textContent("#link")) === "refused", await page.textContent("#link"));

  await page.goto(origin + new URL((await status()).page).search);
  await page.waitForSelector("body[data-link=open]");
  await state(page, "disarmed");
  forgive(page);
  page.troubles = page.troubles.filter((trouble) => !trouble.includes("401 (Unauthorized)"));
});
