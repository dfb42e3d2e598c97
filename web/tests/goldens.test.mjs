// Pictures in a browser against the goldens that the native backend made.
import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import { goldens, open } from "./browser.mjs";
import { api } from "./helpers.mjs";

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

let opened;
before(async () => (opened = await open()));
after(() => opened.close());

/** Numbers that a page has written in base 64. */
function floats(text) {
    const bytes = Uint8Array.from(Buffer.from(text, "base64"));
    return new Float32Array(bytes.buffer);
}

/** Goldens in an order in which those of one size follow one another, so that one view draws them. */
function bySize(goldens) {
    return goldens.sort((a, b) => a.size[0] - b.size[0] || a.size[1] - b.size[1]);
}

/** A pixel's channels with straight alpha, as in a PNG file whose largest number is `full`. */
function straight([red, green, blue, alpha], full) {
    const scale = alpha > 0 ? Math.fround(1 / alpha) : 0;
    const rounded = (channel) => Math.min(Math.max(Math.round(Math.fround(channel * full)), 0), full);
    return [...[red, green, blue].map((channel) => rounded(Math.fround(channel * scale))), rounded(alpha)];
}

test("the cpu backend draws the goldens byte by byte", async () => {
    const { page: shown, faults } = await api(opened);
    for (const { name, text, size, png } of bySize(goldens())) {
        const pixels = await shown.evaluate(async ({ text, size }) => {
            const view = await window.ofSize(size, { backend: "cpu", workers: 1 });
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
    const { page: shown } = await api(opened);
    const { text } = goldens().find(({ name }) => name === "after-head");
    // Neither side is of whole tiles.
    const pictures = await shown.evaluate(async (text) => {
        const pictures = [];
        for (const workers of [1, 3]) {
            const view = await window.make([203, 131], { backend: "cpu", workers });
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
    const { page: shown } = await api(opened);
    const chosen = goldens().filter(({ name }) => OF_GPU.includes(name));
    assert.equal(chosen.length, OF_GPU.length);
    const complaints = [];
    for (const { name, text, size, png } of bySize(chosen)) {
        const found = await shown.evaluate(async ({ text, size }) => {
            const view = await window.ofSize(size, { backend: "gpu" });
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
