// Pointer, wheel, touch and keys, by what they do to the camera.
import assert from "node:assert/strict";
import { after, before, beforeEach, test } from "node:test";
import { open } from "./browser.mjs";
import { api, camera } from "./helpers.mjs";

const [WIDTH, HEIGHT] = [160, 120];

let opened;
let shown;
let faults;
let start;
/** Where the canvas is on the page. */
let box;
before(async () => (opened = await open({ hasWebgpu: false })));
after(() => opened.close());

beforeEach(async () => {
    ({ page: shown, faults } = await api(opened, { hasTouch: true }));
    await shown.evaluate(async (size) => {
        const view = await window.make(size, { backend: "cpu", workers: 1, controls: true });
        // Level, so that a turn about up is as large as that of the direction.
        await view.setScene("volume.builtin = \"head:12\"", { set: { "camera.direction": [0, 1, 0] } });
    }, [WIDTH, HEIGHT]);
    start = await camera(shown);
    box = await shown.locator("canvas").boundingBox();
});

const dot = (a, b) => a.reduce((sum, component, axis) => sum + component * b[axis], 0);
const minus = (a, b) => a.map((component, axis) => component - b[axis]);
const cross = ([a, b, c], [x, y, z]) => [b * z - c * y, c * x - a * z, a * y - b * x];
const unit = (vector) => vector.map((component) => component / Math.hypot(...vector));

function near(found, expected, what) {
    assert.ok(Math.abs(found - expected) < 1e-9 * Math.max(1, Math.abs(expected)), `${what}: ${found}, not ${expected}`);
}

/** The screen's directions. */
function screen({ direction, up }) {
    const right = unit(cross(direction, up));
    return { right, upward: cross(right, direction) };
}

/** Checks that the picture moved right and down by some pixels, and nothing else happened. */
async function pannedBy(right, down) {
    const now = await camera(shown);
    assert.deepEqual(now.direction, start.direction);
    near(now.height, start.height, "height");
    const moved = minus(now.center, start.center);
    const axes = screen(start);
    near(dot(moved, axes.right), (-right / HEIGHT) * start.height, "right");
    near(dot(moved, axes.upward), (down / HEIGHT) * start.height, "up");
    near(dot(moved, start.direction), 0, "depth");
}

/** Checks that the camera turned about its centre so that what is in front moved right by a share of the picture's height. */
async function turnedBy(share) {
    const now = await camera(shown);
    near(dot(now.direction, start.direction), Math.cos(share * Math.PI), "the angle's cosine");
    assert.ok(dot(now.direction, screen(start).right) * share > 0, "what is in front follows the pointer");
    minus(now.center, start.center).forEach((component) => near(component, 0, "centre"));
    near(now.height, start.height, "height");
}

async function drag(by, options) {
    const [x, y] = [box.x + WIDTH / 2, box.y + HEIGHT / 2];
    await shown.mouse.move(x, y);
    await shown.mouse.down(options);
    await shown.mouse.move(x + by[0], y + by[1], { steps: 4 });
    await shown.mouse.up(options);
}

test("a drag turns", async () => {
    await drag([30, 0]);
    await turnedBy(30 / HEIGHT);
    assert.deepEqual(faults, []);
});

test("a drag with Shift or with the middle button moves", async () => {
    await shown.keyboard.down("Shift");
    await drag([24, -9]);
    await shown.keyboard.up("Shift");
    await pannedBy(24, -9);
    start = await camera(shown);
    await drag([-15, 6], { button: "middle" });
    await pannedBy(-15, 6);
    assert.deepEqual(faults, []);
});

test("a drag with the right button is the page's, and moves nothing", async () => {
    await shown.evaluate(() => {
        window.drags = [];
        window.view.on("window", (dragged) => window.drags.push(dragged));
    });
    await drag([30, -12], { button: "right" });
    const drags = await shown.evaluate(() => window.drags);
    assert.deepEqual(drags.at(-1), { right: 30 / HEIGHT, down: -12 / HEIGHT, isGoingOn: false });
    assert.ok(drags.length > 1 && drags.slice(0, -1).every(({ isGoingOn }) => isGoingOn));
    assert.deepEqual(await camera(shown), start);
    await drag([30, 0]);
    await turnedBy(30 / HEIGHT);
    assert.equal((await shown.evaluate(() => window.drags)).length, drags.length);
    assert.deepEqual(faults, []);
});

