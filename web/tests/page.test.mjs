// The page of web/demo as a person uses it, by both backends: files, controls, downloads, errors.
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { after, before, test } from "node:test";
import { decode } from "fast-png";
import { open } from "./browser.mjs";
import { SMALL, TINY, camera, colors, demo, drop, fixture, isIdle, picture, sceneHas, text } from "./helpers.mjs";

let opened;
before(async () => (opened = await open()));
after(() => opened.close());

/** The camera's direction. */
const direction = async (shown) => (await camera(shown)).direction;

for (const [backend, size] of [["cpu", SMALL], ["gpu", TINY]]) {
    test(`files dropped on the page are shown (${backend})`, async () => {
        const { page: shown, faults } = await demo(opened, `backend=${backend}&workers=2`, size);
        assert.ok(await shown.isVisible("#hint"));
        for (const { name, others = [], words } of [
            { name: "itk.nrrd", words: /itk\.nrrd: 5 × 4 × 3, NRRD/ },
            { name: "sform.nii", words: /sform\.nii: .*NIfTI/ },
            { name: "imagej.tif", words: /imagej\.tif: .*TIFF/ },
            { name: "c.npy", words: /c\.npy: .*NPY/ },
            { name: "list.nhdr", others: ["part0.bin", "part1.bin", "part2.bin"], words: /4 files: .*NRRD/ },
        ]) {
            await drop(shown, [name, ...others].map((name) => ({ name })));
            assert.equal(await text(shown, "#problem"), "", name);
            assert.match(await text(shown, "#volume"), words);
            assert.ok(await colors(shown) > 1, `${name} shows nothing`);
        }
        assert.equal(await text(shown, "#warnings"), "");
        await drop(shown, [{ name: "sheared.nii" }]);
        assert.match(await text(shown, "#warnings"), /^sheared\.nii: /);
        assert.match(await text(shown, "#stats"), backend === "gpu" ? /WebGPU/ : /CPU, 2 workers, simd128/);
        assert.deepEqual(faults, []);
    });

    test(`the mouse and keys turn and zoom (${backend})`, async () => {
        const { page: shown, faults } = await demo(opened, `backend=${backend}&example=head:32`, size);
        const before = await direction(shown);
        const scene = await shown.evaluate(() => window.view.scene());
        const box = await shown.locator("#canvas").boundingBox();
        const frames = await shown.evaluateHandle(() => {
            const drawn = [];
            window.view.on("frame", (stats) => drawn.push([stats.width, stats.height]));
            return drawn;
        });
        await shown.mouse.move(box.x + box.width / 2, box.y + box.height / 2);
        await shown.mouse.down();
        await shown.mouse.move(box.x + box.width / 2 + box.height / 2, box.y + box.height / 2, { steps: 5 });
        await shown.mouse.up();
        const turned = await direction(shown);
        // Half a height is 90 degrees about z.
        const [from, to] = [before, turned].map(([x, y]) => [x, y]);
        const cosine = (from[0] * to[0] + from[1] * to[1]) / (Math.hypot(...from) * Math.hypot(...to));
        assert.ok(Math.abs(cosine) < 0.02, `${before} ${turned}`);
        await shown.waitForTimeout(300);
        const drawn = await frames.jsonValue();
        assert.ok(drawn.length >= 1);
        assert.deepEqual(drawn.at(-1), [Math.round(box.width), Math.round(box.height)], "the last frame is not coarse");
        await shown.focus("#canvas");
        await shown.keyboard.press("ArrowRight");
        assert.notDeepEqual(await direction(shown), turned);
        const height = async () => Number((await shown.evaluate(() => window.view.scene())).match(/^height = (.*)$/m)[1]);
        const whole = await height();
        await shown.keyboard.press("+");
        assert.ok(Math.abs(whole / await height() - 1.15) < 1e-6);
        await shown.keyboard.press("Home");
        assert.equal(await shown.evaluate(() => window.view.scene()), scene);
        assert.deepEqual(faults, []);
    });

    test(`damaged and unknown files are refused by name, and the old volume stays (${backend})`, async () => {
        const { page: shown } = await demo(opened, `backend=${backend}&workers=2&example=head:24`, size);
        const whole = fixture("itk.nrrd");
        await drop(shown, [{ name: "cut.nrrd", bytes: whole.subarray(0, whole.length - 5) }]);
        assert.match(await text(shown, "#problem"), /^cut\.nrrd: /);
        await drop(shown, [{ name: "bzip2.nrrd", bytes: fixture("bzip2.nrrd") }]);
        assert.match(await text(shown, "#problem"), /^bzip2\.nrrd: encoding: found "?bzip2"?, allowed: raw, .*not compiled in: bzip2/);
        await drop(shown, [{ name: "letter.txt", bytes: Buffer.from("Dear Sir") }]);
        assert.match(await text(shown, "#problem"), /^letter\.txt: format: found "\.txt", allowed: NRRD/);
        await drop(shown, [{ name: "list.nhdr" }]);
        assert.match(await text(shown, "#problem"), /part0\.bin: no such file among those given: list\.nhdr/);
        await drop(shown, [{ name: "scene.toml", bytes: Buffer.from("volume.builtin = \"head:24\"\nsplatting.slab_width = -1\n") }]);
        assert.match(await text(shown, "#problem"), /splatting\.slab_width: found -1/);
        assert.match(await text(shown, "#volume"), /^head: 24 × 24 × 15/);
        assert.ok(await colors(shown) > 1);
    });
}

