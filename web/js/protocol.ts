// What the page and its workers tell one another: calls by name, each answered once.

/** What draws: `"gpu"` is the browser's WebGPU, `"cpu"` its processor, `"auto"` the faster one of those that work. */
export type Backend = "auto" | "cpu" | "gpu";

/** Counts and times of a frame; the names are those of `sheetsplat render --stats`. */
export interface Stats {
    adapter: string;
    driver: string;
    backend: string;
    api: string;
    rasterizer: string;
    width: number;
    height: number;
    voxels_total: number;
    voxels_in_range: number;
    voxels_shaded: number;
    sections_total: number;
    sections_rasterized: number;
    sheets: number;
    gpu_bytes: number;
    load_ms: number;
    prepare_ms: number;
    frame_ms: number;
    /** The number of workers that drew the frame. */
    workers: number;
}

/** A channel of a volume under its scene's transfer function. */
export interface Channel {
    name: string;
    visible: boolean;
    /** The scene's colour map; `null` if it names none. */
    colormap: string | null;
    /** Whether the scene states the colours one by one. */
    hasColors: boolean;
    /** The smallest and the greatest value. */
    range: [number, number];
    /** Counts of values in at most 256 equal intervals of the range. */
    histogram: number[];
    /** Control points: values, and opacities per unit length. */
    opacity: [number, number][];
    /** Control points: values, and red, green and blue. */
    color: [number, [number, number, number]][];
}

/** A volume, and how its scene shows it. */
export interface Facts {
    dims: [number, number, number];
    spacing: [number, number, number];
    unit: string | null;
    /** The file's format; `null` for builtin volumes. */
    format: string | null;
    /** The number of voxels without a value. */
    holes: number;
    labels: boolean;
    /** The directions of x, y and z in a patient's RAS; `null` for files that state no patient. */
    orientation: [[number, number, number], [number, number, number], [number, number, number]] | null;
    /** The preset that fits the values, if they tell. */
    suggested: string | null;
    /** The presets that suit the volume. */
    presets: string[];
    colormaps: string[];
    /** The scene's preset; `null` if it names none. */
    preset: string | null;
    slabWidth: number;
    /** How much of the ambient light matter in front keeps off, 0 to 1. */
    occlusion: number;
    /** How much of the other light matter towards the light keeps off, 0 to 1. */
    shadow: number;
    compositing: string;
    /** The compositing that the preset, or the lack of one, chooses. */
    presetCompositing: string;
    projection: "orthographic" | "perspective";
    /** `[nx, ny, nz, d]` keeps the points p with `n·p + d ≥ 0`. */
    planes: [number, number, number, number][];
    /** The corners of the box that is kept. */
    crop: [[number, number, number], [number, number, number]] | null;
    channels: Channel[];
}

/** Where the camera is, in world units from the volume's centre. */
export interface Camera {
    /** Into the scene, of length 1. */
    direction: [number, number, number];
    up: [number, number, number];
    /** The point in the middle of the picture about which the camera turns. */
    center: [number, number, number];
    /** What the picture shows from its lower to its upper end, at the centre's depth. */
    height: number;
    projection: "orthographic" | "perspective";
}

/** The point that a picture shows at a pixel. */
export interface Pick {
    /** World units from the volume's centre. */
    position: [number, number, number];
    /** World units along the camera's direction. */
    depth: number;
    voxel: [number, number, number];
    channel: number;
    value: number;
    label: number | null;
}

/** A picture as numbers: premultiplied red, green, blue and alpha, row by row from the top. */
export interface Pixels {
    width: number;
    height: number;
    data: Float32Array;
}

/** A volume or scene file with its name, as a page gives it to a worker. */
export interface Given {
    name: string;
    data: Blob | ArrayBuffer;
}

/** A change of the camera. */
export type Move =
    | { orbit: [right: number, down: number] }
    | { pan: [right: number, down: number] }
    | { zoom: number }
    | { look: [direction: [number, number, number], up: [number, number, number]] }
    | { home: true };

