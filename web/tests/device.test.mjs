// WebGPU that is missing, fails, or is lost.
import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import { decode } from "fast-png";
import { open } from "./browser.mjs";
import { HARDWARE, TINY, api, camera, colors, demo, picture } from "./helpers.mjs";

let opened;
before(async () => (opened = await open()));
after(() => opened.close());

/** A worker in which devices fail, counted from 1, for which `fails` is true. */
const failing = (fails) => `{
    const request = GPUAdapter.prototype.requestDevice;
    let count = 0;
    GPUAdapter.prototype.requestDevice = function (...args) {
        count += 1;
        return (${fails})(count) ? Promise.reject(new Error("no device today")) : request.apply(this, args);
    };
}`;

/** Makes a view of a small head, and tells what draws it and how many colours it has, or why it cannot be made. */
async function made(shown, backend) {
    return await shown.evaluate(async (backend) => {
        try {
            const view = await window.make([64, 64], { backend, workers: 2 });
            await view.setScene("volume.builtin = \"head:16\"");
            const { backend: drew } = await view.render();
            const colors = new Set(new Uint32Array(Uint8Array.from(await window.bytes(await view.toBlob())).buffer)).size;
            return { backend: view.backend, drew, colors };
        } catch (error) {
            return error.message;
        }
    }, backend);
}

test("auto draws by WebGPU where a device opens, else on the CPU", async () => {
    const { page: shown } = await api(opened, { inWorkers: HARDWARE });
    const found = await made(shown, "auto");
    assert.deepEqual([found.backend, found.drew], ["gpu", "gpu"]);
    assert.ok(found.colors > 10);
    for (const inWorkers of [
        "Object.defineProperty(navigator, 'gpu', { value: undefined });",
        "GPU.prototype.requestAdapter = async () => null;",
        failing("() => true"),
    ]) {
        const { page: shown } = await api(opened, { inWorkers: HARDWARE + inWorkers });
        const found = await made(shown, "auto");
        assert.deepEqual([found.backend, found.drew], ["cpu", "cpu"], `${inWorkers}: ${JSON.stringify(found)}`);
        assert.ok(found.colors > 10, inWorkers);
        assert.match(await made(shown, "gpu"), /^backend: found "gpu", allowed: "cpu" in this browser: /);
    }
});

test("auto leaves software adapters, and GPUs whose first frame is slow, to the CPU", async () => {
    const late = HARDWARE.replace("now() / 1000", "now() * 1000");
    for (const options of [{}, { inWorkers: late }]) {
        const { page: shown } = await api(opened, options);
        const found = await made(shown, "auto");
        assert.deepEqual([found.backend, found.drew], ["cpu", "cpu"], JSON.stringify([found, options]));
        assert.ok(found.colors > 10);
        // Who names the GPU gets it.
        const named = await made(shown, "gpu");
        assert.deepEqual([named.backend, named.drew], ["gpu", "gpu"]);
    }
});

test("auto draws on the CPU in a browser without WebGPU", async () => {
    const without = await open({ hasWebgpu: false });
    try {
        const { page: shown, faults } = await api(without);
        const found = await made(shown, "auto");
        assert.deepEqual([found.backend, found.drew], ["cpu", "cpu"], JSON.stringify(found));
        assert.ok(found.colors > 10);
        assert.match(await made(shown, "gpu"), /^backend: found "gpu"/);
        assert.deepEqual(faults, []);
    } finally {
        await without.close();
    }
});

/** Turns, zooms and moves the picture of the page. */
async function moved(shown) {
    await shown.focus("#canvas");
    for (const key of ["ArrowRight", "ArrowDown", "+", "Shift+ArrowLeft"]) await shown.keyboard.press(key);
    await shown.evaluate(() => window.view.render());
}

/** Loses the device, and waits until another one draws; what was told meanwhile. */
async function lost(shown) {
    return await shown.evaluate(async () => {
        const told = [];
        for (const event of ["lost", "restored", "error"]) window.view.on(event, (detail) => told.push([event, detail?.message ?? ""]));
        const restored = new Promise((resolve) => window.view.on("restored", resolve));
        window.view.internals.loseDevice();
        // This frame is asked for before the loss is known.
        const { backend } = await window.view.render();
        await restored;
        return { told: told.map(([event]) => event), backend };
    });
}

