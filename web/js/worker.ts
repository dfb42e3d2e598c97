// A worker: a session of the library, and the canvas that it draws onto. On the CPU further workers of the same script draw a share of
// each frame; each has the volume, since pages without special headers cannot share memory.

import type * as Cpu from "./cpu.js";
import type * as Gpu from "./gpu.js";
import { Shares } from "./shares.js";
import { Remote, type Answer, type Call, type Calls, type Given, type Pose, type Region, type Shown, type Start, type Stats } from "./protocol.js";

/** How often in turn another device is opened before a frame has been drawn. */
const MAX_REOPENED = 3;
/** Milliseconds within which the loss of a device is told after a call failed by it. */
const LOSS_DELAY = 100;
/** Milliseconds that the GPU's first frame may take if the backend is "auto": the CPU needs fewer for most pictures. */
const SLOW_FRAME = 2000;

/** A worker's global scope, of which TypeScript's library for pages knows nothing. */
interface Scope {
    postMessage(message: Answer, moved: Transferable[]): void;
    onmessage: (event: MessageEvent<Call>) => void;
    sheetsplatPanic?: string;
    /** Tells of the library's warnings. */
    sheetsplatWarn: (message: string) => void;
    sheetsplatLost?: (message: string) => void;
}

/** What is needed of the browser's WebGPU here. Older browsers have `isFallbackAdapter` in the adapter itself. */
interface GpuAccess {
    requestAdapter(): Promise<{ info?: { isFallbackAdapter?: boolean }; isFallbackAdapter?: boolean } | null>;
}

const scope = self as unknown as Scope;
// Those that help have the same volume, and the same warnings.
scope.sheetsplatWarn = (message) => {
    if (start.canvas) scope.postMessage({ event: "warning", message }, []);
};

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
let shares = new Shares(1);
let shown: Shown | undefined;
/** Whether the GPU's device is lost, and how many have been. */
let isLost = false;
let losses = 0;
/** How many devices have been opened in place of lost ones since the last frame. */
let reopened = 0;
/** Whether the first frame has told how fast the GPU is. */
let isJudged = false;
/** Gets the canvas on which the CPU draws in the lost GPU's place. */
let takeCanvas: ((canvas: OffscreenCanvas) => void) | undefined;

const calls: { [K in Exclude<keyof Calls, "giveCanvas">]: (...args: Parameters<Calls[K]>) => Promise<ReturnType<Calls[K]>> } = {
    async start(options) {
        start = options;
        size = options.size;
        if (options.canvas && options.backend !== "cpu") {
            try {
                // A canvas that has a context for WebGPU cannot get one for the CPU's pictures, so nothing touches it before a device is open.
                // Without an adapter there is no need to load the library for it.
                const adapter = await (navigator as { gpu?: GpuAccess }).gpu?.requestAdapter();
                if (!adapter) throw new Error("the browser offers no WebGPU adapter");
                const isSoftware = adapter.info?.isFallbackAdapter ?? adapter.isFallbackAdapter;
                if (isSoftware && options.backend === "auto") throw new Error("the browser's WebGPU adapter is software");
                gpu = await import("./gpu.js");
                await gpu.default({ module_or_path: wasm("gpu") });
                session = await gpu.Session.open(options.allAround, options.canvas);
                session.resize(...size);
                scope.sheetsplatLost = recover;
                return "gpu";
            } catch (error) {
                gpu = undefined;
                if (options.backend === "gpu") throw new Error(`backend: found "gpu", allowed: "cpu" in this browser: ${reason(error)}`);
            }
        }
        await startCpu();
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
            else if ("look" in move) session.look(Float64Array.from(move.look.flat()));
            else session.home();
        }
        await others;
    },

    async draw(coarse) {
        return await draw(coarse);
    },

    async region([x, y, width, height], coarse, floats) {
        session.resize(...scaled(coarse));
        return ofCpu().draw(x, y, width, height, floats) as Region;
    },

    async pick(x, y) {
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

    async camera() {
        session.resize(...size);
        return session.camera();
    },

    async setPose(...pose) {
        ofCpu().setPose(...pose);
    },

    async shaders() {
        return (gpu?.shaders() ?? new Map()) as Map<string, string>;
    },

    async loseDevice() {
        if (gpu) (session as Gpu.Session).lose();
    },
};

/** Shows a scene in a session, with the volume from the files unless it has that already. */
async function show(session: Cpu.Session | Gpu.Session, shown: Shown, isNew: boolean): Promise<void> {
    const { text, unset, sets, source, keepCamera } = shown;
    if (!await session.setScene(text, unset, sets, source, isNew, keepCamera)) return;
    const bytes = new Map<string, Uint8Array>();
    for (const [name, data] of files) {
        bytes.set(name, new Uint8Array(data instanceof Blob ? await data.arrayBuffer() : data));
    }
    await session.load(bytes);
}

/** Where a library's code lies. Bundlers recognize addresses that are written like these. */
function wasm(backend: "cpu" | "gpu"): URL {
    if (start.base !== undefined) return new URL(`${backend}_bg.wasm`, start.base);
    return backend === "cpu" ? new URL("./cpu_bg.wasm", import.meta.url) : new URL("./gpu_bg.wasm", import.meta.url);
}

