// A worker: a session of the library, and the canvas that it draws onto. On the CPU further workers of the same script draw a share of
// each frame; each has the volume, since pages without special headers cannot share memory.

import type * as Cpu from "./cpu.js";
import type * as Gpu from "./gpu.js";
import { Remote, type Answer, type Call, type Calls, type Given, type Region, type Shown, type Start, type Stats } from "./protocol.js";

/** Columns of a tile of the native backend; shares of a frame that end between tiles are drawn without waste. */
const TILE = 32;

/** A worker's global scope, of which TypeScript's library for pages knows nothing. */
interface Scope {
    postMessage(message: Answer, moved: Transferable[]): void;
    onmessage: (event: MessageEvent<Call>) => void;
    sheetsplatPanic?: string;
    sheetsplatLost?: (message: string) => void;
}

/** What is needed of the browser's WebGPU here. */
interface GpuAccess {
    requestAdapter(): Promise<object | null>;
}

const scope = self as unknown as Scope;

let start: Start;
/** The library that draws; a page loads one of both. */
let cpu: typeof Cpu | undefined;
let gpu: typeof Gpu | undefined;
let session: Cpu.Session | Gpu.Session;
let helpers: Remote[] = [];
let context: OffscreenCanvasRenderingContext2D | undefined;
let size: [number, number] = [1, 1];
/** Files by their names, as long as the scene may name them. */
let files = new Map<string, Given["data"]>();
/** Where shares of a frame begin and end, in shares of its width. */
let cuts: number[] = [0, 1];
let lost: Promise<void> | undefined;
let shown: Shown | undefined;

const calls: { [K in keyof Calls]: (...args: Parameters<Calls[K]>) => Promise<ReturnType<Calls[K]>> } = {
    async start(options) {
        start = options;
        size = options.size;
        if (options.canvas && options.backend !== "cpu") {
            try {
                // Without an adapter there is no need to load the library for it.
                if (!await (navigator as { gpu?: GpuAccess }).gpu?.requestAdapter()) throw new Error("the browser offers no WebGPU adapter");
                gpu = await import("./gpu.js");
                await gpu.default({ module_or_path: new URL("gpu_bg.wasm", options.base) });
                session = await openGpu();
                scope.sheetsplatLost = recover;
                return "gpu";
            } catch (error) {
                gpu = undefined;
                if (options.backend === "gpu") throw new Error(`backend: found "gpu", allowed: "cpu" in this browser: ${reason(error)}`);
            }
        }
        cpu = await import("./cpu.js");
        await cpu.default({ module_or_path: new URL("cpu_bg.wasm", options.base) });
        session = new cpu.Session(start.allAround);
        session.resize(...size);
        if (options.canvas) {
            context = options.canvas.getContext("2d") ?? undefined;
            if (!context) throw new Error("the canvas has a context of another kind already");
        }
        const count = options.canvas ? options.workers : 1;
        helpers = Array.from({ length: count - 1 }, () => {
            return new Remote(new Worker(new URL("./worker.js", import.meta.url), { type: "module" }));
        });
        cuts = Array.from({ length: count + 1 }, (_, at) => at / count);
        await broadcast("start", [{ ...options, canvas: undefined, backend: "cpu" }]);
        return "cpu";
    },

    async setScene(scene, given) {
        const others = broadcast("setScene", [scene, given]);
        const before = files;
        if (given) files = new Map(given.map(({ name, data }) => [name, data]));
        try {
            await show(session, scene, given !== undefined);
            shown = scene;
        } catch (error) {
            files = before;
            await others.catch(() => {});
            throw error;
        }
        await others;
        return session.facts();
    },

    async resize(width, height) {
        size = [width, height];
        await broadcast("resize", [width, height]);
    },

    async move(moves) {
        const others = broadcast("move", [moves]);
        for (const move of moves) {
            if ("orbit" in move) session.orbit(...move.orbit);
            else if ("pan" in move) session.pan(...move.pan);
            else if ("zoom" in move) session.zoom(move.zoom);
            else session.home();
        }
        await others;
    },

    async draw(coarse) {
        await lost;
        return await draw(coarse);
    },

    async region([x, y, width, height], coarse, floats) {
        session.resize(...scaled(coarse));
        return ofCpu().draw(x, y, width, height, floats) as Region;
    },

    async pick(x, y) {
        await lost;
        session.resize(...size);
        return await session.pick(x, y);
    },

    async pixels() {
        const [width, height] = size;
        session.resize(width, height);
        const region = ofCpu().draw(0, 0, width, height, true) as Region;
        return { width, height, data: region.pixels! };
    },

    async blob(type) {
        await lost;
        if (!gpu) {
            await draw(1);
            return await start.canvas!.convertToBlob({ type });
        }
        // A GPU's canvas forgets its picture once the browser has shown it.
        session.resize(...size);
        const rgba = await (session as Gpu.Session).capture() as Uint8ClampedArray<ArrayBuffer>;
        const canvas = new OffscreenCanvas(...size);
        canvas.getContext("2d")!.putImageData(new ImageData(rgba, ...size), 0, 0);
        return await canvas.convertToBlob({ type });
    },

    async scene() {
        session.resize(...size);
        return session.scene();
    },

    async shaders() {
        return (gpu?.shaders() ?? new Map()) as Map<string, string>;
    },

    async loseDevice() {
        if (gpu) (session as Gpu.Session).lose();
    },
};

