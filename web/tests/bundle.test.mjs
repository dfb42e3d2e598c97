// The package in an application that vite bundles or serves, as the guide tells.
import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { cpSync, mkdirSync, mkdtempSync, readFileSync, readdirSync, rmSync, writeFileSync } from "node:fs";
import { createRequire } from "node:module";
import { tmpdir } from "node:os";
import { dirname, join } from "node:path";
import { after, before, test } from "node:test";
import { fileURLToPath } from "node:url";
import { build, createServer } from "vite";
import { open, page } from "./browser.mjs";
import { HARDWARE } from "./helpers.mjs";
import { serve } from "./serve.mjs";

const web = dirname(dirname(fileURLToPath(import.meta.url)));
const guide = readFileSync(join(web, "..", "docs", "guide", "web.md"), "utf8");
/** The guide's blocks of a language after a heading. */
const blocks = (heading, language) => {
    const section = guide.split(`\n## ${heading}\n`)[1].split("\n## ")[0];
    return [...section.matchAll(new RegExp(`\`\`\`${language}\\n([\\s\\S]*?)\`\`\``, "g"))].map(([, code]) => code);
};

let opened;
/** An application with the package installed. */
let root;
before(async () => {
    opened = await open();
    root = mkdtempSync(join(tmpdir(), "sheetsplat-bundle-"));
    const installed = join(root, "node_modules", "sheetsplat");
    mkdirSync(installed, { recursive: true });
    const { files } = JSON.parse(readFileSync(join(web, "package.json")));
    for (const name of ["package.json", ...files]) cpSync(join(web, name), join(installed, name), { recursive: true });
    const [application, config] = blocks("With a bundler", "js");
    writeFileSync(join(root, "index.html"), "<!doctype html><title>App</title><link rel=\"icon\" href=\"data:,\"><canvas id=\"view\"></canvas><script type=\"module\" src=\"./main.js\"></script>");
    writeFileSync(join(root, "main.js"), `${application}\nwindow.made = view;\n`);
    writeFileSync(join(root, "vite.config.js"), config);
    writeFileSync(join(root, "package.json"), JSON.stringify({ type: "module", dependencies: { sheetsplat: "*" } }));
});
after(async () => {
    rmSync(root, { recursive: true });
    await opened.close();
});

/** Opens the application, and checks that it draws by the GPU, and with another worker on the CPU. */
async function draws(address) {
    for (const [inWorkers, backend] of [[HARDWARE, "gpu"], ["Object.defineProperty(navigator, 'gpu', { value: undefined });", "cpu"]]) {
        const { page: shown, faults } = await page(opened.browser, address, { inWorkers });
        await shown.waitForFunction(() => window.made, undefined, { timeout: 20_000 }).catch((error) => {
            throw new Error(`${error.message}\n${faults.join("\n")}`);
        });
        assert.equal(await shown.evaluate(() => window.made.backend), backend);
        const stats = await shown.evaluate(() => window.made.render());
        assert.ok(stats.sections_rasterized > 100, JSON.stringify(stats));
        assert.deepEqual(faults, []);
        await shown.context().close();
    }
}

test("vite's bundle has the worker and the WebAssembly files, and works in a sub-path", async () => {
    await build({ root, base: "./", logLevel: "error" });
    const names = readdirSync(join(root, "dist", "assets"));
    for (const pattern of [/^worker-.*\.js$/, /^cpu_bg-.*\.wasm$/, /^gpu_bg-.*\.wasm$/]) {
        assert.equal(names.filter((name) => pattern.test(name)).length, 1, names.join());
    }
    const { server, url } = await serve(0, join(root, "dist"));
    try {
        await draws(url);
    } finally {
        server.closeAllConnections();
        server.close();
    }
});

test("vite's development server serves it", async () => {
    const server = await createServer({ root, logLevel: "error", server: { port: 0, host: "localhost" } });
    try {
        await server.listen();
        await draws(server.resolvedUrls.local[0]);
    } finally {
        await server.close();
    }
});

test("the package's files can be named by those who copy them", () => {
    const require = createRequire(join(root, "main.js"));
    for (const name of ["cpu_bg.wasm", "gpu_bg.wasm", "worker.js", "package.json"]) {
        assert.ok(readFileSync(require.resolve(`sheetsplat/${name}`)).length > 100, name);
    }
});

test("the package holds its README, its licences and nothing but the build", () => {
    const [{ files }] = JSON.parse(execFileSync("npm", ["pack", "--dry-run", "--json"], { cwd: web, encoding: "utf8" }));
    const names = files.map(({ path }) => path).filter((path) => !path.startsWith("dist/"));
    assert.deepEqual(names.sort(), ["LICENSE-APACHE", "LICENSE-MIT", "README.md", "package.json"]);
});
