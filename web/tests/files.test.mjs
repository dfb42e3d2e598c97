// Folders: dropped as by a person, and chosen.
import assert from "node:assert/strict";
import { cpSync, mkdirSync, mkdtempSync, readdirSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { open } from "./browser.mjs";
import { SMALL, colors, demo, fixtures, isIdle, picture, text } from "./helpers.mjs";

let opened;
let folder;
before(async () => {
    opened = await open({ hasWebgpu: false });
    folder = mkdtempSync(join(tmpdir(), "sheetsplat-web-"));
});
after(async () => {
    rmSync(folder, { recursive: true });
    await opened.close();
});

/** Drops files and folders of this machine onto the picture. */
async function drop(shown, paths) {
    const session = await shown.context().newCDPSession(shown);
    const box = await shown.locator("#canvas").boundingBox();
    for (const type of ["dragEnter", "dragOver", "drop"]) {
        await session.send("Input.dispatchDragEvent", {
            type,
            x: box.x + box.width / 2,
            y: box.y + box.height / 2,
            data: { items: [], files: paths, dragOperationsMask: 1 },
        });
    }
    await isIdle(shown);
}

test("a folder of slices is a volume, and a scene's folder has what it names", async () => {
    const slices = join(folder, "slices");
    mkdirSync(slices);
    for (const name of readdirSync(join(fixtures, "slices"))) cpSync(join(fixtures, "slices", name), join(slices, name));
    // Systems leave files in folders.
    writeFileSync(join(slices, ".DS_Store"), "clutter");
    writeFileSync(join(slices, "Thumbs.db"), "clutter");
    const { page: shown, faults } = await demo(opened, "backend=cpu&workers=1", SMALL);
    await drop(shown, [slices]);
    await shown.waitForFunction(() => !document.getElementById("volume").textContent.startsWith("No volume"));
    assert.equal(await text(shown, "#problem"), "");
    assert.match(await text(shown, "#volume"), /^\d+ files: .*TIFF/);
    assert.ok(await colors(shown) > 1);
    const dropped = await picture(shown);
    const dims = await text(shown, "#volume");

    const scene = join(folder, "scene");
    mkdirSync(join(scene, "data"), { recursive: true });
    cpSync(join(fixtures, "itk.nrrd"), join(scene, "data", "itk.nrrd"));
    writeFileSync(join(scene, "a.toml"), "volume.path = \"data/itk.nrrd\"\n");
    await drop(shown, [scene]);
    await shown.waitForFunction(() => document.getElementById("volume").textContent.includes("5 × 4 × 3"));
    assert.equal(await text(shown, "#problem"), "");

    const [chooser] = await Promise.all([shown.waitForEvent("filechooser"), shown.click("#open-folder")]);
    await chooser.setFiles(slices);
    await shown.waitForFunction((dims) => document.getElementById("volume").textContent === dims, dims);
    assert.equal(await picture(shown), dropped);
    assert.deepEqual(faults, []);
});
