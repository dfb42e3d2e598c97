// sheetsplat in a page: a volume on a canvas, drawn in a worker.
//
//   const view = await SheetSplat.create(canvas);
//   await view.loadFile(file);
//   await view.setScene({ preset: "ct-bone" });

import { control } from "./controls.js";
import { Remote, type Backend, type Camera, type Facts, type Given, type Move, type News, type Pick, type Pixels, type Stats } from "./protocol.js";
import { overrides, removed, sceneText, type SceneObject, type SceneValue } from "./scene.js";

export type { Backend, Camera, Channel, Facts, Given, Move, Pick, Pixels, Stats } from "./protocol.js";
export { marks, type Mark } from "./marks.js";
export type { SceneObject, SceneValue } from "./scene.js";

/** A file: dropped or chosen, its bytes, where it lies, or its data with a name, which may be a path. */
export type Source = File | Blob | ArrayBuffer | URL | string | Given;

/** How a view is made. */
export interface Options {
    /** `"auto"` by default: WebGPU where it works, is no software, and draws its first frame within two seconds, else the CPU. */
    backend?: Backend;
    /** The number of workers that share a frame on the CPU: by default as many as there are cores, at most 8. Each holds the volume. */
    workers?: number;
    /** Whether pointer, touch and keys move the camera: by default they do. The object then keeps its size from every direction. */
    controls?: boolean;
    /** Whether the picture has the canvas's size on the screen: by default it does. Otherwise its `width` and `height` count. */
    fit?: boolean;
    /** The folder of the WebAssembly files, if they do not lie beside this script. */
    base?: URL | string;
    /** The worker, if the page cannot load `worker.js` by its address, such as one that is a single file: it draws on the CPU by `module`, without helpers. */
    worker?: Worker;
    /** The compiled library for the CPU, if the page cannot load its file by an address. */
    module?: WebAssembly.Module;
}

/** How files are loaded. */
export interface LoadOptions {
    /** The name of a file that has none, with the extension that tells its format. */
    name?: string;
    /** How the volume is shown, as for `setScene`. */
    scene?: string | SceneObject;
    set?: SceneOptions["set"];
}

/** How a scene replaces another one. */
export interface SceneOptions {
    /** Settings in place of the scene's, by the keys of scene files: `{ "transfer.colormap": "magma", "channel[1].visible": false }`. `null` takes a
     * setting or a whole table out of the scene, so that the default counts; `undefined` leaves it as it is. */
    set?: Record<string, SceneValue | null | undefined>;
    /** Whether the camera stays where it is: otherwise the scene's counts. */
    keepCamera?: boolean;
}

/** The events of a view, by the types of their `detail`. */
export interface SheetSplatEvents {
    /** A frame was drawn. */
    frame: Stats;
    /** A volume was loaded, or its scene changed. */
    load: Facts;
    /** Something that no promise reports failed, such as a frame after a drag. */
    error: Error;
    /** The GPU's device is lost; another one is being opened. */
    lost: string;
    /** It draws again: by another device, or by the CPU if the backend is `"auto"` and there is no other device. */
    restored: string;
    /** What a reader assumes, or something else that makes the picture another one than might be expected, once for each volume. */
    warning: string;
    /** The camera moved. */
    move: undefined;
    /** The right button dragged, by heights of the picture since it went down, and whether it still is: a page may change window and level by it. */
    window: { right: number; down: number; isGoingOn: boolean };
}

/** A view of a volume on a canvas. */
export class SheetSplat extends EventTarget {
    #backend: "cpu" | "gpu";
    #canvas: HTMLCanvasElement;
    readonly #remote: Remote;
    readonly #hasControls: boolean;
    readonly #fits: boolean;
    /** Ends what listens to the canvas. */
    #endings: (() => void)[] = [];
    #source: string | undefined;
    #facts: Facts | undefined;
    /** The warnings that the volume has had. */
    #warnings = new Set<string>();
    #moves: Move[] = [];
    #isGoingOn = false;
    #wanted: Promise<Stats> | undefined;
    #running: Promise<unknown> = Promise.resolve();
    /** Milliseconds that a pixel of the last frame took. */
    #pace = 0;

    /** Starts the workers. The canvas must not have a context yet; it belongs to the view until `dispose`, and to no other one after it. */
    static async create(canvas: HTMLCanvasElement, options: Options = {}): Promise<SheetSplat> {
        const { backend = "auto", controls = true, fit = true } = options;
        if (!["auto", "cpu", "gpu"].includes(backend)) {
            throw new RangeError(`backend: found "${backend}", allowed: "auto", "cpu", "gpu"`);
        }
        const workers = options.workers ?? (options.worker ? 1 : Math.min(navigator.hardwareConcurrency || 1, 8));
        if (!Number.isInteger(workers) || workers < 1 || workers > 64) {
            throw new RangeError(`workers: found ${workers}, allowed: 1 to 64`);
        }
        const size = fit ? onScreen(canvas) : [canvas.width, canvas.height] as [number, number];
        const remote = new Remote(options.worker ?? new Worker(new URL("./worker.js", import.meta.url), { type: "module" }));
        try {
            const offscreen = canvas.transferControlToOffscreen();
            const base = options.base === undefined ? undefined : new URL(options.base, document.baseURI).href;
            const code = options.module && { module: options.module };
            const start = { canvas: offscreen, backend, workers, allAround: controls, size, base, ...code };
            const chosen = await remote.call("start", [start], [offscreen]);
            return new SheetSplat(canvas, remote, chosen, controls, fit);
        } catch (error) {
            remote.end();
            throw error;
        }
    }

