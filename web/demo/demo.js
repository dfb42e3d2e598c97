// The page: files and settings in, pictures out. What the user changes are overrides of a scene, by the keys of scene files.
import { SheetSplat } from "../dist/index.js";
import { Plot, short } from "./plot.js";

const at = (id) => document.getElementById(id);
const query = new URLSearchParams(location.search);

/** The scene that was loaded, and what the user has changed since. */
let base = "";
let changes = {};
let facts;
let name = "";
/** The channel whose opacity the plot shows. */
let channel = 0;
let view;

const plot = new Plot(at("plot"), (points) => change({ [of("opacity")]: points }), (told) => {
    at("point").textContent = told;
});

/** The key of a transfer function's setting in the current channel. */
function of(key) {
    return facts.channels.length > 1 ? `channel[${channel}].transfer.${key}` : `transfer.${key}`;
}

function complain(error) {
    at("problem").textContent = error.message;
    at("problem").hidden = false;
    at("problem").scrollIntoView({ block: "nearest" });
}

/** Does some work, which the page shows. */
async function working(work) {
    at("busy").hidden = false;
    at("problem").hidden = true;
    try {
        return await work();
    } catch (error) {
        complain(error);
        return undefined;
    } finally {
        at("busy").hidden = true;
    }
}

/** Overrides settings; `undefined` takes an override back. Changes that come while one is applied wait, and only the last of them counts. */
let applying;
let isStale = false;
async function change(settings) {
    Object.assign(changes, settings);
    isStale = true;
    applying ??= (async () => {
        while (isStale) {
            isStale = false;
            try {
                facts = await view.setScene(base, { set: changes, keepCamera: true });
                at("problem").hidden = true;
            } catch (error) {
                complain(error);
            }
        }
        applying = undefined;
        // A point that is being dragged stays where the pointer is.
        if (!at("plot").contains(document.activeElement)) show();
    })();
    await applying;
}

/** Shows what the scene has. */
function show() {
    const { dims, unit, format } = facts;
    const size = dims.join(" × ");
    at("volume").textContent = `${name}: ${size}${format ? `, ${format}` : ""}${unit ? `, in ${unit}` : ""}`;
    const shown = facts.channels[channel];
    plot.show(shown);
    at("low").textContent = short(shown.range[0]);
    at("high").textContent = short(shown.range[1]);
}

function option(value, text) {
    const made = document.createElement("option");
    [made.value, made.textContent] = [value, text];
    return made;
}

/** Sets the controls up for another volume. */
function begin() {
    channel = 0;
    const suggested = facts.suggested ? ` (${facts.suggested} fits)` : "";
    at("preset").replaceChildren(option("", `automatic${suggested}`), ...facts.presets.map((preset) => option(preset, preset)));
    at("colormap").replaceChildren(option("", "of the preset"), ...facts.colormaps.filter((map) => map !== "file").map((map) => option(map, map)));
    at("compositing").value = "";
    at("perspective").checked = false;
    at("slab-width").value = 1;
    at("slab-width-value").textContent = "1";
    const half = facts.dims.map((count, axis) => (count * facts.spacing[axis]) / 2);
    const heads = Object.assign(document.createElement("div"), { className: "axis heads" });
    heads.append(...["", "from", "to"].map((textContent) => Object.assign(document.createElement("span"), { textContent })));
    at("clip").replaceChildren(heads, ...["x", "y", "z"].map((axis, number) => axisOf(axis, half[number])));
    const several = facts.channels.length > 1;
    at("channels").hidden = !several;
    at("channels").replaceChildren(...(several ? facts.channels.map(channelOf) : []));
    at("settings").disabled = false;
    at("hint").hidden = true;
    at("picked").textContent = "";
    show();
}

/** Two sliders that cut the volume off along an axis. */
function axisOf(axis, half) {
    const row = document.createElement("div");
    row.className = "axis";
    row.append(Object.assign(document.createElement("span"), { textContent: axis }));
    for (const [end, value] of [["from", -half], ["to", half]]) {
        const label = document.createElement("label");
        const slider = Object.assign(document.createElement("input"), { type: "range", min: -half, max: half, step: half / 100, value });
        slider.dataset.end = end;
        slider.setAttribute("aria-label", `${axis} ${end}`);
        slider.addEventListener("input", clip);
        label.append(slider);
        row.append(label);
    }
    return row;
}

function clip() {
    const ends = (end) => [...document.querySelectorAll(`#clip input[data-end=${end}]`)].map((slider) => Number(slider.value));
    const [low, high] = [ends("from"), ends("to")];
    const [min, max] = [low.map((value, axis) => Math.min(value, high[axis])), high.map((value, axis) => Math.max(value, low[axis]))];
    // An empty box shows nothing and is refused: a hair is kept.
    const crop = [min, max.map((value, axis) => (value > min[axis] ? value : min[axis] + 1e-3))];
    change({ "clip.crop": crop });
}