test("a look keeps the centre and the height, and vectors that no camera has are errors", async () => {
    const look = (...vectors) => shown.evaluate(async (look) => {
        window.view.move({ look });
        return await window.view.render().then(() => "", (error) => error.message);
    }, vectors);
    assert.equal(await look([0, 0, -2], [0, 1, 0]), "");
    const { direction, up, center, height } = await camera(shown);
    assert.deepEqual([direction, up, height], [[0, 0, -1], [0, 1, 0], start.height]);
    minus(center, start.center).forEach((component) => near(component, 0, "centre"));
    assert.match(await look([0, 0, 1], [0, 0, 1]), /^camera\.up: /);
    assert.deepEqual((await camera(shown)).direction, direction);
});

test("the wheel zooms, and the pinch of a touchpad more", async () => {
    await shown.mouse.move(box.x + 20, box.y + 20);
    const wheel = async (pixels, factor) => {
        const { height } = await camera(shown);
        await shown.mouse.wheel(0, pixels);
        await shown.waitForFunction(async (height) => (await window.view.camera()).height !== height, height);
        near((await camera(shown)).height / height, factor, "the zoom's factor");
    };
    await wheel(200, Math.exp(0.3));
    await wheel(-100, Math.exp(-0.15));
    await shown.keyboard.down("Control");
    await wheel(-10, Math.exp(-0.1));
    await shown.keyboard.up("Control");
    assert.deepEqual((await camera(shown)).direction, start.direction);
    // The page does not scroll.
    assert.equal(await shown.evaluate(() => window.scrollY), 0);
    // The last frame is as fine as the canvas.
    const { width } = await shown.evaluate(() => new Promise((resolve) => {
        const seen = { width: 0 };
        window.view.on("frame", ({ width }) => (seen.width = width));
        setTimeout(() => resolve(seen), 600);
    }));
    assert.ok(width === 0 || width === WIDTH, `${width}`);
    assert.deepEqual(faults, []);
});

test("one finger turns, two move and pinch", async () => {
    const session = await shown.context().newCDPSession(shown);
    const touch = (type, ...points) => session.send("Input.dispatchTouchEvent", {
        type,
        touchPoints: points.map(([x, y], id) => ({ x: box.x + x, y: box.y + y, id })),
    });
    await touch("touchStart", [80, 60]);
    await touch("touchMove", [80 + 30, 60]);
    await touch("touchEnd");
    await turnedBy(30 / HEIGHT);
    await shown.evaluate(() => window.view.move({ home: true }));
    assert.deepEqual(await camera(shown), start);
    await touch("touchStart", [50, 60], [90, 60]);
    await touch("touchMove", [56, 52], [96, 52]);
    await touch("touchEnd");
    await pannedBy(6, -8);
    await shown.evaluate(() => window.view.move({ home: true }));
    await touch("touchStart", [60, 60], [100, 60]);
    await touch("touchMove", [50, 60], [110, 60]);
    await touch("touchEnd");
    const now = await camera(shown);
    near(now.height / start.height, 40 / 60, "the pinch's factor");
    assert.deepEqual(now.direction, start.direction);
    assert.deepEqual(faults, []);
});

test("keys do the same", async () => {
    await shown.focus("canvas");
    await shown.keyboard.press("ArrowRight");
    await turnedBy(0.05);
    await shown.keyboard.press("Home");
    assert.deepEqual(await camera(shown), start);
    for (const [key, right, down] of [["ArrowRight", 1, 0], ["ArrowLeft", -1, 0], ["ArrowUp", 0, -1], ["ArrowDown", 0, 1]]) {
        await shown.keyboard.press(`Shift+${key}`);
        await pannedBy(right * 0.05 * HEIGHT, down * 0.05 * HEIGHT);
        await shown.keyboard.press("0");
    }
    await shown.keyboard.press("+");
    near((await camera(shown)).height, start.height / 1.15, "closer");
    await shown.keyboard.press("-");
    near((await camera(shown)).height, start.height, "back");
    // The browser keeps its own keys.
    for (const key of ["Control+ArrowLeft", "a", "Alt+ArrowUp"]) await shown.keyboard.press(key);
    near((await camera(shown)).height, start.height, "height");
    assert.deepEqual((await camera(shown)).direction, start.direction);
    assert.deepEqual(faults, []);
});
