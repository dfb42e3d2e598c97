// The browser's part of the Python package's widget for notebooks, with a kernel that the test plays.
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { dirname, join } from "node:path";
import { after, before, beforeEach, test } from "node:test";
import { fileURLToPath } from "node:url";
import { decode } from "fast-png";
import { open, page } from "./browser.mjs";

const root = dirname(dirname(dirname(fileURLToPath(import.meta.url))));
const read = (...path) => readFileSync(join(root, ...path));
const code = read("python", "sheetsplat", "widget.js").toString();
const style = read("python", "sheetsplat", "widget.css").toString();
/** Two pictures of different sizes; a rough one is smaller than the whole one. */
const WHOLE = read("tests", "goldens", "head.png");
const ROUGH = read("tests", "goldens", "nerve-minified.png");

let browser;
let close;
let shown;
let faults;
before(async () => ({ browser, close } = await open()));
after(() => close());

beforeEach(async () => {
    ({ page: shown, faults } = await page(browser, "about:blank", { hasTouch: true }));
    await shown.setContent(`<!doctype html><style>body { margin: 0 } ${style}</style><div id="one"></div><div id="two"></div>`);
    await shown.evaluate(async (code) => {
        /** What anywidget gives to a module: values that follow the kernel's, and messages. */
        class Model {
            values = { azimuth: 0, elevation: 10, zoom: 1, _png: new DataView(new ArrayBuffer(0)), _size: [320, 240], _problem: "" };
            sent = [];
            listeners = [];
            get = (name) => this.values[name];
            send = (content) => this.sent.push(structuredClone(content));
            on = (name, listener) => this.listeners.push([name, listener]);
            off = (name, listener) => (this.listeners = this.listeners.filter((known) => known[0] !== name || known[1] !== listener));
            emit = (name, ...values) => this.listeners.filter(([known]) => known === name).forEach(([, listener]) => listener(...values));
            set(name, value) {
                this.values[name] = value;
                this.emit(`change:${name}`);
            }
            answer = () => this.emit("msg:custom", { kind: "drawn" });
        }
        const module = await import(URL.createObjectURL(new Blob([code], { type: "text/javascript" })));
        const { initialize, render } = module.default();
        window.model = new Model();
        const { model } = window;
        window.ends = [initialize({ model }), ...["one", "two"].map((id) => render({ model, el: document.getElementById(id) }))];
    }, code);
});

const sent = () => shown.evaluate(() => window.model.sent);
const answer = () => shown.evaluate(() => window.model.answer());
const set = (name, value) => shown.evaluate(([name, value]) => window.model.set(name, value), [name, value]);
const show = async (png) => {
    await shown.evaluate((bytes) => window.model.set("_png", new DataView(Uint8Array.from(bytes).buffer)), [...png]);
    await shown.waitForFunction((width) => {
        return [...document.querySelectorAll("canvas")].every((canvas) => canvas.width === width);
    }, png.readUInt32BE(16));
};
/** The pixels of a view's picture. */
const pixels = (id) => area(id).locator("canvas").evaluate((canvas) => {
    return Array.from(canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data);
});
const area = (id = "one") => shown.locator(`#${id} > div`);

/** Two numbers that differ by rounding alone. */
function near(actual, expected) {
    assert.equal(actual.length, expected.length);
    for (const at of expected.keys()) assert.ok(Math.abs(actual[at] - expected[at]) < 1e-9, `${actual}, not ${expected}`);
}

test("every view shows the kernel's pictures, rough ones as large as whole ones", async () => {
    for (const png of [WHOLE, ROUGH]) {
        await show(png);
        for (const id of ["one", "two"]) {
            const { width, height } = await area(id).locator("canvas").boundingBox();
            assert.deepEqual([width, height], [320, 240]);
            // The goldens are opaque.
            const { data, channels } = decode(png);
            assert.deepEqual((await pixels(id)).filter((_, at) => at % 4 < 3), Array.from(data).filter((_, at) => channels === 3 || at % 4 < 3));
        }
    }
    await set("_size", [200, 100]);
    const { width, height } = await area().boundingBox();
    assert.deepEqual([width, height], [200, 100]);
    // A narrow page shrinks the picture, with its shape.
    await shown.setViewportSize({ width: 150, height: 300 });
    const narrow = await area().boundingBox();
    assert.deepEqual([narrow.width, narrow.height], [150, 75]);
    assert.deepEqual(faults, []);
});

