// What the page of web/demo looks like: pictures to look at, which continuous integration keeps, and what WebGPU shows on the page.
import assert from "node:assert/strict";
import { mkdirSync } from "node:fs";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { decode } from "fast-png";
import { goldens, open } from "./browser.mjs";
import { api, demo, drop, fixture, isIdle, screenshots, text } from "./helpers.mjs";

let opened;
before(async () => {
    mkdirSync(screenshots, { recursive: true });
    opened = await open();
});
after(() => opened.close());

const shot = (shown, name, options) => shown.screenshot({ path: join(screenshots, `${name}.png`), ...options });

test("the page fits screens of every size", async () => {
    for (const [width, height, scale] of [[1280, 800, 1], [820, 1100, 1], [390, 844, 2], [320, 568, 1]]) {
        const options = { viewport: { width, height }, deviceScaleFactor: scale };
        const { page: shown } = await demo(opened, "backend=cpu&example=head:64", options);
        const wide = await shown.evaluate(() => document.documentElement.scrollWidth);
        assert.ok(wide <= width, `${wide} of ${width}`);
        const canvas = await shown.locator("#canvas").boundingBox();
        assert.ok(canvas.width >= Math.min(width * 0.55, 300) && canvas.height >= 200, JSON.stringify(canvas));
        await shot(shown, `${width}`);
        await shown.evaluate(() => document.querySelectorAll("details").forEach((details) => (details.open = true)));
        assert.ok(await shown.evaluate(() => document.documentElement.scrollWidth) <= width, "unfolded");
        await shot(shown, `${width}-whole`, { fullPage: true });
        if (width === 1280) await shown.locator("#panel").screenshot({ path: join(screenshots, "panel.png") });
    }
});

test("the page before a volume, while files are dropped, with channels, with an error, cut, and by WebGPU", async () => {
    const { page: shown } = await demo(opened, "backend=cpu&workers=2", { viewport: { width: 1000, height: 640 } });
    await shot(shown, "empty");
    await shown.dispatchEvent("#stage", "dragover", { dataTransfer: await shown.evaluateHandle(() => new DataTransfer()) });
    await shot(shown, "dropping");
    await drop(shown, [{ name: "imagej.tif", bytes: fixture("channels", "imagej.tif") }]);
    await shot(shown, "dropped");
    const whole = fixture("itk.nrrd");
    await drop(shown, [{ name: "cut.nrrd", bytes: whole.subarray(0, whole.length - 5) }]);
    assert.match(await text(shown, "#problem"), /^cut\.nrrd: /);
    await shot(shown, "error");
    await shown.selectOption("#example", "tomato:96");
    await isIdle(shown);
    await shown.evaluate(() => window.view.move({ orbit: [0.2, 0.2] }));
    await shown.click("#cut-here");
    await shown.waitForFunction(async () => (await window.view.scene()).includes("planes"));
    await shown.evaluate(() => window.view.render());
    await shot(shown, "cut");
    // Small, since WebGPU without a GPU is slow.
    const { page: byGpu } = await demo(opened, "backend=gpu&example=head:32", { viewport: { width: 800, height: 320 } });
    await byGpu.locator("summary", { hasText: "Frame" }).click();
    await byGpu.locator("#stats").scrollIntoViewIfNeeded();
    assert.match(await text(byGpu, "#stats"), /WebGPU/);
    await shot(byGpu, "webgpu");
});

test("WebGPU's picture on the page is the golden", async () => {
    const { page: shown } = await api(opened);
    for (const wanted of ["head", "nerve-perspective"]) {
        const { text, size, png } = goldens().find(({ name }) => name === wanted);
        await shown.evaluate(async ({ text, size }) => {
            const view = await window.make(size, { backend: "gpu" });
            await view.setScene(text);
            // The browser shows a frame after the worker has drawn it.
            for (let frame = 0; frame < 3; frame++) await new Promise((resolve) => requestAnimationFrame(resolve));
        }, { text, size });
        const scale = png.depth === 16 ? 257 : 1;
        const compare = async () => {
            const found = decode(await shown.locator("canvas").screenshot({ path: join(screenshots, `webgpu-${wanted}.png`) }));
            assert.deepEqual([found.width, found.height], size);
            let outliers = 0;
            for (let at = 0; at < size[0] * size[1]; at++) {
                const apart = [0, 1, 2].map((channel) => Math.abs(found.data[found.channels * at + channel] - png.data[png.channels * at + channel] / scale));
                if (Math.max(...apart) > 1.5) outliers += 1;
            }
            return outliers / (size[0] * size[1]);
        };
        let share = await compare();
        for (let waited = 0; share > 0.002 && waited < 20; waited++) {
            await shown.waitForTimeout(100);
            share = await compare();
        }
        assert.ok(share <= 0.002, `${wanted}: ${(100 * share).toFixed(3)} % of the pixels differ by more than 1 of 255`);
    }
});
