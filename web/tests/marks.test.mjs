// Marks over the picture, the buttons that look from a side, the window of values by dragging, and files of bare samples.
import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import { open } from "./browser.mjs";
import { SMALL, api, camera, colors, demo, drop, fixture, isIdle, picture, sceneHas, text } from "./helpers.mjs";

let opened;
before(async () => (opened = await open({ hasWebgpu: false })));
after(() => opened.close());

/** The marks' texts, and the scale bar's width. */
const marked = (shown) => shown.evaluate(() => {
    const layer = document.querySelector("#canvas ~ [aria-hidden]");
    const texts = [...(layer?.children ?? [])].map((mark) => mark.innerText);
    return { texts, bar: layer?.children[0]?.lastChild?.getBoundingClientRect?.().width };
});

test("marks tell lengths, colours and the patient's sides", async () => {
    const { page: shown, faults } = await demo(opened, "backend=cpu&workers=1", SMALL);
    await drop(shown, [{ name: "flipped.mhd" }, { name: "flipped.raw" }]);
    // The patient's left is at the right in a view from the front.
    await shown.locator("summary", { hasText: "View" }).click();
    await shown.click("#sides button:text-is('Front')");
    await shown.waitForFunction(() => document.querySelector("#canvas ~ [aria-hidden]")?.innerText.includes("R"));
    const { texts, bar } = await marked(shown);
    assert.deepEqual(texts.slice(2), ["R", "L", "S", "I"]);
    const [length, unit] = texts[0].trim().split(" ");
    assert.equal(unit, "units");
    const { height } = await camera(shown);
    const box = await shown.locator("#canvas").boundingBox();
    assert.ok(Math.abs(bar - (Number(length) / height) * box.height) < 0.5, `${bar} for ${length}`);
    assert.ok(bar <= box.width / 4 && bar > box.width / 11);
    assert.match(texts[1], /^[\d.]+\s+[\d.]+$/);
    await shown.click("#sides button:text-is('Left')");
    await shown.waitForFunction(() => document.querySelector("#canvas ~ [aria-hidden]").innerText.includes("A"));
    assert.deepEqual((await marked(shown)).texts.slice(2), ["A", "P", "S", "I"]);

    // In perspective a length on the screen is none in the volume.
    await shown.locator("summary", { hasText: "Splatting" }).click();
    await shown.check("#perspective");
    await shown.waitForFunction(() => !document.querySelector("#canvas ~ [aria-hidden]").innerText.includes("units"));
    await shown.uncheck("#marks");
    assert.deepEqual((await marked(shown)).texts, []);
    await shown.check("#marks");
    await shown.waitForFunction(() => document.querySelector("#canvas ~ [aria-hidden]")?.innerText.includes("S"));

    await shown.selectOption("#example", "marschner-lobb:48");
    await isIdle(shown);
    assert.deepEqual(await shown.locator("#sides button").allTextContents(), ["xy", "xz", "yz", "yx", "zx", "zy", "Oblique"]);
    await shown.click("#sides button:text-is('xy')");
    await shown.waitForFunction(async () => (await window.view.camera()).direction[2] === -1);
    assert.deepEqual(faults, []);
});

test("marks follow a view of the API, and end", async () => {
    const { page: shown, faults } = await api(opened);
    const found = await shown.evaluate(async () => {
        const { marks } = await import("../dist/index.js");
        const view = await window.make([120, 80], { backend: "cpu", workers: 1 });
        const end = marks(view, ["scale"]);
        const layers = () => [...document.querySelectorAll("canvas ~ [aria-hidden]")].map((layer) => layer.innerText);
        const until = async (has) => {
            while (!has(layers())) await new Promise((resolve) => setTimeout(resolve, 10));
        };
        await view.setScene({ volume: { builtin: "head:12" }, camera: { height: 4 } });
        await until(([first]) => first);
        const before = layers();
        view.move({ zoom: 10 });
        await until(([first]) => first !== before[0]);
        const after = layers();
        end();
        return [before, after, layers()];
    });
    assert.deepEqual(found, [["1 unit"], ["10 units"], []]);
    assert.deepEqual(faults, []);
});

test("the right button changes window and level", async () => {
    const { page: shown, faults } = await demo(opened, "backend=cpu&workers=1&example=head:32", SMALL);
    const before = await picture(shown);
    const points = () => shown.evaluate(() => window.view.facts.channels[0].opacity.map(([value]) => value));
    const [first, last] = [(await points())[0], (await points()).at(-1)];
    const box = await shown.locator("#canvas").boundingBox();
    const drag = async (right, down) => {
        const [x, y] = [box.x + box.width / 2, box.y + box.height / 2];
        await shown.mouse.move(x, y);
        await shown.mouse.down({ button: "right" });
        await shown.mouse.move(x + right * box.height, y + down * box.height, { steps: 3 });
        await shown.mouse.up({ button: "right" });
    };
    await drag(0.2, 0);
    await sceneHas(shown, /^opacity = /);
    await shown.waitForFunction((width) => {
        const values = window.view.facts.channels[0].opacity.map(([value]) => value);
        return Math.abs((values.at(-1) - values[0]) / width - 8 ** 0.2) < 0.02;
    }, last - first);
    const wide = await points();
    assert.ok(Math.abs((wide[0] + wide.at(-1)) / 2 - (first + last) / 2) < 1e-3 * (last - first));
    assert.notEqual(await picture(shown), before);
    await drag(0, 0.1);
    await shown.waitForFunction((wide) => window.view.facts.channels[0].opacity[0][0] < wide, wide[0]);
    await shown.click("#reset-transfer");
    assert.equal(await text(shown, "#problem"), "");
    assert.deepEqual(faults, []);
});

test("a file of bare samples is asked about", async () => {
    const { page: shown, faults } = await demo(opened, "backend=cpu&workers=1", SMALL);
    const bytes = fixture("flipped.raw");
    const given = async (answer) => {
        // The page waits for the answer.
        const transfer = await shown.evaluateHandle((data) => {
            const transfer = new DataTransfer();
            transfer.items.add(new File([Uint8Array.from(atob(data), (letter) => letter.charCodeAt(0))], "flipped.raw"));
            return transfer;
        }, bytes.toString("base64"));
        await shown.dispatchEvent("#stage", "drop", { dataTransfer: transfer });
        await shown.waitForSelector("#raw[open]");
        assert.equal(await text(shown, "#raw-name"), "flipped.raw: 120 bytes");
        await answer();
        await isIdle(shown);
    };
    await given(() => shown.click("#raw button:text-is('Cancel')"));
    assert.match(await text(shown, "#volume"), /^No volume/);
    const form = async (z) => {
        for (const [id, value] of [["x", 5], ["y", 4], ["z", z]]) await shown.fill(`#raw-${id}`, String(value));
        await shown.selectOption("#raw-type", "uint16");
        await shown.click("#raw button:text-is('Open')");
    };
    await given(() => form(4));
    assert.match(await text(shown, "#problem"), /^flipped\.raw: .*160/);
    await given(() => form(3));
    assert.ok(await shown.isHidden("#problem"));
    assert.match(await text(shown, "#volume"), /^flipped\.raw: 5 × 4 × 3/);
    assert.ok(await colors(shown) > 1);
    // Changes go on from the stated form.
    await shown.selectOption("#colormap", "viridis");
    await sceneHas(shown, /^colormap = "viridis"/);
    assert.ok(await shown.isHidden("#problem"));
    assert.deepEqual(faults, []);
});
