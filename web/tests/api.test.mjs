// The API: scenes, files, events, the end of a view, and the ten lines of its guide.
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { decode } from "fast-png";
import { open } from "./browser.mjs";
import { api, fixture, fixtures } from "./helpers.mjs";

let opened;
before(async () => (opened = await open({ hasWebgpu: false })));
after(() => opened.close());

test("scenes are objects or texts, files are bytes or addresses, and mistakes are told", async () => {
    const { page: shown } = await api(opened);
    const bytes = fixture("c.npy").toString("base64");
    const result = await shown.evaluate(async (bytes) => {
        const message = async (work) => {
            try {
                await work();
                return "no error";
            } catch (error) {
                return error.message;
            }
        };
        const hash = async (view) => [...new Uint8Array(await crypto.subtle.digest("SHA-256", (await view.pixels()).data))].join();
        const view = await window.make([40, 30], { backend: "cpu", workers: 1 });
        const none = await message(() => view.render());
        await view.setScene("volume.builtin = \"head:16\"\nimage.background = [1, 0.5, 0, 1]\nclip.planes = [[0, 1, 0, 0]]\n");
        const ofText = await hash(view);
        await view.setScene({ volume: { builtin: "head:16" }, image: { background: [1, 0.5, 0, 1] }, clip: { planes: [[0, 1, 0, 0]] } });
        const ofObject = await hash(view);
        const key = await message(() => view.setScene({ volume: { builtin: "head:16" }, splating: {} }));
        const kept = await hash(view);
        const buffer = Uint8Array.from(atob(bytes), (letter) => letter.charCodeAt(0)).buffer;
        const { dims } = await view.loadFile(buffer, { name: "c.npy" });
        const unnamed = await message(() => view.loadFile(new ArrayBuffer(8)));
        const address = await message(() => view.loadFile("nowhere.nrrd"));
        const outside = await message(() => view.pick(40, 0));
        view.dispose();
        const ended = await message(() => view.render());
        return { none, ofText, ofObject, key, kept, dims, unnamed, address, outside, ended };
    }, bytes);
    assert.equal(result.none, "no volume is loaded");
    assert.equal(result.ofObject, result.ofText);
    assert.equal(result.kept, result.ofText);
    assert.match(result.key, /^scene: splating: /);
    assert.equal(result.dims.length, 3);
    assert.match(result.unnamed, /^volume: format: found none, allowed: NRRD/);
    assert.match(result.address, /nowhere\.nrrd: 404/);
    assert.match(result.outside, /region: found 40,0,1,1/);
    assert.equal(result.ended, "it was disposed of");
});

test("settings replace those of a scene, and null takes them out", async () => {
    const { page: shown } = await api(opened);
    const found = await shown.evaluate(async () => {
        const view = await window.make([40, 30], { backend: "cpu", workers: 1 });
        const text = "preset = \"xray\"\nvolume.builtin = \"head:16\"\n[transfer]\ncolormap = \"magma\"\n[splatting]\nslab_width = 2.0\n[shading]\nambient = 0.9\n";
        const pixels = async (...scene) => {
            const facts = await view.setScene(...scene);
            return [(await view.pixels()).data.join(), facts.preset, facts.channels[0].colormap, facts.slabWidth, facts.compositing];
        };
        const plain = await pixels("volume.builtin = \"head:16\"\n");
        const stated = await pixels(text);
        const without = await pixels(text, { set: { "preset": null, "channel[0].transfer.colormap": null, "splatting": null, "shading": null, "camera.height": null } });
        const other = await pixels(text, { set: { "preset": null, "transfer.colormap": "hot", "splatting.slab_width": 1.5, "image.background": undefined } });
        return { plain, stated, without, other };
    });
    assert.deepEqual(found.without, found.plain);
    assert.deepEqual(found.stated.slice(1), ["xray", "magma", 2, "xray"]);
    assert.deepEqual(found.other.slice(1), [null, "hot", 1.5, found.plain[4]]);
    assert.notEqual(found.stated[0], found.plain[0]);
});

