// The controls of web/demo follow the scene, and the scene follows the controls.
import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import { open } from "./browser.mjs";
import { SMALL, camera, colors, demo, drop, fixture, picture, sceneHas, text } from "./helpers.mjs";

let opened;
before(async () => (opened = await open({ hasWebgpu: false })));
after(() => opened.close());

const SCENE = `preset = "xray"
[volume]
builtin = "head:24"
[transfer]
colormap = "magma"
[camera]
projection = "perspective"
[clip]
crop = [[-5.0, -1e3, -1e3], [1e3, 1e3, 3.0]]
planes = [[0.0, 2.0, 0.0, 6.0], [0.0, 0.0, 1.0, 8.0]]
[splatting]
slab_width = 1.5
compositing = "exponential"
`;

/** Drops a scene file. */
async function openScene(shown, scene) {
    await drop(shown, [{ name: "a.toml", bytes: Buffer.from(scene) }]);
    assert.equal(await text(shown, "#problem"), "");
}

/** What the controls show. */
const controls = (shown) => shown.evaluate(() => {
    const at = (id) => document.getElementById(id);
    return {
        preset: at("preset").value,
        colormap: at("colormap").value,
        compositing: at("compositing").value,
        slabWidth: at("slab-width").value,
        perspective: at("perspective").checked,
        plane: at("plane").checked,
        angles: ["azimuth", "elevation", "offset"].map((name) => Number(at(`plane-${name}`).value)),
        crop: [...document.querySelectorAll("#crop input")].map(({ value }) => Number(value)),
    };
});

test("controls show what a scene states", async () => {
    const { page: shown, faults } = await demo(opened, "backend=cpu&workers=1", SMALL);
    await openScene(shown, SCENE);
    const found = await controls(shown);
    assert.equal(found.preset, "xray");
    assert.equal(found.colormap, "magma");
    assert.equal(found.compositing, "exponential");
    assert.equal(found.slabWidth, "1.5");
    assert.ok(found.perspective && found.plane);
    // The plane's normal is that of the scene, whatever its length: y + 3 ≥ 0.
    const [azimuth, elevation, offset] = found.angles;
    assert.deepEqual([azimuth, elevation], [0, 0]);
    assert.ok(Math.abs(offset + 3) < 0.1, `${offset}`);
    const [fromX, toX, fromY, toY, fromZ, toZ] = found.crop;
    // Sliders have steps of a hundredth of half the box.
    assert.ok(Math.abs(fromX + 5) <= toX / 200 && Math.abs(toZ - 3) <= -fromZ / 200, found.crop.join());
    assert.ok(toX > 10 && fromY === -toY && fromZ < -3, found.crop.join());
    // Another scene is shown as it is.
    await openScene(shown, "volume.builtin = \"head:24\"\n");
    const plain = await controls(shown);
    assert.deepEqual([plain.preset, plain.colormap, plain.compositing, plain.slabWidth], ["", "", "", "1"]);
    assert.ok(!plain.perspective && !plain.plane);
    assert.equal(plain.crop[0], -plain.crop[1]);
    assert.deepEqual(faults, []);
});