test("another device takes the place of a lost one, with the camera and its home", async () => {
    const { page: shown } = await demo(opened, "backend=gpu&example=head:16", TINY);
    const home = await shown.evaluate(() => window.view.scene());
    await moved(shown);
    const [before, place] = [await picture(shown), await camera(shown)];
    assert.deepEqual(await lost(shown), { told: ["lost", "restored"], backend: "gpu" });
    assert.deepEqual(await camera(shown), place);
    assert.equal(await picture(shown), before);
    assert.ok(await shown.isHidden("#problem"));
    await shown.keyboard.press("Home");
    assert.equal(await shown.evaluate(() => window.view.scene()), home);
});

test("where no other device opens, auto goes on drawing on the CPU", async () => {
    const { page: shown } = await demo(opened, "backend=auto&workers=2&example=head:16", { ...TINY, inWorkers: HARDWARE + failing("(count) => count > 1") });
    // Backends find voxels hidden at different sheets, which may change a picture by one minus the opacity threshold.
    await shown.evaluate(async () => window.view.setScene(await window.view.scene(), { set: { "splatting.culling": false }, keepCamera: true }));
    const home = await shown.evaluate(() => window.view.scene());
    assert.equal(await shown.evaluate(() => window.view.backend), "gpu");
    await moved(shown);
    const place = await camera(shown);
    const pixels = () => shown.evaluate(async () => {
        const bitmap = await createImageBitmap(await window.view.toBlob());
        const context = new OffscreenCanvas(bitmap.width, bitmap.height).getContext("2d");
        context.drawImage(bitmap, 0, 0);
        return [bitmap.width, bitmap.height, ...context.getImageData(0, 0, bitmap.width, bitmap.height).data];
    });
    const before = await pixels();
    assert.deepEqual(await lost(shown), { told: ["lost", "restored"], backend: "cpu" });
    assert.equal(await shown.evaluate(() => window.view.backend), "cpu");
    assert.deepEqual(await camera(shown), place);
    const after = await pixels();
    assert.equal(after.length, before.length);
    const apart = after.filter((channel, at) => Math.abs(channel - before[at]) > 1).length;
    assert.ok(apart <= after.length * 0.002, `${apart} of ${after.length} bytes`);
    // The new canvas has the old one's place, focus and controls.
    assert.ok(await shown.evaluate(() => document.activeElement === window.view.canvas && window.view.canvas.id === "canvas"));
    await shown.keyboard.press("ArrowUp");
    assert.notDeepEqual(await camera(shown), place);
    await shown.keyboard.press("Home");
    assert.equal(await shown.evaluate(() => window.view.scene()), home);
    const shot = await shown.locator("#canvas").screenshot();
    assert.ok(new Set(decode(shot).data).size > 20, "the page shows the picture");
    assert.ok(await colors(shown) > 50);
    await shown.locator("#preset").selectOption("ct-bone");
    await shown.waitForFunction(async () => (await window.view.scene()).includes("compositing = \"exponential\""));
    assert.ok(await shown.isHidden("#problem"));
});

test("where WebGPU is wanted and no other device opens, calls fail with the reason, and the next one tries again", async () => {
    const { page: shown } = await demo(opened, "backend=gpu&example=head:16", { ...TINY, inWorkers: failing("(count) => count === 2 || count === 3") });
    await moved(shown);
    const before = await picture(shown);
    const told = await shown.evaluate(async () => {
        const error = new Promise((resolve) => window.view.on("error", resolve));
        window.view.internals.loseDevice();
        const told = (await error).message;
        const rejected = await window.view.render().then(() => "drawn", (error) => error.message);
        return [told, rejected];
    });
    for (const message of told) assert.match(message, /^the GPU's device was lost, and no other one could be opened: .*no device today/);
    assert.match(await shown.textContent("#problem"), /^the GPU's device was lost/);
    await shown.evaluate(() => window.view.render());
    assert.equal(await picture(shown), before);
});