test("every control changes the picture, and a saved scene shows it again", async () => {
    const { page: shown, faults } = await demo(opened, "backend=cpu&workers=2&example=head:48", SMALL);
    const seen = new Set([await picture(shown)]);
    const changes = async (what, act) => {
        await act();
        let now = await picture(shown);
        for (let waited = 0; seen.has(now) && waited < 100; waited++) {
            await shown.waitForTimeout(50);
            now = await picture(shown);
        }
        assert.ok(await shown.isHidden("#problem"), `${what}: ${await text(shown, "#problem")}`);
        assert.ok(!seen.has(now), `${what} changes nothing`);
        seen.add(now);
    };
    await changes("a preset", () => shown.selectOption("#preset", "xray"));
    await changes("another preset", () => shown.selectOption("#preset", "ct-bone"));
    await changes("a colour map", () => shown.selectOption("#colormap", "viridis"));
    const point = shown.locator("#plot circle").first();
    await changes("a control point", async () => {
        await point.focus();
        await shown.keyboard.press("Shift+ArrowUp");
    });
    assert.match(await point.getAttribute("aria-label"), /^Point 1 of \d+: value .*, opacity /);
    await changes("a new point", async () => {
        const points = await shown.locator("#plot circle").count();
        await shown.click("#add");
        assert.equal(await shown.locator("#plot circle").count(), points + 1);
        await shown.keyboard.press("Shift+ArrowUp");
    });
    await changes("a point that is dragged", async () => {
        await shown.locator("#plot circle").last().scrollIntoViewIfNeeded();
        const box = await shown.locator("#plot circle").last().boundingBox();
        const [x, y] = [box.x + box.width / 2, box.y + box.height / 2];
        const label = await shown.locator("#plot circle").last().getAttribute("aria-label");
        await shown.mouse.move(x, y);
        await shown.mouse.down();
        await shown.mouse.move(x - 20, y + 15, { steps: 3 });
        await shown.mouse.up();
        assert.notEqual(await shown.locator("#plot circle").last().getAttribute("aria-label"), label);
    });
    await changes("a side of the box", () => shown.locator("#crop input").nth(1).fill("0"));
    await changes("an oblique plane", () => shown.check("#plane"));
    await shown.locator("summary", { hasText: "Light" }).click();
    await changes("occlusion", () => shown.locator("#occlusion").fill("0.7"));
    await changes("a shadow", () => shown.locator("#shadow").fill("0.6"));
    await shown.locator("summary", { hasText: "Splatting" }).click();
    await changes("the slab width", () => shown.locator("#slab-width").fill("2"));
    await changes("a compositing", () => shown.selectOption("#compositing", "maximum"));
    await changes("perspective", () => shown.check("#perspective"));
    const [saved] = await Promise.all([shown.waitForEvent("download"), shown.click("#save-scene")]);
    assert.equal(saved.suggestedFilename(), "head.toml");
    const scene = readFileSync(await saved.path(), "utf8");
    for (const words of ['builtin = "head:48"', "slab_width = 2", "occlusion = 0.7", "shadow = 0.6", 'compositing = "maximum"', "crop = ", "planes = "]) {
        assert.ok(scene.includes(words), `${words} in\n${scene}`);
    }
    const last = await picture(shown);
    await drop(shown, [{ name: "head.toml", bytes: Buffer.from(scene) }]);
    assert.equal(await picture(shown), last);
    assert.deepEqual(faults, []);
});