/** A channel's switch, and a button that shows its opacity in the plot. */
function channelOf({ name }, number) {
    const label = document.createElement("label");
    const box = Object.assign(document.createElement("input"), { type: "checkbox", checked: true });
    box.setAttribute("aria-label", `Show ${name}`);
    box.addEventListener("change", () => change({ [`channel[${number}].visible`]: box.checked }));
    const edit = Object.assign(document.createElement("button"), { type: "button", textContent: name });
    edit.addEventListener("click", () => {
        channel = number;
        show();
    });
    label.append(box, edit);
    return label;
}

async function load(files) {
    if (files.length === 0) return;
    await working(async () => {
        const scene = files.find((file) => /\.toml$/i.test(file.name));
        const text = scene ? await scene.text() : "";
        const loaded = await view.loadFile(files);
        [facts, base, changes] = [loaded, text, {}];
        name = files.length === 1 ? files[0].name : `${files.length} files`;
        at("example").value = "";
        begin();
    });
}

async function example(builtin) {
    await working(async () => {
        const text = `volume.builtin = ${JSON.stringify(builtin)}\n`;
        facts = await view.setScene(text);
        [base, changes, name] = [text, {}, builtin.split(":")[0]];
        at("example").value = builtin;
        if (at("example").value !== builtin) at("example").value = "";
        begin();
    });
}

function save(blob, file) {
    const link = Object.assign(document.createElement("a"), { href: URL.createObjectURL(blob), download: file });
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
}

/** A file's name without its extensions. */
function stem() {
    return name.replace(/(\.nii|\.mgh)?\.\w+$/, "") || "picture";
}

function showStats(stats) {
    const rows = {
        "Drawn by": stats.backend === "gpu" ? `WebGPU, ${stats.adapter}` : `CPU, ${stats.workers} ${stats.workers === 1 ? "worker" : "workers"}, ${stats.driver}`,
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

async function main() {
    const workers = query.get("workers");
    view = await SheetSplat.create(at("canvas"), { backend: query.get("backend") ?? "auto", ...(workers ? { workers: Number(workers) } : {}) });
    window.view = view;
    view.on("frame", showStats);
    view.on("error", complain);
    view.on("move", () => {
        at("picked").textContent = "";
    });
    view.on("lost", (message) => complain(new Error(`The graphics device was lost, another one is opened. ${message}`)));
    view.on("restored", () => {
        at("problem").hidden = true;
    });

    at("open").addEventListener("click", () => at("files").click());
    at("files").addEventListener("change", () => load([...at("files").files]));
    at("example").addEventListener("change", () => at("example").value && example(at("example").value));
    document.addEventListener("dragover", (event) => {
        event.preventDefault();
        at("stage").classList.add("dropping");
    });
    document.addEventListener("dragleave", (event) => event.relatedTarget ?? at("stage").classList.remove("dropping"));
    document.addEventListener("drop", (event) => {
        event.preventDefault();
        at("stage").classList.remove("dropping");
        load([...event.dataTransfer.files]);
    });

    at("preset").addEventListener("change", () => {
        // A preset has opacities of its own.
        for (const key of Object.keys(changes)) if (/opacity$/.test(key)) delete changes[key];
        change({ preset: at("preset").value || undefined });
    });
    at("colormap").addEventListener("change", () => change({ [of("colormap")]: at("colormap").value || undefined }));
    at("add").addEventListener("click", () => plot.add());
    at("reset-transfer").addEventListener("click", () => change({ [of("opacity")]: undefined }));
    at("slab-width").addEventListener("input", () => {
        const width = Number(at("slab-width").value);
        at("slab-width-value").textContent = short(width);
        change({ "splatting.slab_width": width === 1 ? undefined : width });
    });
    at("compositing").addEventListener("change", () => change({ "splatting.compositing": at("compositing").value || undefined }));
    at("perspective").addEventListener("change", async () => {
        changes["camera.projection"] = at("perspective").checked ? "perspective" : undefined;
        // Another projection is another camera.
        await working(async () => {
            facts = await view.setScene(base, { set: changes });
        });
    });
    at("home").addEventListener("click", () => view.move({ home: true }));
    at("save-picture").addEventListener("click", () => working(async () => save(await view.toBlob(), `${stem()}.png`)));
    at("save-scene").addEventListener("click", () => working(async () => {
        save(new Blob([await view.scene()], { type: "application/toml" }), `${stem()}.toml`);
    }));
    at("canvas").addEventListener("dblclick", async (event) => {
        if (!facts) return;
        const scale = window.devicePixelRatio || 1;
        const pick = await working(() => view.pick(event.offsetX * scale, event.offsetY * scale));
        at("picked").textContent = pick
            ? `voxel ${pick.voxel.join(", ")}: ${short(pick.value)}${pick.label === null ? "" : `, label ${pick.label}`}`
            : "nothing opaque there";
    });

    const first = query.get("example");
    if (first) await example(first);
    document.documentElement.dataset.ready = "true";
}

main().catch(complain);