/** Shows a scene in a session, with the volume from the files unless it has that already. */
async function show(session: Cpu.Session | Gpu.Session, { text, sets, source, keepCamera }: Shown, isNew: boolean): Promise<void> {
    if (!await session.setScene(text, sets, source, isNew, keepCamera)) return;
    const bytes = new Map<string, Uint8Array>();
    for (const [name, data] of files) {
        bytes.set(name, new Uint8Array(data instanceof Blob ? await data.arrayBuffer() : data));
    }
    await session.load(bytes);
}

async function openGpu(): Promise<Gpu.Session> {
    const made = await gpu!.Session.open(start.allAround, start.canvas!);
    made.resize(...size);
    return made;
}

/** The session, if the CPU draws. */
function ofCpu(): Cpu.Session {
    if (!cpu) throw new Error("found the backend \"gpu\", allowed: \"cpu\"");
    return session as Cpu.Session;
}

function broadcast<K extends keyof Calls>(name: K, args: Parameters<Calls[K]>): Promise<unknown> {
    return Promise.all(helpers.map((helper) => helper.call(name, args)));
}

/** The picture's size with every `coarse`-th pixel. */
function scaled(coarse: number): [number, number] {
    return [Math.ceil(size[0] / coarse), Math.ceil(size[1] / coarse)];
}

async function draw(coarse: number): Promise<Stats> {
    const [width, height] = scaled(coarse);
    session.resize(width, height);
    const canvas = start.canvas!;
    if (gpu) {
        if (canvas.width !== width || canvas.height !== height) [canvas.width, canvas.height] = [width, height];
        return { ...await (session as Gpu.Session).present() as Stats, workers: 1 };
    }
    const began = performance.now();
    const shares = shared(width, height);
    const others = shares.slice(1).map((share, at) => helpers[at]!.call("region", [share, coarse, false]));
    const own = ofCpu().draw(...shares[0]!, false) as Region;
    const regions = [own, ...await Promise.all(others)];
    balance(shares, regions, width);
    // Changing the size clears the canvas, so it waits for the pixels.
    if (canvas.width !== width || canvas.height !== height) [canvas.width, canvas.height] = [width, height];
    regions.forEach(({ rgba }, at) => {
        const [x, y, columns, rows] = shares[at]!;
        context!.putImageData(new ImageData(rgba, columns, rows), x, y);
    });
    const stats = { ...own.stats, width, height, workers: regions.length, frame_ms: performance.now() - began };
    for (const { stats: other } of regions.slice(1)) {
        // Voxels and sections of several shares count in each.
        stats.voxels_shaded += other.voxels_shaded;
        stats.sections_rasterized += other.sections_rasterized;
    }
    return stats;
}

/** A frame's shares: columns of whole tiles, at least one each. */
function shared(width: number, height: number): [number, number, number, number][] {
    const tiles = Math.ceil(width / TILE);
    const count = Math.min(cuts.length - 1, tiles);
    const ends = Array.from({ length: count + 1 }, (_, at) => {
        const wanted = Math.round(cuts[Math.round((at * (cuts.length - 1)) / count)]! * tiles);
        return Math.max(at, Math.min(wanted, tiles - count + at));
    });
    return ends.slice(1).map((end, at) => {
        const first = ends[at]! * TILE;
        return [first, 0, Math.min(end * TILE, width) - first, height];
    });
}

/** Moves the cuts so that all shares of the next frame take the same time, if work is spread evenly within each. */
function balance(shares: [number, number, number, number][], regions: Region[], width: number): void {
    if (shares.length < cuts.length - 1) return;
    const times = regions.map(({ stats }) => Math.max(stats.frame_ms, 0.1));
    const total = times.reduce((sum, time) => sum + time, 0);
    const found = [0];
    let [passed, at] = [0, 0];
    for (let cut = 1; cut < shares.length; cut++) {
        const wanted = (total * cut) / shares.length;
        while (passed + times[at]! < wanted) passed += times[at++]!;
        const [first, , columns] = shares[at]!;
        found.push((first + (columns * (wanted - passed)) / times[at]!) / width);
    }
    // Half way, since times vary.
    cuts = [...found, 1].map((cut, at) => (cut + cuts[at]!) / 2);
}

/** Opens another device after one was lost, and draws again. */
function recover(message: string): void {
    tell({ event: "lost", message });
    lost = (async () => {
        const next = await openGpu();
        if (shown) await show(next, shown, true);
        session = next;
        tell({ event: "restored", message: "" });
    })();
    lost.catch((error) => tell({ event: "lost", message: reason(error) }));
}

function tell(answer: Answer, moved: Transferable[] = []): void {
    scope.postMessage(answer, moved);
}

/** An error's message; after a panic, which ends the session, the panic's. */
function reason(error: unknown): string {
    if (error instanceof WebAssembly.RuntimeError) {
        const panic = scope.sheetsplatPanic;
        return panic ? `sheetsplat stopped: ${panic}` : `sheetsplat stopped, perhaps for want of memory: ${error.message}`;
    }
    return error instanceof Error ? error.message : String(error);
}

/** One call at a time, in their order. */
let queue = Promise.resolve();
scope.onmessage = ({ data }) => {
    queue = queue.then(async () => {
        const { id, name, args } = data;
        try {
            const result = await (calls[name] as (...args: unknown[]) => Promise<unknown>)(...args);
            tell({ id, result }, name === "region" ? [(result as Region).rgba.buffer] : []);
        } catch (error) {
            tell({ id, error: reason(error) });
        }
    });
};
