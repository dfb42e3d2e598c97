// The page: files and settings in, pictures out. What the user changes are overrides of a scene, by the keys of scene files.
import { SheetSplat, marks } from "../dist/index.js";
import { Clip } from "./clip.js";
import { chosen, dropped, save } from "./files.js";
import { WindowLevel, showSides } from "./looks.js";
import { Plot, short } from "./plot.js";
import { askForm, isBare } from "./raw.js";

const at = (id) => document.getElementById(id);
const query = new URLSearchParams(location.search);

/** The scene that was loaded, and what the user has changed since: the last changes that could be shown, too. */
let base = "";
let changes = {};
let accepted = {};
let facts;
/** Which channels have colours that the loaded scene states one by one. */
let ownColors = [];
let name = "";
/** The channel whose colours and opacity are edited. */
let channel = 0;
let view;

const plot = new Plot(at("plot"), (points) => change({ [of("opacity")]: points }), (told) => {
    at("point").textContent = told;
});
const clip = new Clip((settings) => change(settings), () => view);

/** The key of a transfer function's setting in a channel. */
function of(key, number = channel) {
    return `channel[${number}].transfer.${key}`;
}

function complain(error) {
    at("problem").textContent = error.message;
    at("problem").hidden = false;
    at("problem").scrollIntoView({ block: "nearest" });
}

/** Does some work, which the page shows. */
async function working(work) {
    at("busy").textContent = "Working…";
    at("problem").hidden = true;
    try {
        return await work();
    } catch (error) {
        complain(error);
        return undefined;
    } finally {
        at("busy").textContent = "";
    }
}

/** Overrides settings; `null` takes them out of the scene, `undefined` leaves them to it. Changes that come while one is applied wait, and only the
 * last of them counts. Changes that cannot be shown are taken back. */
let applying;
let isStale = false;
let keepsCamera = true;
async function change(settings, keepCamera = true) {
    Object.assign(changes, settings);
    keepsCamera &&= keepCamera;
    isStale = true;
    applying ??= (async () => {
        while (isStale) {
            const [tried, keepCamera] = [{ ...changes }, keepsCamera];
            [isStale, keepsCamera] = [false, true];
            try {
                facts = await view.setScene(base, { set: tried, keepCamera });
                accepted = tried;
                at("problem").hidden = true;
            } catch (error) {
                complain(error);
                if (!isStale) changes = { ...accepted };
            }
        }
        applying = undefined;
        show();
    })();
    await applying;
}

/** Shows what the scene has: every control follows it. */
function show() {
    const { dims, unit, format } = facts;
    const size = dims.join(" × ");
    setText("volume", `${name}: ${size}${format ? `, ${format}` : ""}${unit ? `, in ${unit}` : ""}`);
    const shown = facts.channels[channel];
    at("preset").value = facts.preset ?? "";
    at("compositing").options[0].textContent = `of the preset (${facts.presetCompositing})`;
    at("compositing").value = facts.compositing === facts.presetCompositing ? "" : facts.compositing;
    at("perspective").checked = facts.projection === "perspective";
    at("slab-width").max = Math.max(4, facts.slabWidth);
    const sliders = { "slab-width": facts.slabWidth, "occlusion": facts.occlusion, "shadow": facts.shadow };
    for (const [id, value] of Object.entries(sliders)) {
        at(id).value = value;
        at(id).setAttribute("aria-valuetext", short(value));
        at(`${id}-value`).textContent = short(value);
    }
    showColormap(shown);
    for (const row of at("channels").children) {
        const number = Number(row.dataset.number);
        const [box, edit] = row.children;
        box.checked = facts.channels[number].visible;
        edit.setAttribute("aria-pressed", String(number === channel));
        edit.style.setProperty("--channel", `rgb(${(facts.channels[number].color.at(-1)?.[1] ?? [1, 1, 1]).map((share) => share * 255)})`);
    }
    clip.show(facts);
    at("low").textContent = short(shown.range[0]);
    at("high").textContent = short(shown.range[1]);
    // A point that is being moved stays where the pointer is.
    if (!at("plot").contains(document.activeElement)) plot.show(shown);
    else plot.recolor(shown);
}

/** Texts that are read aloud when they change are written only then. */
function setText(id, text) {
    if (at(id).textContent !== text) at(id).textContent = text;
}