test("buttons save the picture, reset the camera and the opacity, and open files", async () => {
    const { page: shown, faults } = await demo(opened, "backend=cpu&workers=2", SMALL);
    await shown.selectOption("#example", "tomato:96");
    await isIdle(shown);
    assert.match(await text(shown, "#volume"), /^tomato: 96 × /);
    const start = await picture(shown);

    const [saved] = await Promise.all([shown.waitForEvent("download"), shown.click("#save-picture")]);
    assert.equal(saved.suggestedFilename(), "tomato.png");
    const png = decode(readFileSync(await saved.path()));
    const box = await shown.locator("#canvas").boundingBox();
    assert.deepEqual([png.width, png.height], [box.width, box.height].map(Math.round));
    assert.ok(new Set(png.data).size > 50);

    await shown.evaluate(() => window.view.move({ orbit: [0.3, 0.1] }));
    assert.notEqual(await picture(shown), start);
    await shown.click("#home");
    assert.equal(await picture(shown), start);

    await shown.locator("#plot circle").last().focus();
    const opacity = await shown.locator("#plot circle").last().getAttribute("aria-label");
    for (let time = 0; time < 3; time++) await shown.keyboard.press("Shift+ArrowDown");
    await sceneHas(shown, /^opacity = /);
    assert.notEqual(await shown.locator("#plot circle").last().getAttribute("aria-label"), opacity);
    await shown.click("#reset-transfer");
    await shown.waitForFunction((label) => [...document.querySelectorAll("#plot circle")].at(-1).getAttribute("aria-label") === label, opacity);
    assert.equal(await picture(shown), start);

    const [chooser] = await Promise.all([shown.waitForEvent("filechooser"), shown.click("#open")]);
    assert.ok(chooser.isMultiple());
    await chooser.setFiles({ name: "itk.nrrd", mimeType: "", buffer: fixture("itk.nrrd") });
    await shown.waitForFunction(() => document.getElementById("volume").textContent.startsWith("itk.nrrd: 5 × 4 × 3"));
    assert.equal(await shown.inputValue("#example"), "");
    assert.ok(await colors(shown) > 1);
    assert.deepEqual(faults, []);
});

test("a pick is the value under the pointer", async () => {
    for (const [backend, size] of [["cpu", SMALL], ["gpu", TINY]]) {
        const { page: shown } = await demo(opened, `backend=${backend}&example=head:32`, size);
        const box = await shown.locator("#canvas").boundingBox();
        await shown.mouse.dblclick(box.x + box.width / 2, box.y + box.height / 2);
        await shown.waitForFunction(() => /^voxel \d+, \d+, \d+: \d/.test(document.getElementById("picked").textContent));
        await shown.mouse.dblclick(box.x + 5, box.y + 5);
        await shown.waitForFunction(() => document.getElementById("picked").textContent === "nothing opaque there");
    }
});