test("what a reader assumes is told once for each volume", async () => {
    const { page: shown } = await api(opened);
    const bytes = fixture("sheared.nii").toString("base64");
    const found = await shown.evaluate(async (bytes) => {
        const view = await window.make([40, 30], { backend: "cpu", workers: 2 });
        const warnings = [];
        const end = view.on("warning", (message) => warnings.push(message));
        const data = Uint8Array.from(atob(bytes), (letter) => letter.charCodeAt(0)).buffer;
        const load = async () => {
            await view.loadFile(data, { name: "sheared.nii" });
            await view.setScene({ volume: { spacing: [1, 1, 2] } });
            return warnings.splice(0);
        };
        const told = [await load(), await load()];
        end();
        return [...told, await load()];
    }, bytes);
    for (const warnings of found.slice(0, 2)) {
        assert.equal(warnings.length, 1, warnings.join("; "));
        assert.match(warnings[0], /^sheared\.nii: .*shear/);
    }
    assert.deepEqual(found[2], []);
});

test("files are loaded from addresses, as bytes and by names", async () => {
    const { page: shown } = await api(opened);
    await shown.route("**/data/*", (route) => route.fulfill({ path: join(fixtures, decodeURIComponent(new URL(route.request().url()).pathname.split("/").pop())) }));
    const found = await shown.evaluate(async () => {
        const view = await window.make([40, 30], { backend: "cpu", workers: 1 });
        const shown = async (source, options) => {
            const { dims, format } = await view.loadFile(source, options);
            return [dims.join(), format, (await view.pixels()).data.join()];
        };
        const data = await (await fetch("data/itk.nrrd")).arrayBuffer();
        const named = { name: "scans/itk.nrrd", data };
        const scene = { name: "scene.toml", data: new Blob(["volume.path = \"scans/itk.nrrd\"\n"]) };
        return [
            await shown(new URL("data/itk.nrrd", document.baseURI)),
            await shown("data/itk.nrrd"),
            await shown(data, { name: "itk.nrrd" }),
            await shown(new File([data], "itk.nrrd")),
            await shown([scene, named]),
            await shown(["data/list.nhdr", "data/part0.bin", "data/part1.bin", "data/part2.bin"]),
        ];
    });
    assert.deepEqual(found[0].slice(0, 2), ["5,4,3", "NRRD"]);
    for (const other of found.slice(1, 5)) assert.deepEqual(other, found[0]);
    assert.equal(found[5][1], "NRRD");
});

test("events tell of volumes, moves, frames and failures, until they are no longer wanted", async () => {
    const { page: shown } = await api(opened);
    const found = await shown.evaluate(async () => {
        const view = await window.make([40, 30], { backend: "cpu", workers: 1, controls: true });
        const told = [];
        const endings = ["load", "move", "frame", "error"].map((name) => view.on(name, (detail) => told.push([name, detail])));
        const failed = () => new Promise((resolve) => view.on("error", resolve));
        await view.setScene("volume.builtin = \"head:12\"");
        const loaded = told.splice(0);
        view.move({ zoom: 0.5 });
        await view.render();
        const moved = told.splice(0);
        const failure = failed();
        view.move({ zoom: NaN });
        const message = (await failure).message;
        const errors = told.splice(0);
        // The camera returns, and pictures with it.
        view.move({ home: true });
        const { width } = await view.render();
        for (const end of endings) end();
        told.length = 0;
        view.move({ orbit: [0.1, 0] });
        await view.setScene("volume.builtin = \"head:12\"");
        return { loaded, moved, message, errors, width, silent: told.length };
    });
    const names = (events) => events.map(([name]) => name);
    assert.deepEqual(names(found.loaded), ["load", "frame"]);
    assert.deepEqual(found.loaded[0][1].dims.slice(0, 2), [12, 12]);
    assert.deepEqual([found.loaded[1][1].width, found.loaded[1][1].height], [40, 30]);
    assert.deepEqual(names(found.moved).slice(0, 2), ["move", "frame"]);
    assert.match(found.message, /camera\.height: found NaN/);
    assert.ok(names(found.errors).includes("error"));
    assert.equal(found.width, 40);
    assert.equal(found.silent, 0);
});