/** The colour maps, and which of them the edited channel has. */
function showColormap({ name, colormap, hasColors }) {
    const own = ownColors[channel] ? [option("own", "of the scene")] : [];
    const maps = facts.colormaps.filter((map) => map !== "file" || map === colormap);
    at("colormap").replaceChildren(option("", "of the preset"), ...own, ...maps.map((map) => option(map, map)));
    at("colormap").value = colormap ?? (hasColors && ownColors[channel] ? "own" : "");
    at("colormap-name").textContent = facts.channels.length > 1 ? `Colour map of ${name}` : "Colour map";
}

function option(value, text) {
    const made = document.createElement("option");
    [made.value, made.textContent] = [value, text];
    return made;
}

/** Sets the controls up for another volume. */
function begin() {
    channel = 0;
    // A scene of one channel shows all channels by its settings; one that names the last channel has settings for each.
    const last = facts.channels.length - 1;
    changes = last > 0 ? { [`channel[${last}].visible`]: facts.channels[last].visible } : {};
    accepted = { ...changes };
    ownColors = facts.channels.map(({ hasColors }) => hasColors);
    const suggested = facts.suggested ? ` (${facts.suggested} fits)` : "";
    at("preset").replaceChildren(option("", `automatic${suggested}`), ...presets().map((preset) => option(preset, preset)));
    const several = facts.channels.length > 1;
    at("channels").hidden = !several;
    at("channels").replaceChildren(...(several ? facts.channels.map(channelOf) : []));
    at("settings").disabled = false;
    at("hint").hidden = true;
    at("picked").textContent = "";
    showSides(facts, view);
    document.activeElement?.closest?.("#plot") && document.activeElement.blur();
    show();
}

/** The presets that suit the volume, and the scene's. */
function presets() {
    return [...new Set([...facts.presets, ...(facts.preset ? [facts.preset] : [])])];
}

/** A channel's switch, and a button that has the plot and the colour map edit it. */
function channelOf({ name }, number) {
    const row = document.createElement("div");
    row.dataset.number = number;
    const box = Object.assign(document.createElement("input"), { type: "checkbox" });
    box.setAttribute("aria-label", `Show ${name}`);
    box.addEventListener("change", () => change({ [`channel[${number}].visible`]: box.checked }));
    const edit = Object.assign(document.createElement("button"), { type: "button", textContent: name, title: "Edit its colours and opacity" });
    edit.setAttribute("aria-label", `Edit ${name}`);
    edit.addEventListener("click", () => {
        channel = number;
        show();
    });
    row.append(box, edit);
    return row;
}

/** Loads files, or what `files.js` makes of folders. */
async function load(files) {
    const form = isBare(files) ? await askForm(files[0]) : {};
    if (files.length === 0 || !form) return;
    await working(async () => {
        const scene = files.find((file) => /\.toml$/i.test(file.name));
        const text = scene ? await (scene.data ?? scene).text() : form;
        at("warnings").replaceChildren();
        const loaded = await view.loadFile(files, scene ? {} : { scene: form });
        [facts, base] = [loaded, text];
        name = files.length === 1 ? files[0].name : `${files.length} files`;
        at("example").value = "";
        begin();
    });
}

async function example(builtin) {
    await working(async () => {
        const text = `volume.builtin = ${JSON.stringify(builtin)}\n`;
        at("warnings").replaceChildren();
        facts = await view.setScene(text);
        [base, name] = [text, builtin.split(":")[0]];
        at("example").value = builtin;
        if (at("example").value !== builtin) at("example").value = "";
        begin();
    });
}

/** A file's name without its extensions. */
function stem() {
    return name.replace(/(\.nii|\.mgh)?\.\w+$/, "") || "picture";
}

function showStats(stats) {
    const workers = `${stats.workers} ${stats.workers === 1 ? "worker" : "workers"}`;
    const rows = {
        "Drawn by": stats.backend === "gpu" ? `WebGPU${stats.adapter ? `, ${stats.adapter}` : ""}` : `CPU, ${workers}, ${stats.driver}`,
        "Time": `${Math.round(stats.prepare_ms + stats.frame_ms)} ms`,
        "Pixels": `${stats.width} × ${stats.height}`,
        "Voxels in range": stats.voxels_in_range.toLocaleString("en"),
        "Voxels shaded": stats.voxels_shaded.toLocaleString("en"),
        "Kernel sections": stats.sections_rasterized.toLocaleString("en"),
        "Sheets": stats.sheets.toLocaleString("en"),
    };
    at("stats").tBodies[0].replaceChildren(...Object.entries(rows).map(([key, value]) => {
        const row = document.createElement("tr");
        row.append(Object.assign(document.createElement("th"), { textContent: key, scope: "row" }), Object.assign(document.createElement("td"), { textContent: value }));
        return row;
    }));
}