    private constructor(canvas: HTMLCanvasElement, remote: Remote, backend: "cpu" | "gpu", controls: boolean, fit: boolean) {
        super();
        this.#canvas = canvas;
        this.#backend = backend;
        this.#remote = remote;
        [this.#hasControls, this.#fits] = [controls, fit];
        remote.onevent = (event, message) => this.#heard(event, message);
        this.#attach();
    }

    /** What draws. */
    get backend(): "cpu" | "gpu" {
        return this.#backend;
    }

    /** The canvas. If the CPU takes the place of a lost GPU, a copy with the same attributes takes the place of the canvas in the page. */
    get canvas(): HTMLCanvasElement {
        return this.#canvas;
    }

    /** The volume, and how its scene shows it; `undefined` before the first one. */
    get facts(): Facts | undefined {
        return this.#facts;
    }

    /** Listens to the canvas. */
    #attach(): void {
        const canvas = this.#canvas;
        if (this.#hasControls) {
            const moved = (move: Move, isGoingOn: boolean) => {
                this.#isGoingOn = isGoingOn;
                this.move(move);
            };
            this.#endings.push(control(canvas, moved, (dragged) => this.#emit("window", dragged)));
        }
        if (this.#fits) {
            let last = onScreen(canvas).join();
            const observer = new ResizeObserver(() => {
                const size = onScreen(canvas);
                if (size.join() === last) return;
                last = size.join();
                this.resize(...size).catch((error) => this.#emit("error", error));
            });
            observer.observe(canvas);
            this.#endings.push(() => observer.disconnect());
        }
    }

    /** Does what the worker's news asks for. */
    #heard(event: News, message: string): void {
        if (event === "failed") {
            this.#emit("error", new Error(message));
        } else if (event === "canvas") {
            this.#replaceCanvas();
        } else if (event === "warning" && this.#warnings.has(message)) {
            return;
        } else {
            if (event === "warning") this.#warnings.add(message);
            this.#emit(event, message);
            if (event === "restored") this.#refresh();
        }
    }

    /** A canvas of WebGPU cannot get the CPU's pictures, so another one takes its place. */
    #replaceCanvas(): void {
        const old = this.#canvas;
        const hadFocus = old === document.activeElement;
        for (const end of this.#endings.splice(0)) end();
        this.#canvas = old.cloneNode() as HTMLCanvasElement;
        this.#backend = "cpu";
        old.replaceWith(this.#canvas);
        this.#attach();
        if (hadFocus) this.#canvas.focus({ preventScroll: true });
        const offscreen = this.#canvas.transferControlToOffscreen();
        this.#remote.call("giveCanvas", [offscreen], [offscreen]).catch((error) => this.#emit("error", error));
    }

    /** Loads a volume, several files of one (a header and its data, slices, or a scene file with what it names), or a scene file. Draws it. */
    async loadFile(source: Source | readonly Source[], options: LoadOptions = {}): Promise<Facts> {
        const sources = Array.isArray(source) ? source as readonly Source[] : [source as Source];
        const given = await Promise.all(sources.map((one) => read(one, options.name)));
        const scene = given.find(({ name }) => name.toLowerCase().endsWith(".toml"));
        const text = options.scene ?? (scene ? await new Blob([scene.data]).text() : "");
        // The header of several files is the one that is no bare data; slices are a folder.
        const headers = given.filter(({ name }) => /\.(nhdr|mhd|hdr|hdr\.gz)$/i.test(name));
        const volume = given.length === 1 ? given[0]!.name : headers.length === 1 ? headers[0]!.name : ".";
        return await this.#show(sceneText(text), { set: options.set }, scene ? undefined : volume, given);
    }

    /** Changes how the volume is shown: the text of a scene file, or an object with its keys. A scene may also name a builtin volume, or files that
     * were loaded. Draws it. */
    async setScene(scene: string | SceneObject, options: SceneOptions = {}): Promise<Facts> {
        return await this.#show(sceneText(scene), options, this.#source, undefined);
    }

    async #show(text: string, options: SceneOptions, source: string | undefined, given: Given[] | undefined): Promise<Facts> {
        const set = options.set ?? {};
        if (given) this.#warnings.clear();
        const shown = { text, unset: removed(set), sets: overrides(set), source, keepCamera: options.keepCamera ?? false };
        const facts = await this.#remote.call("setScene", [shown, given]);
        if (given) this.#source = source;
        this.#facts = facts;
        this.#emit("load", facts);
        await this.render();
        return facts;
    }