test("controls that are set back win over the scene", async () => {
    const { page: shown, faults } = await demo(opened, "backend=cpu&workers=1", SMALL);
    await openScene(shown, "volume.builtin = \"head:24\"\n");
    const plain = await picture(shown);
    await openScene(shown, SCENE);
    assert.notEqual(await picture(shown), plain);
    await shown.locator("summary", { hasText: "Splatting" }).click();
    await shown.selectOption("#compositing", "");
    await sceneHas(shown, /^compositing = "xray"/);
    await shown.selectOption("#colormap", "");
    await shown.selectOption("#preset", "");
    await sceneHas(shown, /^compositing = "(?!xray)/);
    await shown.uncheck("#perspective");
    await shown.locator("#slab-width").fill("1");
    await shown.uncheck("#plane");
    for (const slider of await shown.locator("#crop input").all()) await slider.fill(await slider.getAttribute(await slider.getAttribute("data-end") === "from" ? "min" : "max"));
    await shown.waitForFunction(async () => !(await window.view.scene()).includes("crop"));
    // The plane without sliders stays; nothing else of the scene does.
    await sceneHas(shown, /^planes = \[\[0\.0, 0\.0, 1\.0, 8\.0\]\]/);
    assert.ok(!(await shown.isChecked("#plane")));
    // A scene with a table of the camera shows the whole volume.
    await openScene(shown, "volume.builtin = \"head:24\"\nclip.planes = [[0.0, 0.0, 1.0, 8.0]]\ncamera.fit = \"volume\"\n");
    const expected = await picture(shown);
    await openScene(shown, SCENE);
    await shown.locator("summary", { hasText: "Splatting" }).evaluate((summary) => (summary.parentElement.open = true));
    await shown.selectOption("#compositing", "");
    await shown.selectOption("#preset", "");
    await shown.selectOption("#colormap", "");
    await shown.locator("#slab-width").fill("1");
    await shown.uncheck("#plane");
    for (const slider of await shown.locator("#crop input").all()) await slider.fill(await slider.getAttribute(await slider.getAttribute("data-end") === "from" ? "min" : "max"));
    await shown.uncheck("#perspective");
    await shown.waitForFunction(async () => (await window.view.camera()).projection === "orthographic" && !(await window.view.scene()).includes("crop"));
    assert.equal(await picture(shown), expected);
    assert.ok(await shown.isHidden("#problem"));
    assert.deepEqual(faults, []);
});

test("colours that a scene states one by one can be left and taken again", async () => {
    const { page: shown } = await demo(opened, "backend=cpu&workers=1", SMALL);
    await openScene(shown, "volume.builtin = \"head:24\"\ntransfer.color = [[0.0, [0.0, 0.0, 1.0]], [255.0, [0.0, 0.0, 1.0]]]\n");
    assert.equal((await controls(shown)).colormap, "own");
    const blue = await picture(shown);
    await shown.selectOption("#colormap", "hot");
    await shown.waitForFunction(() => document.getElementById("colormap").value === "hot");
    await shown.waitForFunction(async () => !/1\.0\], \[255/.test(await window.view.scene()));
    assert.notEqual(await picture(shown), blue);
    await shown.selectOption("#colormap", "own");
    await sceneHas(shown, /color = .*\[0\.0, 0\.0, 1\.0\]/);
    assert.equal(await picture(shown), blue);
    await shown.selectOption("#colormap", "");
    await shown.waitForFunction(() => document.getElementById("colormap").value === "");
    assert.notEqual(await picture(shown), blue);
});

test("what cannot be shown is told and taken back", async () => {
    const { page: shown } = await demo(opened, "backend=cpu&workers=1", SMALL);
    // Sample by sample there are no sheets, and without sheets no means.
    await openScene(shown, "volume.builtin = \"head:16\"\nsplatting.method = \"composite-every-sample\"\n");
    await shown.locator("summary", { hasText: "Splatting" }).click();
    await shown.selectOption("#compositing", "average");
    await shown.waitForSelector("#problem", { state: "visible" });
    assert.match(await text(shown, "#problem"), /compositing/);
    assert.equal((await controls(shown)).compositing, "");
    await shown.selectOption("#colormap", "hot");
    await shown.waitForSelector("#problem", { state: "hidden" });
});

test("an oblique plane cuts by angles and where the camera is", async () => {
    const { page: shown, faults } = await demo(opened, "backend=cpu&workers=2&example=head:24", SMALL);
    const plane = async () => JSON.parse((await shown.evaluate(() => window.view.scene())).match(/^planes = \[(.*)\]$/m)[1]);
    await shown.locator("#plane-azimuth").fill("90");
    await shown.locator("#plane-elevation").fill("30");
    await shown.locator("#plane-offset").fill("2");
    await sceneHas(shown, /^planes = /);
    await shown.waitForFunction(async () => /-[12]\.\d*\]\]$/m.test(await window.view.scene()));
    assert.ok(await shown.isChecked("#plane"));
    const [x, y, z, d] = await plane();
    const near = (found, expected) => assert.ok(Math.abs(found - expected) < 0.05, `${found}, not ${expected}`);
    near(x, Math.cos(Math.PI / 6));
    near(y, 0);
    near(z, 0.5);
    near(d, -2);
    // What is behind the camera's centre stays.
    await shown.evaluate(() => window.view.move({ orbit: [0.2, 0.15] }));
    await shown.evaluate(() => window.view.move({ pan: [0.05, 0.1] }));
    const { direction, center } = await camera(shown);
    await shown.click("#cut-here");
    await shown.waitForFunction(async (x) => (await window.view.scene()).includes("planes") && Math.abs(JSON.parse((await window.view.scene()).match(/^planes = \[(.*)\]$/m)[1])[0] - x) < 1e-9, direction[0]);
    const here = await plane();
    direction.forEach((component, axis) => near(here[axis], component));
    near(here[3], -direction.reduce((sum, component, axis) => sum + component * center[axis], 0));
    const cut = await picture(shown);
    await shown.click("#other-side");
    await shown.waitForFunction(async (x) => JSON.parse((await window.view.scene()).match(/^planes = \[(.*)\]$/m)[1])[0] * x < 0, direction[0]);
    const other = await plane();
    other.forEach((number, at) => near(number, -here[at]));
    assert.notEqual(await picture(shown), cut);
    assert.deepEqual(faults, []);
});

