// How soon the first picture is there, and how long the next ones take. Printed, not asserted: what else the machine does slows both down.
import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import { open } from "./browser.mjs";
import { api } from "./helpers.mjs";

let opened;
before(async () => (opened = await open({ hasWebgpu: false })));
after(() => opened.close());

const median = (numbers) => [...numbers].sort((a, b) => a - b)[Math.floor(numbers.length / 2)];

test("the first frame after a page is opened, and the next ones, timed", async () => {
    const firsts = [];
    for (let time = 0; time < Number(process.env.ROUNDS ?? 3); time++) {
        const { page: shown } = await api(opened, { query: "first" });
        await shown.waitForFunction(() => window.firstFrame);
        firsts.push(await shown.evaluate(() => window.firstFrame));
        await shown.context().close();
    }
    const { page: shown } = await api(opened);
    const frames = await shown.evaluate(async () => {
        const view = await window.make([512, 512], { backend: "cpu", controls: true });
        await view.setScene("volume.builtin = \"head:128\"");
        const times = [];
        for (let frame = 0; frame < 12; frame++) {
            view.move({ orbit: [0.02, 0] });
            const start = performance.now();
            await view.render();
            times.push(performance.now() - start);
        }
        return times;
    });
    const shares = firsts[0].map((_, at) => Math.round(median(firsts.map((times) => times[at]))));
    console.log(`head:64 at 256², from the start of the navigation: the worker draws after ${shares[0]} ms, the first frame is there after ${shares[1]} ms`);
    console.log(`head:128 at 512²: ${Math.round(Math.min(...frames))} ms a frame, median ${Math.round(median(frames))} ms`);
    assert.equal(frames.length, 12);
});