/** What opens files: buttons, and dropping. */
function listenForFiles() {
    for (const [button, input, read] of [["open", "files", (files) => [...files]], ["open-folder", "folder", chosen]]) {
        at(button).addEventListener("click", () => at(input).click());
        at(input).addEventListener("change", async () => {
            await load(read(at(input).files));
            // The same file can be chosen again.
            at(input).value = "";
        });
    }
    at("example").addEventListener("change", () => at("example").value && example(at("example").value));
    document.addEventListener("dragover", (event) => {
        event.preventDefault();
        at("stage").classList.add("dropping");
    });
    document.addEventListener("dragleave", (event) => event.relatedTarget ?? at("stage").classList.remove("dropping"));
    document.addEventListener("drop", async (event) => {
        event.preventDefault();
        at("stage").classList.remove("dropping");
        const files = dropped(event.dataTransfer);
        await load(await working(() => files) ?? []);
    });
}

/** What changes the scene. */
function listenForSettings() {
    at("preset").addEventListener("change", () => {
        // A preset has colours, opacities, light and compositing of its own. A colour map that was chosen stays.
        const own = Object.fromEntries(facts.channels.flatMap((_, number) => [[of("opacity", number), null], [of("color", number), null]]));
        change({ ...own, "splatting.compositing": null, "shading": null, "preset": at("preset").value || null });
    });
    at("colormap").addEventListener("change", () => {
        const map = at("colormap").value;
        if (map === "own") change({ [of("colormap")]: undefined, [of("color")]: undefined });
        else change({ [of("colormap")]: map || null, [of("color")]: null });
    });
    at("add").addEventListener("click", () => plot.add());
    at("reset-transfer").addEventListener("click", () => change({ [of("opacity")]: null }));
    for (const [id, key] of [["slab-width", "splatting.slab_width"], ["occlusion", "shading.occlusion"], ["shadow", "shading.shadow"]]) {
        at(id).addEventListener("input", () => change({ [key]: Number(at(id).value) }));
    }
    at("compositing").addEventListener("change", () => change({ "splatting.compositing": at("compositing").value || null }));
    // Another projection is another camera.
    at("perspective").addEventListener("change", () => {
        change({ "camera.projection": at("perspective").checked ? "perspective" : "orthographic" }, false);
    });
}

/** What else the page does. */
function listenForTheRest() {
    view.on("frame", showStats);
    view.on("error", complain);
    const range = new WindowLevel();
    view.on("window", (dragged) => facts && change(range.settings(dragged, facts.channels[channel], of)));
    let end = marks(view);
    at("marks").addEventListener("change", () => {
        end();
        end = at("marks").checked ? marks(view) : () => {};
    });
    view.on("warning", (message) => {
        at("warnings").append(Object.assign(document.createElement("li"), { textContent: message }));
    });
    view.on("move", () => {
        at("picked").textContent = "";
    });
    view.on("lost", (message) => complain(new Error(`The graphics device was lost, another one is opened. ${message}`)));
    view.on("restored", () => {
        at("problem").hidden = true;
    });
    at("home").addEventListener("click", () => view.move({ home: true }));
    at("save-picture").addEventListener("click", () => working(async () => save(await view.toBlob(), `${stem()}.png`)));
    at("save-scene").addEventListener("click", () => working(async () => {
        save(new Blob([await view.scene()], { type: "application/toml" }), `${stem()}.toml`);
    }));
    // The canvas may be replaced by another one.
    at("stage").addEventListener("dblclick", async (event) => {
        if (!facts || event.target !== view.canvas) return;
        const scale = window.devicePixelRatio || 1;
        const pick = await working(() => view.pick(event.offsetX * scale, event.offsetY * scale));
        at("picked").textContent = pick
            ? `voxel ${pick.voxel.join(", ")}: ${short(pick.value)}${pick.label === null ? "" : `, label ${pick.label}`}`
            : "nothing opaque there";
    });
}

async function main() {
    const workers = query.get("workers");
    view = await SheetSplat.create(at("canvas"), { backend: query.get("backend") ?? "auto", ...(workers ? { workers: Number(workers) } : {}) });
    window.view = view;
    listenForFiles();
    listenForSettings();
    listenForTheRest();
    const first = query.get("example");
    if (first) await example(first);
    document.documentElement.dataset.ready = "true";
}

main().catch(complain);