test("channels are shown, hidden and edited one by one", async () => {
    const { page: shown, faults } = await demo(opened, "backend=cpu&workers=2", SMALL);
    await drop(shown, [{ name: "imagej.tif", bytes: fixture("channels", "imagej.tif") }]);
    const switches = shown.locator("#channels input");
    const count = await switches.count();
    assert.ok(count >= 2, await text(shown, "#volume"));
    const hidden = (count) => shown.waitForFunction(async (count) => ((await window.view.scene()).match(/^visible = false$/gm) ?? []).length === count, count);
    assert.ok(await colors(shown) > 1);
    for (const box of await switches.all()) await box.uncheck();
    await hidden(count);
    assert.equal(await colors(shown), 1);
    await switches.last().check();
    await hidden(count - 1);
    assert.ok(await colors(shown) > 1);
    // A hidden channel keeps its curve.
    const edits = shown.locator("#channels button");
    const pressed = () => edits.evaluateAll((buttons) => buttons.map((button) => button.getAttribute("aria-pressed")));
    assert.deepEqual(await pressed(), ["true", ...Array(count - 1).fill("false")]);
    assert.ok(await shown.locator("#plot circle").count() >= 2);
    // The plot and the colour map edit the channel that is pressed, and no other.
    await edits.last().click();
    assert.deepEqual(await pressed(), [...Array(count - 1).fill("false"), "true"]);
    const name = await edits.last().textContent();
    assert.equal(await text(shown, "#colormap-name"), `Colour map of ${name}`);
    await shown.selectOption("#colormap", "viridis");
    const stated = () => shown.evaluate(async () => (await window.view.scene()).split("[[channel]]").slice(1));
    const before = await stated();
    await shown.locator("#plot circle").last().focus();
    await shown.keyboard.press("Shift+ArrowDown");
    await shown.waitForFunction(async (last) => (await window.view.scene()).split("[[channel]]").at(-1) !== last, before.at(-1));
    const later = await stated();
    assert.deepEqual(later.slice(0, -1), before.slice(0, -1));
    await edits.first().click();
    assert.equal(await shown.inputValue("#colormap"), "");
    await edits.last().click();
    assert.equal(await shown.inputValue("#colormap"), "viridis");
    assert.equal(await text(shown, "#problem"), "");
    assert.deepEqual(faults, []);
    // A scene that hides a channel shows so.
    const scene = await shown.evaluate(() => window.view.scene());
    await drop(shown, [{ name: "a.toml", bytes: Buffer.from(scene) }, { name: "imagej.tif", bytes: fixture("channels", "imagej.tif") }]);
    assert.deepEqual(await switches.evaluateAll((boxes) => boxes.map(({ checked }) => checked)), [...Array(count - 1).fill(false), true]);
});
