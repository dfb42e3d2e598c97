// Opens a page of one file from the disk, without a network, turns what it shows, and tells as JSON what happened. Python's tests run it.
//   node open_page.mjs FILE
import { createHash } from "node:crypto";
import { pathToFileURL } from "node:url";
import { chromium } from "playwright-core";

const browser = await chromium.launch({ executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium", args: ["--no-sandbox"] });
const context = await browser.newContext({ viewport: { width: 200, height: 160 }, offline: true });
const page = await context.newPage();
const faults = [];
const requests = [];
page.on("pageerror", (error) => faults.push(String(error)));
page.on("request", (request) => requests.push(request.url().slice(0, 60)));
await page.goto(pathToFileURL(process.argv[2]).href);
await page.waitForFunction(() => document.documentElement.dataset.state !== undefined, null, { timeout: 60_000 });
const shown = async () => createHash("sha1").update(await page.screenshot()).digest("hex");
const before = await shown();
await page.mouse.move(80, 80);
await page.mouse.down();
await page.mouse.move(140, 70, { steps: 3 });
await page.mouse.up();
let turned = before;
for (let tries = 0; turned === before && tries < 100; tries++) {
    await page.waitForTimeout(100);
    turned = await shown();
}
const state = await page.evaluate(() => document.documentElement.dataset.state);
const problem = await page.locator("#problem").textContent();
const isStill = (await page.locator("#still").count()) > 0;
await browser.close();
console.log(JSON.stringify({ state, problem, faults, requests, isStill, hasTurned: turned !== before }));
