// Marks over a view's picture: a scale bar, the colours' bar, and the letters of the patient's sides.

import type { SheetSplat } from "./index.js";
import type { Camera, Channel } from "./protocol.js";

/** A scale bar of a round length, a bar of the first visible channel's colours, or the letters R, L, A, P, S and I at the picture's edges. */
export type Mark = "scale" | "colors" | "sides";

type Vector = [number, number, number];

/** The scale bar's greatest length, a share of the picture's width. */
const SHARE = 0.25;
/** A direction has a side's letter within 67.5° of it, so that one half way between two sides has both. */
const LEAST = 0.383;

const STYLE = `position: absolute; overflow: hidden; pointer-events: none; color: #fff; font: 13px/1.3 system-ui, sans-serif;
    text-shadow: 0 0 2px #000, 0 0 3px #000, 0 0 4px #000`;
const PLACES = {
    scale: "right: 0.8rem; bottom: 0.7rem; text-align: center",
    colors: "right: 0.8rem; top: 0.7rem; bottom: 30%; text-align: left; display: flex; flex-direction: column",
    left: "left: 0.5rem; top: 50%; transform: translateY(-50%)",
    right: "right: 0.5rem; top: 50%; transform: translateY(-50%)",
    top: "top: 0.4rem; left: 50%; transform: translateX(-50%)",
    bottom: "bottom: 0.4rem; left: 50%; transform: translateX(-50%)",
};

/**
 * Shows marks over a view's picture, in an element that takes no part in what the pointer does. They follow the camera and the scene. The canvas
 * should stand in an element with a `position`. What cannot be told is left out: a scale bar in perspective, sides of files that state no patient,
 * colours of labels. Returns what ends them.
 */
export function marks(view: SheetSplat, kinds: readonly Mark[] = ["scale", "colors", "sides"]): () => void {
    const layer = document.createElement("div");
    layer.setAttribute("aria-hidden", "true");
    layer.style.cssText = STYLE;
    let isOver = false;
    const draw = async () => {
        const { canvas, facts } = view;
        if (!facts) return;
        const camera = await view.camera();
        if (isOver) return;
        if (layer.parentElement !== canvas.parentElement) canvas.after(layer);
        const { offsetLeft, offsetTop, clientWidth, clientHeight } = canvas;
        Object.assign(layer.style, { left: `${offsetLeft}px`, top: `${offsetTop}px`, width: `${clientWidth}px`, height: `${clientHeight}px` });
        const elements: (HTMLElement | undefined)[] = [];
        if (kinds.includes("scale")) elements.push(scaleBar(camera, facts.unit, clientWidth, clientHeight));
        if (kinds.includes("colors") && !facts.labels) elements.push(colorBar(facts.channels));
        if (kinds.includes("sides") && facts.orientation) elements.push(...letters(camera, facts.orientation));
        layer.replaceChildren(...elements.filter((element) => element !== undefined));
    };
    const drawn = () => void draw().catch(() => {});
    const end = view.on("frame", drawn);
    drawn();
    return () => {
        end();
        isOver = true;
        layer.remove();
    };
}

/** An element in a place, with texts or elements in it. */
function placed(style: string, ...content: (string | HTMLElement)[]): HTMLElement {
    const element = document.createElement("div");
    element.style.cssText = style;
    element.append(...content);
    return element;
}

/** The scale bar; nothing in perspective, where lengths on the screen differ with the depth. */
function scaleBar(camera: Camera, unit: string | null, width: number, height: number): HTMLElement | undefined {
    if (camera.projection !== "orthographic" || height === 0) return undefined;
    const pixel = camera.height / height;
    const length = roundDown(SHARE * width * pixel);
    const bar = placed(`width: ${length / pixel}px; height: 3px; background: #fff; box-shadow: 0 0 2px #000`);
    return placed(`position: absolute; ${PLACES.scale}`, `${number(length)} ${unit ?? (length === 1 ? "unit" : "units")}`, bar);
}

/** The bar of the first visible channel's colours, with its range; nothing if these are fewer than two. */
function colorBar(channels: Channel[]): HTMLElement | undefined {
    const channel = channels.find(({ visible }) => visible);
    const [first, last] = [channel?.color[0], channel?.color.at(-1)];
    if (!channel || !first || !last || first[0] === last[0]) return undefined;
    const stops = channel.color.map(([value, rgb]) => {
        const color = rgb.map((share) => Math.round(255 * share)).join(" ");
        return `rgb(${color}) ${(100 * (value - first[0])) / (last[0] - first[0])}%`;
    });
    const bar = placed(`flex: 1; width: 12px; margin: 2px 0; box-shadow: 0 0 2px #000; background: linear-gradient(to top, ${stops.join(", ")})`);
    const title = channels.length > 1 ? [channel.name, document.createElement("br")] : [];
    return placed(`position: absolute; ${PLACES.colors}`, placed("", ...title, number(last[0])), bar, placed("", number(first[0])));
}

/** The letters at the left, right, upper and lower edge, by the volume's axes in RAS. */
function letters({ direction, up }: Camera, axes: [Vector, Vector, Vector]): HTMLElement[] {
    const right = unit(cross(direction, up));
    const upward = cross(right, direction);
    const towards = { left: right.map((part) => -part), right, top: upward, bottom: upward.map((part) => -part) };
    return Object.entries(towards).map(([edge, world]) => {
        const ras = [0, 1, 2].map((row) => axes.reduce((sum, axis, at) => sum + axis[row]! * world[at]!, 0));
        const order = [0, 1, 2].sort((a, b) => Math.abs(ras[b]!) - Math.abs(ras[a]!)).slice(0, 2);
        const named = order.filter((axis) => Math.abs(ras[axis]!) > LEAST).map((axis) => (ras[axis]! > 0 ? "RAS" : "LPI")[axis]);
        return placed(`position: absolute; ${PLACES[edge as keyof typeof PLACES]}`, named.join(""));
    });
}

/** The largest number up to one above 0 that is 1, 2 or 5 times a power of ten. */
function roundDown(length: number): number {
    const power = 10 ** Math.floor(Math.log10(length) + 1e-12);
    return [5, 2].map((digit) => digit * power).find((round) => round <= length * (1 + 1e-12)) ?? power;
}

/** A number in a few digits. */
function number(value: number): string {
    return String(Number(value.toPrecision(4)));
}

function cross([a, b, c]: Vector, [x, y, z]: Vector): Vector {
    return [b * z - c * y, c * x - a * z, a * y - b * x];
}

function unit(vector: Vector): Vector {
    const length = Math.hypot(...vector);
    return vector.map((part) => part / length) as Vector;
}