    /** Draws a frame. Calls that come while one is drawn share the next one. */
    render(): Promise<Stats> {
        this.#wanted ??= this.#running.then(async () => {
            this.#wanted = undefined;
            await this.#flush();
            const stats = await this.#remote.call("draw", [this.#coarse()]);
            this.#pace = stats.frame_ms / (stats.width * stats.height);
            this.#emit("frame", stats);
            return stats;
        });
        this.#running = this.#wanted.catch(() => {});
        return this.#wanted;
    }

    /** Tells the worker of moves that no frame shows yet. */
    async #flush(): Promise<void> {
        const moves = this.#moves.splice(0);
        if (moves.length > 0) await this.#remote.call("move", [moves]);
    }

    /** While the camera moves, frames are as coarse as they must be to take about 80 ms. */
    #coarse(): number {
        if (!this.#isGoingOn || this.#pace === 0) return 1;
        const { width, height } = this.#size();
        const whole = this.#pace * width * height;
        return Math.min(Math.max(Math.round(Math.sqrt(whole / 80)), 1), 4);
    }

    #size(): { width: number; height: number } {
        const [width, height] = onScreen(this.canvas);
        return { width, height };
    }

    /** Moves the camera: turned (`orbit`) or moved (`pan`) as by a pointer that moves right and down by some heights of the picture, the height of
     * what is shown multiplied (`zoom`), in another direction with an up vector (`look`), or back to the scene's (`home`). Draws it. */
    move(move: Move): void {
        this.#moves.push(move);
        this.#emit("move", undefined);
        this.#refresh();
    }

    #refresh(): void {
        if (!this.#facts) return;
        this.render().catch((error) => this.#emit("error", error));
    }

    /** Changes the picture's size in pixels, and draws it. With the option `fit` it follows the canvas by itself. */
    async resize(width: number, height: number): Promise<void> {
        await this.#remote.call("resize", [width, height]);
        if (this.#facts) await this.render();
    }

    /** The point that the picture shows at a pixel, counted from the upper left; `undefined` where it is transparent. */
    async pick(x: number, y: number): Promise<Pick | undefined> {
        await this.#flush();
        return await this.#remote.call("pick", [Math.floor(x), Math.floor(y)]);
    }

    /** The picture as numbers, the same on every machine. Only on the CPU. */
    async pixels(): Promise<Pixels> {
        await this.#flush();
        return await this.#remote.call("pixels", []);
    }

    /** The picture as a file. */
    async toBlob(type = "image/png"): Promise<Blob> {
        await this.#flush();
        return await this.#remote.call("blob", [type]);
    }

    /** The scene as the text of a scene file, with the camera of now and everything else that depends on the volume. */
    async scene(): Promise<string> {
        await this.#flush();
        return await this.#remote.call("scene", []);
    }

    /** Where the camera is. */
    async camera(): Promise<Camera> {
        await this.#flush();
        return await this.#remote.call("camera", []);
    }

    /** Ends the workers, which frees their memory. */
    dispose(): void {
        for (const end of this.#endings.splice(0)) end();
        this.#facts = undefined;
        this.#remote.end();
    }

    /** For tests: every shader by its stage, and a lost device. */
    get internals() {
        return {
            shaders: () => this.#remote.call("shaders", []),
            loseDevice: () => this.#remote.call("loseDevice", []),
        };
    }

    /** Calls `listener` with each event's detail; returns what ends that. */
    on<K extends keyof SheetSplatEvents>(name: K, listener: (detail: SheetSplatEvents[K]) => void): () => void {
        const listening = (event: Event) => listener((event as CustomEvent<SheetSplatEvents[K]>).detail);
        this.addEventListener(name, listening);
        return () => this.removeEventListener(name, listening);
    }

    #emit<K extends keyof SheetSplatEvents>(name: K, detail: SheetSplatEvents[K]): void {
        this.dispatchEvent(new CustomEvent(name, { detail }));
    }
}

/** The pixels that a canvas covers. */
function onScreen(canvas: HTMLCanvasElement): [number, number] {
    const scale = window.devicePixelRatio || 1;
    return [Math.max(Math.round(canvas.clientWidth * scale), 1), Math.max(Math.round(canvas.clientHeight * scale), 1)];
}

/** A file's name and data. */
async function read(source: Source, name: string | undefined): Promise<Given> {
    if (source instanceof File) return { name: name ?? source.name, data: source };
    if (source instanceof Blob || source instanceof ArrayBuffer) return { name: name ?? "volume", data: source };
    if (typeof source === "object" && "data" in source) return source;
    const url = new URL(source, document.baseURI);
    const response = await fetch(url);
    if (!response.ok) throw new Error(`${url}: ${response.status} ${response.statusText}`);
    return { name: name ?? decodeURIComponent(url.pathname.split("/").pop() || "volume"), data: await response.blob() };
}