test("a drag turns, with Shift or another button it moves, and moves are gathered until the kernel has drawn", async () => {
    const drag = async (by, options) => {
        await shown.mouse.move(100, 100);
        await shown.mouse.down(options);
        await shown.mouse.move(100 + by[0], 100 + by[1], { steps: 3 });
        await shown.mouse.up(options);
    };
    await drag([24, -12]);
    const [first, ...others] = await sent();
    assert.deepEqual(others, []);
    assert.deepEqual([first.home, first.pan, first.zoom], [false, [0, 0], 1]);
    near(first.orbit, [8 / 240, -4 / 240]);
    // All that came meanwhile is one message, and nothing more follows.
    await shown.keyboard.down("Shift");
    await drag([48, 24]);
    await shown.keyboard.up("Shift");
    await drag([0, 24], { button: "right" });
    assert.equal((await sent()).length, 1);
    await answer();
    const [, second] = await sent();
    near(second.orbit, [16 / 240, -8 / 240]);
    near(second.pan, [48 / 240, 48 / 240]);
    await answer();
    assert.equal((await sent()).length, 2);
    assert.deepEqual(faults, []);
});

test("the wheel and a pinch zoom, and two fingers move", async () => {
    await shown.mouse.move(100, 100);
    await shown.mouse.wheel(0, -200);
    await shown.waitForFunction(() => window.model.sent.length === 1);
    assert.ok(Math.abs((await sent())[0].zoom - Math.exp(-0.3)) < 1e-9);
    await answer();
    const session = await shown.context().newCDPSession(shown);
    const touch = (type, ...points) =>
        session.send("Input.dispatchTouchEvent", { type, touchPoints: points.map(([x, y], id) => ({ x, y, id })) });
    await touch("touchStart", [100, 100], [160, 100]);
    await touch("touchMove", [90, 124], [170, 124]);
    await touch("touchEnd");
    await answer();
    await answer();
    const moves = (await sent()).slice(1);
    const zoom = moves.reduce((product, move) => product * move.zoom, 1);
    assert.ok(Math.abs(zoom - 60 / 80) < 1e-6, `${zoom}`);
    near([0, 1].map((at) => moves.reduce((sum, move) => sum + move.pan[at], 0)), [0, 24 / 240]);
    assert.ok(moves.every(({ orbit }) => orbit[0] === 0 && orbit[1] === 0));
    assert.deepEqual(faults, []);
});

test("keys do the same, and a double click returns", async () => {
    await shown.keyboard.press("Tab");
    assert.ok(await area().evaluate((element) => element === document.activeElement));
    const last = async () => {
        await answer();
        return (await sent()).at(-1);
    };
    const still = { home: false, orbit: [0, 0], pan: [0, 0], zoom: 1 };
    for (const [key, change] of [
        ["ArrowLeft", { orbit: [-0.05, 0] }],
        ["ArrowDown", { orbit: [0, 0.05] }],
        ["Shift+ArrowRight", { pan: [0.05, 0] }],
        ["Shift+ArrowUp", { pan: [0, -0.05] }],
        ["+", { zoom: 1 / 1.15 }],
        ["-", { zoom: 1.15 }],
        ["Home", { home: true }],
    ]) {
        await shown.keyboard.press(key);
        assert.deepEqual(await last(), { ...still, ...change }, key);
    }
    // The browser keeps its own keys.
    const count = (await sent()).length;
    await shown.keyboard.press("Control+ArrowLeft");
    await shown.keyboard.press("a");
    assert.equal((await sent()).length, count);
    await shown.mouse.dblclick(100, 100);
    assert.deepEqual(await last(), { ...still, home: true });
    assert.deepEqual(faults, []);
});

test("it has a name, says where the camera is, and shows what is wrong", async () => {
    const named = shown.getByRole("application", { name: /Picture of a volume/ });
    assert.equal(await named.count(), 2);
    assert.equal(await area().getByRole("status").textContent(), "azimuth 0°, elevation 10°, zoom 1.0");
    await set("azimuth", 29.7);
    await set("zoom", 12.34);
    assert.equal(await area().getByRole("status").textContent(), "azimuth 30°, elevation 10°, zoom 12");
    assert.equal(await shown.getByRole("alert").count(), 0);
    await set("_problem", "camera.up: found <b>");
    assert.equal(await area().getByRole("alert").textContent(), "camera.up: found <b>");
    await set("_problem", "");
    assert.equal(await shown.getByRole("alert").count(), 0);
    assert.deepEqual(faults, []);
});

test("a view that is removed leaves nothing behind", async () => {
    await show(WHOLE);
    await shown.evaluate(() => window.ends[1]());
    await shown.mouse.click(100, 100);
    await shown.mouse.wheel(0, 100);
    assert.deepEqual(await sent(), []);
    await shown.evaluate(() => document.getElementById("one").replaceChildren());
    await show(ROUGH);
    const left = await shown.evaluate(() => {
        for (const end of [window.ends[0], window.ends[2]]) end();
        return window.model.listeners.length;
    });
    assert.equal(left, 0);
});
