// Pictures in a browser against the goldens that the native backend made.
import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import { goldens, open, page } from "./browser.mjs";

/** WebGPU's sums are taken in other orders: in this share of the pixels a channel may differ by more than 1 of 255. */
const OUTLIERS = 0.002;
/** The scenes that WebGPU draws: one of every method, order and compositing. */
const OF_GPU = [
    "head",
    "head-labels",
    "head-xray",
    "nerve-perspective",
    "cube-fixed-light",
    "after-head",
    "after-nerve-maximum",
    "after-head-surface",
];

let browser;
let url;
let close;
before(async () => ({ browser, url, close } = await open()));
after(() => close());

/** Numbers that a page has written in base 64. */
function floats(text) {
    const bytes = Uint8Array.from(Buffer.from(text, "base64"));
    return new Float32Array(bytes.buffer);
}

/** A pixel's channels with straight alpha, as in a PNG file whose largest number is `full`. */
function straight([red, green, blue, alpha], full) {
    const scale = alpha > 0 ? Math.fround(1 / alpha) : 0;
    const rounded = (channel) => Math.min(Math.max(Math.round(Math.fround(channel * full)), 0), full);
    return [...[red, green, blue].map((channel) => rounded(Math.fround(channel * scale))), rounded(alpha)];
}

test("the cpu backend draws the goldens byte by byte", async () => {
    const { page: shown, faults } = await page(browser, `${url}tests/page.html`);
    await shown.waitForFunction(() => window.isReady);
    const all = goldens();
    for (const { name, text, size, png } of all) {
        const pixels = await shown.evaluate(async ({ text, size }) => {
            const view = await window.view(size, { backend: "cpu", workers: 1 });
            await view.setScene(text);
            return await window.base64((await view.pixels()).data);
        }, { text, size }).then(floats);
        assert.equal(pixels.length, size[0] * size[1] * 4, name);
        const full = png.depth === 16 ? 65535 : 255;
        for (let at = 0; at < size[0] * size[1]; at++) {
            const found = straight(pixels.subarray(4 * at, 4 * at + 4), full).slice(0, png.channels);
            const expected = png.data.subarray(png.channels * at, png.channels * (at + 1));
            if (found.some((channel, number) => channel !== expected[number])) {
                assert.fail(`${name}: pixel ${at % size[0]}, ${Math.floor(at / size[0])} is ${found}, not ${expected}`);
            }
        }
    }
    assert.deepEqual(faults, []);
});

test("shares of a frame make the same picture as one worker", async () => {
    const { page: shown } = await page(browser, `${url}tests/page.html`);
    await shown.waitForFunction(() => window.isReady);
    const { text } = goldens().find(({ name }) => name === "after-head");
    // Neither side is of whole tiles.
    const pictures = await shown.evaluate(async (text) => {
        const pictures = [];
        for (const workers of [1, 3]) {
            const view = await window.view([203, 131], { backend: "cpu", workers });
            await view.setScene(text);
            // Shares change from frame to frame.
            for (let frame = 0; frame < 3; frame++) {
                const stats = await view.render();
                if (stats.workers !== workers) throw new Error(`${stats.workers} workers, not ${workers}`);
            }
            pictures.push(await window.bytes(await view.toBlob()));
        }
        return pictures;
    }, text);
    assert.equal(pictures[0].length, 203 * 131 * 4);
    assert.deepEqual(pictures[1], pictures[0]);
});