/** Loads what draws on the CPU, and starts the workers that help. */
async function startCpu(): Promise<void> {
    const count = start.canvas ? start.workers : 1;
    // They load their scripts while the library is compiled, once for all of them. The address is this script's own: bundlers refuse a worker that
    // names its own source.
    helpers = Array.from({ length: count - 1 }, () => new Remote(new Worker(self.location.href, { type: "module" })));
    shares = new Shares(count);
    const compiling = start.module ?? compile(wasm("cpu"));
    cpu = await import("./cpu.js");
    const module = await compiling;
    const others = broadcast("start", [{ ...start, size, module, canvas: undefined, backend: "cpu" }]);
    // What fails first is told.
    others.catch(() => {});
    await cpu.default({ module_or_path: module });
    session = new cpu.Session(start.allAround);
    session.resize(...size);
    if (start.canvas) {
        context = start.canvas.getContext("2d") ?? undefined;
        if (!context) throw new Error("the canvas has a context of another kind already");
    }
    await others;
}

/** Compiles a WebAssembly file; while it arrives, if the server states its type. */
async function compile(url: URL): Promise<WebAssembly.Module> {
    const response = await fetch(url);
    if (!response.ok) throw new Error(`${url}: ${response.status} ${response.statusText}`);
    if (response.headers.get("content-type") === "application/wasm") return await WebAssembly.compileStreaming(response);
    return await WebAssembly.compile(await response.arrayBuffer());
}

/** The session, if the CPU draws. */
function ofCpu(): Cpu.Session {
    if (!cpu) throw new Error("found the backend \"gpu\", allowed: \"cpu\"");
    return session as Cpu.Session;
}

function broadcast<K extends keyof Calls>(name: K, args: Parameters<Calls[K]>): Promise<unknown> {
    const all = Promise.all(helpers.map((helper) => helper.call(name, args)));
    // A helper may fail before its caller waits for it.
    all.catch(() => {});
    return all;
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
        const began = performance.now();
        const stats = await (session as Gpu.Session).present() as Stats;
        reopened = 0;
        const isSlow = !isJudged && start.backend === "auto" && performance.now() - began > SLOW_FRAME;
        isJudged = true;
        if (!isSlow) return { ...stats, workers: 1 };
        await fallBack();
        return await draw(coarse);
    }
    const began = performance.now();
    const parts = shares.of(width, height);
    const others = parts.slice(1).map((part, at) => helpers[at]!.call("region", [part, coarse, false]));
    const own = ofCpu().draw(...parts[0]!, false) as Region;
    const regions = [own, ...await Promise.all(others)];
    shares.balance(parts, regions.map(({ stats }) => stats.frame_ms), width);
    // Changing the size clears the canvas, so it waits for the pixels.
    if (canvas.width !== width || canvas.height !== height) [canvas.width, canvas.height] = [width, height];
    regions.forEach(({ rgba }, at) => {
        const [x, y, columns, rows] = parts[at]!;
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

/** Tells that the device is lost, and opens another one once the current call is done. */
function recover(message: string): void {
    losses += 1;
    isLost = true;
    tell({ event: "lost", message });
    queue = queue.then(async () => {
        try {
            if (isLost) await reopen();
        } catch (error) {
            tell({ event: "failed", message: reason(error) });
        }
    });
}

/** Opens another device in place of a lost one, with all that the old one showed. If there is none, the CPU draws from now on, unless WebGPU is
 * wanted, and then the next call tries again. */
async function reopen(): Promise<void> {
    let fault = "it is lost again and again";
    if (reopened < MAX_REOPENED) {
        reopened += 1;
        const seen = losses;
        try {
            await (session as Gpu.Session).reopen();
            if (losses === seen) {
                isLost = false;
                tell({ event: "restored", message: "" });
                return;
            }
        } catch (error) {
            fault = reason(error);
        }
    }
    reopened = 0;
    if (start.backend !== "auto") {
        throw new Error(`the GPU's device was lost, and no other one could be opened: ${fault}. The backend "cpu" works without one`);
    }
    await fallBack();
    tell({ event: "restored", message: "" });
}

/** Lets the CPU draw what the GPU drew, on a canvas of its own. */
async function fallBack(): Promise<void> {
    const old = session as Gpu.Session;
    const pose = old.pose() as Pose | undefined;
    const given = new Promise<OffscreenCanvas>((resolve) => (takeCanvas = resolve));
    tell({ event: "canvas", message: "" });
    start.canvas = await given;
    await startCpu();
    old.free();
    [gpu, isLost] = [undefined, false];
    if (!shown || !pose) return;
    const others = broadcast("setScene", [shown, [...files].map(([name, data]) => ({ name, data }))]);
    await show(session, shown, true);
    await others;
    ofCpu().setPose(...pose);
    await broadcast("setPose", pose);
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

/** Does what a call asks for; again if that failed because the device was lost. */
async function done({ name, args }: Call): Promise<unknown> {
    for (let tries = 1; ; tries++) {
        if (isLost) await reopen();
        const seen = losses;
        try {
            return await (calls[name as keyof typeof calls] as (...args: unknown[]) => Promise<unknown>)(...args);
        } catch (error) {
            if (gpu) await new Promise((resolve) => setTimeout(resolve, LOSS_DELAY));
            if (losses === seen || tries > MAX_REOPENED) throw error;
        }
    }
}

/** One call at a time, in their order. */
let queue = Promise.resolve();
scope.onmessage = ({ data }) => {
    const answer = async () => {
        try {
            const result = await done(data);
            tell({ id: data.id, result }, data.name === "region" ? [(result as Region).rgba.buffer] : []);
        } catch (error) {
            tell({ id: data.id, error: reason(error) });
        }
    };
    // The current call waits for the canvas, so that this one cannot wait for the current call.
    if (data.name === "giveCanvas") {
        takeCanvas?.(data.args[0] as OffscreenCanvas);
        tell({ id: data.id, result: undefined });
        return;
    }
    queue = queue.then(answer);
};
