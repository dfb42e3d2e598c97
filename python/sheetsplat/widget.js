// The browser's part of `sheetsplat.Widget`, a module of anywidget: it shows what the kernel draws, and sends what the pointer and the keys do.

/** Heights of the picture that an arrow key moves by. */
const STEP = 0.05;
/** The zoom factor of a key, and its exponent per pixel of the wheel and of a pinch on a touchpad. */
const ZOOM = 1.15;
const WHEEL = 0.0015;
const PINCH = 0.01;

const LABEL = "Picture of a volume. Arrow keys turn it, with Shift they move it; plus and minus zoom; Home returns.";

/**
 * Sends moves of the camera. Until the kernel has answered the last message, with a picture before its answer, further moves are gathered into one,
 * so that neither moves nor pictures queue up.
 */
function sender(model) {
    let gathered;
    let isWaiting = false;
    const send = () => {
        if (isWaiting || !gathered) return;
        isWaiting = true;
        model.send(gathered);
        gathered = undefined;
    };
    const answered = ({ kind }) => {
        if (kind !== "drawn") return;
        isWaiting = false;
        send();
    };
    model.on("msg:custom", answered);
    return {
        move({ home = false, orbit = [0, 0], pan = [0, 0], zoom = 1 }) {
            if (home || !gathered) gathered = { home, orbit: [0, 0], pan: [0, 0], zoom: 1 };
            for (const at of [0, 1]) {
                gathered.orbit[at] += orbit[at];
                gathered.pan[at] += pan[at];
            }
            gathered.zoom *= zoom;
            send();
        },
        end: () => model.off("msg:custom", answered),
    };
}

/** Calls `move` for what pointer, wheel and keys do on an element, until the signal ends it. */
function control(element, move, signal) {
    const listen = (name, then) => element.addEventListener(name, then, { signal, passive: false });
    const down = new Map();
    const height = () => Math.max(element.clientHeight, 1);
    /** The middle of the pointers, and how far they are apart. */
    const grip = () => {
        const [a, b = a] = [...down.values()];
        return [(a[0] + b[0]) / 2, (a[1] + b[1]) / 2, Math.hypot(a[0] - b[0], a[1] - b[1])];
    };
    listen("contextmenu", (event) => event.preventDefault());
    listen("pointerdown", (event) => {
        element.setPointerCapture(event.pointerId);
        element.focus({ preventScroll: true });
        down.set(event.pointerId, [event.clientX, event.clientY]);
    });
    listen("pointermove", (event) => {
        if (!down.has(event.pointerId) || down.size > 2) return;
        const [x, y, apart] = grip();
        down.set(event.pointerId, [event.clientX, event.clientY]);
        const [newX, newY, newApart] = grip();
        const by = [(newX - x) / height(), (newY - y) / height()];
        const pans = down.size === 2 || event.shiftKey || (event.buttons & 1) === 0;
        const zoom = apart > 0 && newApart > 0 ? apart / newApart : 1;
        move(pans ? { pan: by, zoom } : { orbit: by });
    });
    for (const name of ["pointerup", "pointercancel"]) listen(name, (event) => down.delete(event.pointerId));
    listen("wheel", (event) => {
        event.preventDefault();
        const pixels = event.deltaY * (event.deltaMode === WheelEvent.DOM_DELTA_LINE ? 20 : 1);
        // Browsers report a pinch on a touchpad as the wheel with Ctrl.
        move({ zoom: Math.exp(pixels * (event.ctrlKey ? PINCH : WHEEL)) });
    });
    listen("dblclick", () => move({ home: true }));
    listen("keydown", (event) => {
        if (event.ctrlKey || event.metaKey || event.altKey) return;
        const arrows = { ArrowLeft: [-STEP, 0], ArrowRight: [STEP, 0], ArrowUp: [0, -STEP], ArrowDown: [0, STEP] };
        const by = arrows[event.key];
        if (by) move(event.shiftKey ? { pan: by } : { orbit: by });
        else if (event.key === "+" || event.key === "=") move({ zoom: 1 / ZOOM });
        else if (event.key === "-" || event.key === "_") move({ zoom: ZOOM });
        else if (event.key === "Home" || event.key === "0") move({ home: true });
        else return;
        event.preventDefault();
        event.stopPropagation();
    });
}

/** Calls `show` now and whenever one of the model's values changes, until the signal ends it. */
function follow(model, names, show, signal) {
    for (const name of names) {
        model.on(`change:${name}`, show);
        signal.addEventListener("abort", () => model.off(`change:${name}`, show));
    }
    show();
}

function render({ model, el }, move) {
    const ending = new AbortController();
    const { signal } = ending;
    const make = (name, parent, attributes) => {
        const made = parent.appendChild(document.createElement(name));
        for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
        return made;
    };
    const area = make("div", el, {
        class: "sheetsplat",
        tabindex: "0",
        role: "application",
        "aria-roledescription": "volume picture",
        "aria-label": LABEL,
        // JupyterLab's shortcuts would otherwise get the keys.
        "data-lm-suppress-shortcuts": "true",
    });
    const picture = make("canvas", area, {});
    const problem = make("p", area, { role: "alert" });
    const place = make("p", area, { class: "sheetsplat-place", role: "status" });
    let count = 0;
    let newest = 0;
    follow(model, ["_png"], async () => {
        const png = model.get("_png");
        if (!png?.byteLength) return;
        const number = ++count;
        const bitmap = await createImageBitmap(new Blob([png], { type: "image/png" }));
        // A picture may be decoded sooner than one before it.
        if (number < newest || signal.aborted) return;
        newest = number;
        [picture.width, picture.height] = [bitmap.width, bitmap.height];
        picture.getContext("2d").drawImage(bitmap, 0, 0);
    }, signal);
    follow(model, ["_size"], () => {
        // A rough picture has fewer pixels, and takes the same place.
        const [width, height] = model.get("_size");
        area.style.width = `${width}px`;
        area.style.aspectRatio = `${width} / ${height}`;
    }, signal);
    follow(model, ["_problem"], () => {
        problem.textContent = model.get("_problem");
        problem.hidden = problem.textContent === "";
    }, signal);
    follow(model, ["azimuth", "elevation", "zoom"], () => {
        const [azimuth, elevation] = [model.get("azimuth"), model.get("elevation")].map(Math.round);
        place.textContent = `azimuth ${azimuth}°, elevation ${elevation}°, zoom ${model.get("zoom").toPrecision(2)}`;
    }, signal);
    control(area, move, signal);
    return () => ending.abort();
}

/** All views of a widget send by one sender. */
export default () => {
    let moves;
    return {
        initialize({ model }) {
            moves = sender(model);
            return moves.end;
        },
        render: (shown) => render(shown, moves.move),
    };
};