test("WebGPU's pictures look like the goldens", async () => {
    const { page: shown } = await page(browser, `${url}tests/page.html`);
    await shown.waitForFunction(() => window.isReady);
    const chosen = goldens().filter(({ name }) => OF_GPU.includes(name));
    assert.equal(chosen.length, OF_GPU.length);
    const complaints = [];
    for (const { name, text, size, png } of chosen) {
        const found = await shown.evaluate(async ({ text, size }) => {
            const view = await window.view(size, { backend: "gpu" });
            await view.setScene(text);
            return await window.bytes(await view.toBlob());
        }, { text, size });
        const scale = png.depth === 16 ? 257 : 1;
        let outliers = 0;
        for (let at = 0; at < size[0] * size[1]; at++) {
            const apart = [0, 1, 2].map((channel) => Math.abs(found[4 * at + channel] - png.data[png.channels * at + channel] / scale));
            // The canvas's bytes are rounded, the golden is finer.
            if (Math.max(...apart) > 1.5) outliers += 1;
        }
        const share = outliers / (size[0] * size[1]);
        console.log(`${name}: ${(100 * share).toFixed(3)} % of the pixels differ by more than 1 of 255`);
        if (!(share <= OUTLIERS)) complaints.push(`${name}: ${(100 * share).toFixed(2)} % of the pixels`);
    }
    assert.deepEqual(complaints, []);
});

/** Every value that a pass may give a shader's constant. */
function values(type, name) {
    if (type === "bool") return [0, 1];
    return { COMPOSITING: [0, 1, 2, 3, 4, 5, 6], SHEETS: [1, 2, 4] }[name] ?? [];
}

test("the browser compiles every shader with every value of its constants", async () => {
    const { page: shown } = await page(browser, `${url}tests/page.html`);
    await shown.waitForFunction(() => window.isReady);
    const shaders = await shown.evaluate(async () => {
        const view = await window.view([8, 8], { backend: "gpu" });
        return [...await view.internals.shaders()];
    });
    assert.ok(shaders.length >= 18);
    const variants = shaders.map(([stage, source]) => {
        const overrides = [...source.matchAll(/^override (\w+): (\w+)/gm)].map(([, name, type]) => [name, values(type, name)]);
        // Every value beside the other constants' defaults, and all constants at their last ones.
        const single = overrides.flatMap(([name, all]) => all.map((value) => ({ [name]: value })));
        const last = Object.fromEntries(overrides.filter(([, all]) => all.length > 0).map(([name, all]) => [name, all.at(-1)]));
        return { stage, source, sets: [{}, ...single, last] };
    });
    const { complaints, compiled, left } = await shown.evaluate(async (variants) => {
        const adapter = await navigator.gpu.requestAdapter();
        const features = ["float32-blendable"].filter((feature) => adapter.features.has(feature));
        const limits = ["maxColorAttachmentBytesPerSample", "maxComputeWorkgroupStorageSize"];
        const requiredLimits = Object.fromEntries(limits.map((limit) => [limit, adapter.limits[limit]]));
        const device = await adapter.requestDevice({ requiredFeatures: features, requiredLimits });
        const complaints = [];
        const left = [];
        let compiled = 0;
        for (const { stage, source, sets } of variants) {
            // WebGPU has no barrier of a subgroup, so that wgpu offers none there, and other stages draw.
            if (/subgroupBarrier/.test(source)) {
                left.push(stage);
                continue;
            }
            const module = device.createShaderModule({ code: source });
            const errors = (await module.getCompilationInfo()).messages.filter(({ type }) => type === "error");
            complaints.push(...errors.map(({ message, lineNum }) => `${stage}:${lineNum}: ${message}`));
            const entries = [...source.matchAll(/@compute[^{]*?fn (\w+)/g)].map(([, entry]) => entry);
            for (const [entryPoint, constants] of entries.flatMap((entry) => sets.map((set) => [entry, set]))) {
                device.pushErrorScope("validation");
                device.createComputePipeline({ layout: "auto", compute: { module, entryPoint, constants } });
                const error = await device.popErrorScope();
                compiled += 1;
                if (error) complaints.push(`${stage} ${entryPoint} ${JSON.stringify(constants)}: ${error.message}`);
            }
            compiled += entries.length === 0 ? 1 : 0;
        }
        return { complaints, compiled, left };
    }, variants);
    console.log(`${compiled} variants compiled`);
    assert.deepEqual(complaints, []);
    assert.deepEqual(left, ["gather", "gather_planes"]);
    assert.ok(compiled > 40, `${compiled}`);
});