test("the end of a view ends its workers", async () => {
    const { page: shown, faults } = await api(opened);
    const workers = () => shown.workers().length;
    await shown.evaluate(async () => {
        const view = await window.make([64, 48], { backend: "cpu", workers: 3, controls: true });
        await view.setScene("volume.builtin = \"head:12\"");
    });
    assert.ok(workers() >= 1, "there are workers");
    const ended = new Promise((resolve) => shown.workers()[0].once("close", resolve));
    const waiting = await shown.evaluate(async () => {
        const waiting = window.view.render().then(() => "drawn", (error) => error.message);
        window.view.dispose();
        return await waiting;
    });
    assert.equal(waiting, "it was disposed of");
    await ended;
    for (let waited = 0; workers() > 0 && waited < 100; waited++) await shown.waitForTimeout(50);
    assert.equal(workers(), 0);
    // What is disposed of hears nothing any more, and can be disposed of again.
    const heard = await shown.evaluate(() => {
        let heard = 0;
        window.view.on("move", () => (heard += 1));
        window.view.canvas.dispatchEvent(new KeyboardEvent("keydown", { key: "ArrowRight" }));
        window.view.dispose();
        return heard;
    });
    assert.equal(heard, 0);
    assert.deepEqual(faults, []);
});

test("the page stays alive during a long frame", async () => {
    const { page: shown } = await api(opened);
    const { ticks, frame } = await shown.evaluate(async () => {
        const view = await window.make([512, 512], { backend: "cpu", workers: 1 });
        await view.setScene("volume.builtin = \"head:64\"\nsplatting.slab_width = 0.5\n");
        let isDrawn = false;
        const drawing = view.render().then((stats) => {
            isDrawn = true;
            return stats;
        });
        let ticks = 0;
        while (!isDrawn) {
            await new Promise((resolve) => setTimeout(resolve, 1));
            ticks += 1;
        }
        return { ticks, frame: (await drawing).frame_ms };
    });
    // A page that waits for the frame has one tick, however long it takes.
    assert.ok(frame > 20, `the frame takes ${frame} ms`);
    assert.ok(ticks >= 3, `${ticks} ticks in ${frame} ms`);
});

test("the ten lines of the guide do what it says", async () => {
    const guide = readFileSync(join(fixtures, "..", "..", "docs", "guide", "web.md"), "utf8");
    const example = guide.match(/## Ten lines\n[\s\S]*?```html\n([\s\S]*?)```/)[1];
    assert.ok(example.trim().split("\n").length <= 12, "about ten lines");
    const { page: shown, faults } = await api(opened);
    // Beside dist/, as the guide says.
    await shown.route("**/ten.html", (route) => route.fulfill({ contentType: "text/html", body: `<!doctype html><title>Ten</title><link rel="icon" href="data:,">${example}` }));
    await shown.goto(`${opened.url}ten.html`);
    const shot = async () => decode(await shown.locator("#view").screenshot()).data;
    const isDrawn = async (before) => {
        for (let waited = 0; waited < 200; waited++) {
            const now = await shot();
            if (new Set(now).size > 20 && (!before || Buffer.compare(Buffer.from(now), Buffer.from(before)) !== 0)) return now;
            await shown.waitForTimeout(50);
        }
        throw new Error("nothing is drawn");
    };
    const head = await isDrawn();
    await shown.setInputFiles("#file", { name: "nifti.nii", mimeType: "", buffer: fixture("sform.nii") });
    await isDrawn(head);
    await shown.setInputFiles("#file", { name: "letter.txt", mimeType: "", buffer: Buffer.from("Dear Sir") });
    await shown.waitForFunction(() => document.getElementById("problem").value.startsWith("letter.txt: format: "));
    assert.deepEqual(faults, []);
});
