// Orbit, zoom and pan by pointer, touch, wheel and keys.

import type { Move } from "./protocol.js";

/** Heights of the picture that a key moves by. */
const STEP = 0.05;
/** The zoom factor of a key, and its exponent per pixel of the wheel and of a pinch on a touchpad. */
const ZOOM = 1.15;
const WHEEL = 0.0015;
const PINCH = 0.01;

/** How far the right button has dragged, in heights of the picture, and whether it still does. */
type Dragged = { right: number; down: number; isGoingOn: boolean };

/**
 * Lets a canvas move a camera; `move` gets what is done, and whether more will follow at once. What the right button drags does not move it, and goes to
 * `dragged`. Returns what ends it.
 */
export function control(
    canvas: HTMLCanvasElement,
    move: (move: Move, isGoingOn: boolean) => void,
    dragged: (by: Dragged) => void,
): () => void {
    const ending = new AbortController();
    const listen = <K extends keyof HTMLElementEventMap>(name: K, then: (event: HTMLElementEventMap[K]) => void) => {
        canvas.addEventListener(name, then, { signal: ending.signal, passive: false });
    };
    const down = new Map<number, [number, number]>();
    const height = () => Math.max(canvas.clientHeight, 1);
    /** The middle of the pointers, and how far they are apart. */
    const grip = (): [number, number, number] => {
        const points = [...down.values()];
        const [a, b] = [points[0]!, points[1] ?? points[0]!];
        return [(a[0] + b[0]) / 2, (a[1] + b[1]) / 2, Math.hypot(a[0] - b[0], a[1] - b[1])];
    };

    if (!canvas.hasAttribute("tabindex")) canvas.tabIndex = 0;
    const before = canvas.style.touchAction;
    canvas.style.touchAction = "none";

    listen("contextmenu", (event) => event.preventDefault());
    /** The grip that the last move ended with, and the frame that has the next one. */
    let held: [number, number, number] = [0, 0, 1];
    let pans = false;
    let frame = 0;
    // Fingers report one by one, but what they do together is one move.
    const follow = () => {
        cancelAnimationFrame(frame);
        frame = 0;
        if (down.size === 0) return;
        const [x, y, apart] = held;
        held = grip();
        if (down.size > 2) return;
        const [newX, newY, newApart] = held;
        const by: [number, number] = [(newX - x) / height(), (newY - y) / height()];
        if (by[0] !== 0 || by[1] !== 0) move(pans ? { pan: by } : { orbit: by }, true);
        if (apart > 0 && newApart > 0 && apart !== newApart) move({ zoom: apart / newApart }, true);
    };
    /** Where the right button went down. */
    let origin: [number, number] | undefined;
    const drag = ({ clientX, clientY }: PointerEvent, isGoingOn: boolean) => {
        if (origin) dragged({ right: (clientX - origin[0]) / height(), down: (clientY - origin[1]) / height(), isGoingOn });
    };
    listen("pointerdown", (event) => {
        if (event.button === 2 && down.size === 0) {
            canvas.setPointerCapture(event.pointerId);
            origin = [event.clientX, event.clientY];
            return;
        }
        follow();
        canvas.setPointerCapture(event.pointerId);
        down.set(event.pointerId, [event.clientX, event.clientY]);
        held = grip();
    });
    listen("pointermove", (event) => {
        drag(event, true);
        if (!down.has(event.pointerId)) return;
        down.set(event.pointerId, [event.clientX, event.clientY]);
        pans = down.size === 2 || event.shiftKey || (event.buttons & 1) === 0;
        frame ||= requestAnimationFrame(follow);
    });
    const up = (event: PointerEvent) => {
        drag(event, false);
        origin = undefined;
        if (!down.has(event.pointerId)) return;
        follow();
        down.delete(event.pointerId);
        if (down.size > 0) held = grip();
        else move({ orbit: [0, 0] }, false);
    };
    listen("pointerup", up);
    listen("pointercancel", up);
    let rest: ReturnType<typeof setTimeout> | undefined;
    listen("wheel", (event) => {
        event.preventDefault();
        const pixels = event.deltaY * (event.deltaMode === WheelEvent.DOM_DELTA_LINE ? 20 : 1);
        // Browsers report a pinch on a touchpad as the wheel with Ctrl.
        move({ zoom: Math.exp(pixels * (event.ctrlKey ? PINCH : WHEEL)) }, true);
        clearTimeout(rest);
        rest = setTimeout(() => move({ zoom: 1 }, false), 250);
    });
    listen("keydown", (event) => {
        if (event.ctrlKey || event.metaKey || event.altKey) return;
        const arrows: Record<string, [number, number]> = {
            ArrowLeft: [-STEP, 0],
            ArrowRight: [STEP, 0],
            ArrowUp: [0, -STEP],
            ArrowDown: [0, STEP],
        };
        const by = arrows[event.key];
        if (by) move(event.shiftKey ? { pan: by } : { orbit: by }, false);
        else if (event.key === "+" || event.key === "=") move({ zoom: 1 / ZOOM }, false);
        else if (event.key === "-" || event.key === "_") move({ zoom: ZOOM }, false);
        else if (event.key === "Home" || event.key === "0") move({ home: true }, false);
        else return;
        event.preventDefault();
    });
    return () => {
        ending.abort();
        cancelAnimationFrame(frame);
        clearTimeout(rest);
        canvas.style.touchAction = before;
    };
}
