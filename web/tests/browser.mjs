// A headless browser for the tests, and the goldens that they compare with.
import { readFileSync } from "node:fs";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";
import { decode } from "fast-png";
import { chromium } from "playwright-core";
import { serve } from "./serve.mjs";

const root = dirname(dirname(dirname(fileURLToPath(import.meta.url))));

/** Pages' pictures have the colours that canvases have. */
const FLAGS = ["--no-sandbox", "--force-color-profile=srgb"];
/** Those that give Debian's Chromium WebGPU without a GPU. */
const WEBGPU = [
    "--enable-unsafe-webgpu",
    "--ignore-gpu-blocklist",
    "--enable-gpu",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--enable-features=Vulkan",
    "--use-vulkan=swiftshader",
];

/** Opens a browser and a server; `close` ends both. */
export async function open({ hasWebgpu = true } = {}) {
    const { server, url } = await serve();
    const args = [...FLAGS, ...(hasWebgpu ? WEBGPU : [])];
    const browser = await chromium.launch({ executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium", args });
    const close = async () => {
        await browser.close();
        server.closeAllConnections();
        server.close();
    };
    return { browser, url, close };
}

/** A page of the server, and what it has logged as errors. `inWorkers` is a script that its workers run first. */
export async function page(browser, address, { inWorkers, ...options } = {}) {
    const context = await browser.newContext({ viewport: { width: 800, height: 600 }, ...options });
    const opened = await context.newPage();
    const faults = [];
    opened.on("pageerror", (error) => faults.push(String(error)));
    opened.on("console", (message) => message.type() === "error" && faults.push(message.text()));
    opened.on("requestfailed", (request) => faults.push(`${request.url()}: ${request.failure()?.errorText}`));
    if (inWorkers) {
        await context.route(/worker[^/]*\.js/, async (route) => {
            const response = await route.fetch();
            await route.fulfill({ response, body: `${inWorkers}\n${await response.text()}` });
        });
    }
    await opened.goto(address);
    return { page: opened, faults };
}

/** The scenes of tests/golden_scenes as texts of scene files, with the sizes and channels of their goldens. */
export function goldens() {
    const source = readFileSync(join(root, "tests", "golden_scenes", "mod.rs"), "utf8");
    const table = source.slice(source.indexOf("const SCENES"));
    const text = String.raw`"((?:[^"\\]|\\[\s\S])*)"`;
    const count = Number(table.match(/; (\d+)\]/)[1]);
    const rows = [...table.matchAll(new RegExp(String.raw`\(\s*${text},\s*${text},\s*&\[([\s\S]*?)\],?\s*\)(?=,|\s*\])`, "g"))];
    if (rows.length !== count) throw new Error(`tests/golden_scenes/mod.rs: found ${rows.length} of ${count} scenes`);
    const unescaped = (literal) => literal.replace(/\\\n\s*/g, "").replace(/\\(.)/g, "$1");
    return rows.map(([, name, volume, list]) => {
        const settings = [...list.matchAll(new RegExp(text, "g"))].map(([, literal]) => unescaped(literal));
        const png = decode(readFileSync(join(root, "tests", "goldens", `${name}.png`)));
        return { name, text: scene(name, volume, settings), size: [png.width, png.height], png };
    });
}

/** What `scene` in tests/goldens.rs makes of a row. */
function scene(name, volume, settings) {
    const added = {
        camera: "fit = \"volume\"",
        splatting: `opacity_threshold = 0.999, classification = "${name.startsWith("after-") ? "after" : "before"}"`,
    };
    const lines = settings.map((setting) => {
        const [, table] = setting.match(/^(\w+)=\{/) ?? [];
        if (!(table in added)) return setting;
        const more = added[table];
        delete added[table];
        return setting.replace("{", `{${more}, `);
    });
    for (const [table, more] of Object.entries(added)) lines.push(...more.split(", ").map((line) => `${table}.${line}`));
    // A scene of channels names the volume in the first one.
    const at = lines.findIndex((line) => line.startsWith("channel=[{"));
    if (at < 0) return [`volume.builtin="${volume}"`, ...lines, ""].join("\n");
    lines[at] = lines[at].replace("[{", `[{volume={builtin="${volume}"},`);
    return [...lines, ""].join("\n");
}
