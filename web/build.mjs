// Builds the package into dist/: the library as WebAssembly with vector instructions, its bindings, and the page's API.
//   node build.mjs
// Needs Rust's target wasm32-unknown-unknown and the wasm-bindgen of Cargo.lock's version, which `.ci/setup --web` installs.
import { execFileSync } from "node:child_process";
import { copyFileSync, existsSync, mkdirSync, readFileSync, renameSync, rmSync, writeFileSync } from "node:fs";
import { dirname, join, resolve } from "node:path";
import { fileURLToPath } from "node:url";
import { gzipSync } from "node:zlib";
import { rolldown } from "rolldown";

const here = dirname(fileURLToPath(import.meta.url));
const root = dirname(here);
/** The maximum number of bytes that a page loads for either backend, gzipped. */
const MAX_ZIPPED = 700_000;
const dist = join(here, "dist");
const target = resolve(root, process.env.CARGO_TARGET_DIR ?? "target");

function run(command, args, options = {}) {
    execFileSync(command, args, { stdio: "inherit", cwd: here, ...options });
}

const lock = readFileSync(join(root, "Cargo.lock"), "utf8");
const version = lock.match(/name = "wasm-bindgen"\nversion = "([^"]+)"/)[1];
const installed = join(target, "tools", "bin", "wasm-bindgen");
const bindgen = existsSync(installed) ? installed : "wasm-bindgen";
let found;
try {
    found = execFileSync(bindgen, ["--version"], { encoding: "utf8" }).trim().split(" ")[1];
} catch (error) {
    throw new Error(`${bindgen}: ${error.message}; .ci/setup --web installs version ${version}`);
}
if (found !== version) {
    throw new Error(`${bindgen}: found version ${found}, allowed: ${version}, that of Cargo.lock, which .ci/setup --web installs`);
}

/** A number of a WebAssembly file from some place on (unsigned LEB128), and the place after it. */
function readNumber(bytes, at) {
    let [number, shift] = [0, 0];
    do {
        number += (bytes[at] & 0x7f) * 2 ** shift;
        shift += 7;
    } while (bytes[at++] & 0x80);
    return [number, at];
}

function writeNumber(number) {
    const bytes = [];
    for (; number > 0x7f; number >>>= 7) bytes.push((number & 0x7f) | 0x80);
    return Buffer.from([...bytes, number]);
}

/** Takes the hashes out of the bindings' names, which do not compress, in a WebAssembly file and in its script. */
function shortenNames(wasm, script) {
    const IMPORTS = 2;
    const [bytes, names] = [readFileSync(wasm), new Map()];
    // A name stands behind its length, and after the file's head sections stand behind theirs.
    const shorten = (whole, length, name, plain) => {
        if (length.charCodeAt(0) !== name.length) throw new Error(`${wasm}: the import ${name} does not stand behind its length`);
        const others = [...names.values()].filter((other) => other.replace(/\.\d+$/, "") === plain).length;
        if (!names.has(name)) names.set(name, others ? `${plain}.${others}` : plain);
        const short = names.get(name);
        return String.fromCharCode(short.length) + short;
    };
    const parts = [bytes.subarray(0, 8)];
    for (let at = 8; at < bytes.length;) {
        const [size, start] = readNumber(bytes, at + 1);
        let section = bytes.subarray(start, start + size);
        if (bytes[at] === IMPORTS) {
            section = Buffer.from(section.toString("latin1").replace(/([^])((__wb\w+)_[0-9a-f]{16})(?!\w)/g, shorten), "latin1");
        }
        parts.push(bytes.subarray(at, at + 1), writeNumber(section.length), section);
        at = start + size;
    }
    writeFileSync(wasm, Buffer.concat(parts));
    const text = readFileSync(script, "utf8").replace(/\b__wb\w+_[0-9a-f]{16}\b/g, (name) => JSON.stringify(names.get(name) ?? name));
    writeFileSync(script, text);
}

rmSync(dist, { recursive: true, force: true });
mkdirSync(dist);
for (const license of ["LICENSE-MIT", "LICENSE-APACHE"]) copyFileSync(join(root, license), join(here, license));
// A page loads one of both. Only the CPU's speed depends on its code, which vectors make fast; the GPU's may be as short as can be.
for (const [backend, level] of [["cpu", "s"], ["gpu", "z"]]) {
    const cargo = ["build", "--locked", "-p", "sheetsplat-web", "--features", backend, "--target", "wasm32-unknown-unknown", "--profile", "web"];
    const environment = { CARGO_PROFILE_WEB_OPT_LEVEL: level, RUSTFLAGS: "-C target-feature=+simd128" };
    run("cargo", cargo, { cwd: root, env: { ...process.env, ...environment } });
    const built = join(target, "wasm32-unknown-unknown", "web", "sheetsplat_web.wasm");
    const options = ["--target", "web", "--omit-default-module-path", "--remove-name-section", "--remove-producers-section"];
    run(bindgen, [built, ...options, "--out-dir", dist, "--out-name", backend]);
    shortenNames(join(dist, `${backend}_bg.wasm`), join(dist, `${backend}.js`));
    const bytes = readFileSync(join(dist, `${backend}_bg.wasm`));
    const zipped = gzipSync(bytes, { level: 9 }).length;
    console.log(`${backend}: ${(bytes.length / 1e6).toFixed(2)} MB, ${(zipped / 1e6).toFixed(2)} MB gzipped`);
    if (zipped > MAX_ZIPPED) {
        throw new Error(`${backend}_bg.wasm: found ${zipped} bytes gzipped, allowed: at most ${MAX_ZIPPED}`);
    }
}
run(join(here, "node_modules", ".bin", "tsc"), ["-p", here]);

// Python's `View.to_html` puts these into pages of one file. Such a page has no addresses for modules, so each script is one text, and the worker's no module.
const texts = {};
for (const [name, format] of [["index", "es"], ["worker", "iife"]]) {
    const bundle = await rolldown({ input: join(dist, `${name}.js`), external: /gpu\.js$/, logLevel: "silent" });
    const { output } = await bundle.generate({ format, codeSplitting: false, minify: true });
    texts[`${name}.js`] = Buffer.from(output[0].code);
}
const parts = { ...texts, "cpu_bg.wasm": readFileSync(join(dist, "cpu_bg.wasm")) };
let end = 0;
const places = Object.fromEntries(Object.entries(parts).map(([name, { length }]) => [name, [end, (end += length)]]));
const table = Buffer.from(JSON.stringify(places));
const length = Buffer.alloc(4);
length.writeUInt32LE(table.length);
const page = join(root, "python", "sheetsplat", "page.bin");
// A wheel that is made meanwhile has the whole file, or none.
writeFileSync(`${page}.new`, gzipSync(Buffer.concat([length, table, ...Object.values(parts)]), { level: 9 }));
renameSync(`${page}.new`, page);
