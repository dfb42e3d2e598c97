// What tests of pages share: opening the page of web/demo and the page of the API, dropping files, and looking at pictures.
import { readFileSync } from "node:fs";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";
import { page } from "./browser.mjs";

/** Workers that take the software adapter of this browser for hardware, however long it takes. */
export const HARDWARE = `{
    Object.defineProperty(GPUAdapterInfo.prototype, "isFallbackAdapter", { get: () => false });
    const now = performance.now.bind(performance);
    performance.now = () => now() / 1000;
}`;

const here = dirname(fileURLToPath(import.meta.url));
export const fixtures = join(here, "..", "..", "tests", "fixtures");
/** Pictures to look at, which continuous integration keeps. */
export const screenshots = process.env.SCREENSHOTS ?? join(here, "..", "screenshots");

/** A small picture beside the panel. */
export const SMALL = { viewport: { width: 800, height: 320 } };
/** A picture that WebGPU draws soon without a GPU. */
export const TINY = { viewport: { width: 400, height: 260 } };

/** The page of web/demo, ready. */
export async function demo({ browser, url }, query, options) {
    const opened = await page(browser, `${url}demo/?${query}`, options);
    await opened.page.waitForSelector("html[data-ready]");
    return opened;
}

/** The page on which tests make views by `window.view(size, options)`. */
export async function api({ browser, url }, { query = "", ...options } = {}) {
    const opened = await page(browser, `${url}tests/page.html${query ? `?${query}` : ""}`, options);
    await opened.page.waitForFunction(() => window.isReady);
    return opened;
}

/** A file of `tests/fixtures`. */
export function fixture(...path) {
    return readFileSync(join(fixtures, ...path));
}

/** Drops files of `tests/fixtures`, or of given bytes, onto the page. */
export async function drop(shown, files) {
    const given = files.map(({ name, bytes }) => ({ name, data: (bytes ?? fixture(name)).toString("base64") }));
    const transfer = await shown.evaluateHandle((given) => {
        const transfer = new DataTransfer();
        for (const { name, data } of given) {
            transfer.items.add(new File([Uint8Array.from(atob(data), (letter) => letter.charCodeAt(0))], name));
        }
        return transfer;
    }, given);
    await shown.dispatchEvent("#stage", "drop", { dataTransfer: transfer });
    await isIdle(shown);
}

/** Waits until the page of web/demo has loaded what it was given. */
export async function isIdle(shown) {
    await shown.evaluate(() => new Promise((resolve) => setTimeout(resolve)));
    await shown.waitForFunction(() => document.getElementById("busy").textContent === "");
}

export const text = (shown, selector) => shown.textContent(selector);

/** The number of colours in the picture: one if nothing shows. */
export async function colors(shown) {
    return await shown.evaluate(async () => {
        const bitmap = await createImageBitmap(await window.view.toBlob());
        const context = new OffscreenCanvas(bitmap.width, bitmap.height).getContext("2d");
        context.drawImage(bitmap, 0, 0);
        const { data } = context.getImageData(0, 0, bitmap.width, bitmap.height);
        return new Set(new Uint32Array(data.buffer)).size;
    });
}

/** What tells two pictures apart. */
export async function picture(shown) {
    return await shown.evaluate(async () => {
        const hash = await crypto.subtle.digest("SHA-256", await (await window.view.toBlob()).arrayBuffer());
        return [...new Uint8Array(hash)].join();
    });
}

export const camera = (shown) => shown.evaluate(() => window.view.camera());

/** Waits until all changes of settings are shown: until the scene is the one that is expected. */
export async function sceneHas(shown, pattern) {
    await shown.waitForFunction(async (source) => new RegExp(source, "m").test(await window.view.scene()), pattern.source);
}
