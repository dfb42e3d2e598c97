// The page of web/demo by the keyboard and for screen readers, as the browser's own tree of what is read aloud has it.
import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import { open } from "./browser.mjs";
import { SMALL, camera, demo, drop, fixture } from "./helpers.mjs";

let opened;
before(async () => (opened = await open({ hasWebgpu: false })));
after(() => opened.close());

/** Roles of what a person operates. */
const OPERATED = ["application", "button", "checkbox", "combobox", "slider", "listbox", "textbox", "spinbutton", "DisclosureTriangle"];

/** The elements that are read aloud: role, name, description and properties. */
async function tree(shown) {
    const session = await shown.context().newCDPSession(shown);
    const { nodes } = await session.send("Accessibility.getFullAXTree");
    return nodes.filter(({ ignored }) => !ignored).map(({ role, name, description, value, properties = [] }) => ({
        role: role?.value,
        name: name?.value ?? "",
        description: description?.value ?? "",
        value: value?.value,
        ...Object.fromEntries(properties.map((property) => [property.name, property.value.value])),
    }));
}

/** The page with two channels and everything unfolded. */
async function unfolded() {
    const { page: shown } = await demo(opened, "backend=cpu&workers=1", SMALL);
    await drop(shown, [{ name: "imagej.tif", bytes: fixture("channels", "imagej.tif") }]);
    await shown.evaluate(() => document.querySelectorAll("details").forEach((details) => (details.open = true)));
    return shown;
}

test("everything that is operated has a name of its own", async () => {
    const shown = await unfolded();
    const nodes = await tree(shown);
    const operated = nodes.filter(({ role, focusable }) => OPERATED.includes(role) || focusable);
    // The window itself can have the focus; choices are named by what they are.
    const named = operated.filter(({ role }) => !["RootWebArea", "option"].includes(role));
    assert.ok(named.length > 30, `${named.length}`);
    assert.deepEqual(named.filter(({ name }) => name.trim() === ""), []);
    const names = named.map(({ role, name }) => `${role}: ${name}`);
    assert.equal(new Set(names).size, names.length, names.join("\n"));
    for (const expected of [
        "application: Picture of the volume",
        "combobox: Example",
        "combobox: Preset",
        "slider: Azimuth",
        "slider: Slab width",
        "slider: Keep x from",
        "checkbox: Oblique plane",
        "button: Cut here",
    ]) assert.ok(names.includes(expected), `${expected} in\n${names.join("\n")}`);
    const picture = nodes.find(({ role }) => role === "application");
    assert.match(picture.description, /Arrow keys turn/);
    // Values are read with their units, not as places of the slider.
    assert.match(await shown.getAttribute("#plane-azimuth", "aria-valuetext"), /^-?\d+°$/);
    assert.ok(nodes.some(({ role, name, pressed }) => role === "button" && /^Edit /.test(name) && pressed === "true"));
});

test("what happens is read aloud", async () => {
    const { page: shown } = await demo(opened, "backend=cpu&workers=1", SMALL);
    const told = await shown.evaluateHandle(() => {
        const told = [];
        for (const id of ["busy", "volume"]) {
            new MutationObserver(() => told.push([id, document.getElementById(id).textContent])).observe(document.getElementById(id), { childList: true });
        }
        return told;
    });
    const statuses = (await tree(shown)).filter(({ role, live }) => role === "status" && live === "polite");
    assert.ok(statuses.length >= 2, "busy and volume are in the tree before they have something to tell");
    await drop(shown, [{ name: "itk.nrrd" }]);
    const texts = await told.jsonValue();
    const of = (wanted) => texts.filter(([id]) => id === wanted).map(([, text]) => text);
    assert.equal(of("busy")[0], "Working…");
    assert.equal(of("busy").at(-1), "");
    assert.deepEqual(of("volume").map((text) => text.slice(0, 9)), ["itk.nrrd:"]);
    // Changes of settings say nothing new about the volume.
    await shown.selectOption("#preset", "xray");
    await shown.waitForFunction(() => document.getElementById("compositing").options[0].textContent.includes("xray"));
    assert.equal((await told.jsonValue()).filter(([id]) => id === "volume").length, 1);
    await drop(shown, [{ name: "letter.txt", bytes: Buffer.from("Dear Sir") }]);
    assert.ok((await tree(shown)).some(({ role }) => role === "alert"));
});

test("Tab walks through everything, forwards and backwards, and keys operate it", async () => {
    const shown = await unfolded();
    const focused = () => shown.evaluate(() => {
        const element = document.activeElement;
        if (element === document.body) return "body";
        const box = element.getBoundingClientRect();
        if (box.width === 0 || box.height === 0) return `${element.outerHTML} has no size`;
        return element.id || element.getAttribute("aria-label") || element.textContent.trim();
    });
    const walk = async (key) => {
        await shown.evaluate(() => document.activeElement.blur());
        const seen = [];
        for (;;) {
            await shown.keyboard.press(key);
            const now = await focused();
            if (now === "body" || now === seen[0] || seen.length > 80) return seen;
            seen.push(now);
        }
    };
    const forwards = await walk("Tab");
    const count = await shown.locator("button:visible, select:visible, input:visible, canvas, circle, summary").count();
    assert.equal(forwards.length, count, forwards.join("\n"));
    assert.equal(new Set(forwards).size, forwards.length, "nothing is reached twice");
    assert.deepEqual(forwards.slice(0, 4), ["open", "open-folder", "example", "canvas"]);
    assert.deepEqual((await walk("Shift+Tab")).reverse(), forwards);
    // The keys of the picture are its own, and those of controls theirs.
    await shown.focus("#example");
    await shown.keyboard.press("Tab");
    const before = await camera(shown);
    await shown.keyboard.press("ArrowRight");
    assert.notDeepEqual(await camera(shown), before);
    const place = await camera(shown);
    await shown.focus("#plane-azimuth");
    await shown.keyboard.press("ArrowRight");
    await shown.waitForFunction(async () => (await window.view.scene()).includes("planes = "));
    assert.deepEqual(await camera(shown), place);
    await shown.focus("#plane");
    await shown.keyboard.press("Space");
    await shown.waitForFunction(async () => !(await window.view.scene()).includes("planes = "));
});