/** What a worker shows. */
export interface Shown {
    /** The text of a scene file. */
    text: string;
    /** Keys of the text that do not count. */
    unset: string[];
    /** `KEY=VALUE`, in place of what the text states. */
    sets: string[];
    /** The volume file, if the text names none. */
    source: string | undefined;
    keepCamera: boolean;
}

/** A camera and its home as texts of scene files, and what it frames. */
export type Pose = [camera: string, home: string, object: Float64Array | undefined];

/** How a worker begins. */
export interface Start {
    /** Absent in a worker that helps another one. */
    canvas?: OffscreenCanvas;
    backend: Backend;
    /** The number of workers that share a frame on the CPU. */
    workers: number;
    allAround: boolean;
    size: [number, number];
    /** Where the WebAssembly files lie, if not beside the worker's script. */
    base: string | undefined;
    /** The library for the CPU, if another worker has compiled it. */
    module?: WebAssembly.Module;
}

/** The calls that a worker answers: arguments and result of each. */
export interface Calls {
    start: (options: Start) => "cpu" | "gpu";
    setScene: (scene: Shown, given: Given[] | undefined) => Facts;
    resize: (width: number, height: number) => void;
    move: (moves: Move[]) => void;
    /** Draws every `coarse`-th pixel along each side. */
    draw: (coarse: number) => Stats;
    region: (region: [number, number, number, number], coarse: number, floats: boolean) => Region;
    pick: (x: number, y: number) => Pick | undefined;
    pixels: () => Pixels;
    blob: (type: string) => Blob;
    scene: () => string;
    camera: () => Camera;
    /** A canvas on which the CPU draws from now on, because the GPU's can no longer be used. */
    giveCanvas: (canvas: OffscreenCanvas) => void;
    /** Moves the camera of a worker that helps to where the first worker's is. */
    setPose: (...pose: Pose) => void;
    shaders: () => Map<string, string>;
    loseDevice: () => void;
}

/** A part of a picture. */
export interface Region {
    rgba: Uint8ClampedArray<ArrayBuffer>;
    pixels?: Float32Array;
    stats: Stats;
}

export interface Call {
    id: number;
    name: keyof Calls;
    args: unknown[];
}

export type Answer =
    | { id: number; result: unknown }
    | { id: number; error: string }
    | { event: News; message: string };

/** A worker's news: the device is lost, another canvas is needed so that the CPU can draw, it draws again, or all that failed; or a warning. */
export type News = "lost" | "canvas" | "restored" | "failed" | "warning";

/** Calls to a worker, as promises. */
export class Remote {
    readonly worker: Worker;
    #next = 0;
    #waiting = new Map<number, { resolve: (result: never) => void; reject: (error: Error) => void }>();
    #dead: Error | undefined;
    onevent: (event: News, message: string) => void = () => {};

    constructor(worker: Worker) {
        this.worker = worker;
        worker.onmessage = ({ data }: MessageEvent<Answer>) => {
            if ("event" in data) {
                this.onevent(data.event, data.message);
                return;
            }
            const waiting = this.#waiting.get(data.id);
            this.#waiting.delete(data.id);
            if ("error" in data) waiting?.reject(new Error(data.error));
            else waiting?.resolve(data.result as never);
        };
        worker.onerror = (event) => this.#end(new Error(event.message || "the worker could not be started"));
    }

    call<K extends keyof Calls>(name: K, args: Parameters<Calls[K]>, moved: Transferable[] = []): Promise<ReturnType<Calls[K]>> {
        if (this.#dead) return Promise.reject(this.#dead);
        const id = this.#next++;
        return new Promise((resolve, reject) => {
            this.#waiting.set(id, { resolve, reject });
            this.worker.postMessage({ id, name, args } satisfies Call, moved);
        });
    }

    /** Ends the worker, whose memory is freed. */
    end(): void {
        this.worker.terminate();
        this.#end(new Error("it was disposed of"));
    }

    #end(error: Error): void {
        this.#dead = error;
        for (const { reject } of this.#waiting.values()) reject(error);
        this.#waiting.clear();
    }
}
