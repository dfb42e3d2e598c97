// The editor of an opacity: its control points over the histogram.

const NAMESPACE = "http://www.w3.org/2000/svg";
const [WIDTH, HEIGHT] = [300, 140];
/** The share of its range that an arrow key moves a point by. */
const STEP = 0.01;

function element(name, attributes) {
    const made = document.createElementNS(NAMESPACE, name);
    for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
    return made;
}

/** A number in few digits. */
export function short(number) {
    return Number(number.toPrecision(4)).toLocaleString("en", { maximumSignificantDigits: 4, useGrouping: false });
}

export class Plot {
    #svg;
    #changed;
    #told;
    #channel;
    #points = [];

    /** `changed` gets the points after each change, `told` what a point's value and opacity are. */
    constructor(svg, changed, told) {
        [this.#svg, this.#changed, this.#told] = [svg, changed, told];
        svg.addEventListener("dblclick", (event) => {
            if (event.target.tagName !== "circle") this.#insert(this.#at(event));
        });
    }

    /** Shows a channel. */
    show(channel) {
        this.#channel = channel;
        this.#points = channel.opacity.map(([value, opacity]) => [value, opacity]);
        this.#draw();
    }

    /** Shows a channel's colours, and leaves the points where they are. */
    recolor(channel) {
        this.#channel = channel;
        this.#draw(this.#focused());
    }

    /** The point that has the focus. */
    #focused() {
        return [...this.#svg.querySelectorAll("circle")].indexOf(document.activeElement);
    }

    /** Adds a point where the widest gap is. */
    add() {
        const ends = [this.#range[0], ...this.#points.map(([value]) => value), this.#range[1]];
        const gaps = ends.slice(1).map((end, at) => end - ends[at]);
        const at = gaps.indexOf(Math.max(...gaps));
        const value = ends[at] + gaps[at] / 2;
        this.#insert([value, this.#opacity(value)]);
    }

    get #range() {
        const [low, high] = this.#channel.range;
        return low < high ? [low, high] : [low - 1, high + 1];
    }

    /** The opacity at a value. */
    #opacity(value) {
        const points = this.#points;
        const after = points.findIndex(([other]) => other >= value);
        if (after < 0) return points.at(-1)?.[1] ?? 0;
        if (after === 0) return points[0][1];
        const [[from, low], [to, high]] = [points[after - 1], points[after]];
        return to > from ? low + ((high - low) * (value - from)) / (to - from) : high;
    }

    #x(value) {
        const [low, high] = this.#range;
        return (Math.min(Math.max((value - low) / (high - low), 0), 1) * WIDTH);
    }

    #y(opacity) {
        return HEIGHT - 4 - opacity * (HEIGHT - 12);
    }

    /** Value and opacity at a pointer. */
    #at(event) {
        const box = this.#svg.getBoundingClientRect();
        const [low, high] = this.#range;
        const right = Math.min(Math.max((event.clientX - box.left) / box.width, 0), 1);
        const down = ((event.clientY - box.top) / box.height) * HEIGHT;
        return [low + right * (high - low), Math.min(Math.max((HEIGHT - 4 - down) / (HEIGHT - 12), 0), 1)];
    }

    #insert([value, opacity]) {
        const at = this.#points.findIndex(([other]) => other > value);
        const place = at < 0 ? this.#points.length : at;
        this.#points.splice(place, 0, [value, opacity]);
        this.#draw(place);
        this.#changed(this.#points);
    }

    /** Moves a point between its neighbours. */
    #move(at, [value, opacity]) {
        const [low, high] = this.#range;
        const least = this.#points[at - 1]?.[0] ?? low;
        const most = this.#points[at + 1]?.[0] ?? Math.max(high, this.#points[at][0]);
        this.#points[at] = [Math.min(Math.max(value, least), most), Math.min(Math.max(opacity, 0), 1)];
        this.#draw(at);
        this.#changed(this.#points);
    }

    #remove(at) {
        if (this.#points.length < 2) return;
        this.#points.splice(at, 1);
        this.#draw(Math.min(at, this.#points.length - 1));
        this.#changed(this.#points);
    }

    #draw(focused = -1) {
        const { histogram, color } = this.#channel;
        const most = Math.log1p(Math.max(...histogram));
        const bar = WIDTH / histogram.length;
        const bars = histogram.map((count, at) => {
            const height = most > 0 ? (Math.log1p(count) / most) * (HEIGHT - 12) : 0;
            return `M${(at * bar).toFixed(2)} ${HEIGHT}v${(-height).toFixed(2)}h${bar.toFixed(2)}V${HEIGHT}z`;
        });
        const places = this.#points.map(([value, opacity]) => [this.#x(value), this.#y(opacity)]);
        const ends = places.length > 0 ? [[0, places[0][1]], ...places, [WIDTH, places.at(-1)[1]]] : [];
        const line = ends.map(([x, y], at) => `${at === 0 ? "M" : "L"}${x.toFixed(1)} ${y.toFixed(1)}`).join("");
        const gradient = element("linearGradient", { id: "colors" });
        for (const [value, [red, green, blue]] of color) {
            const channels = [red, green, blue].map((channel) => Math.round(channel * 255));
            gradient.append(element("stop", { offset: this.#x(value) / WIDTH, "stop-color": `rgb(${channels})` }));
        }
        const circles = places.map(([cx, cy], at) => this.#circle(at, cx, cy));
        this.#svg.replaceChildren(
            gradient,
            element("path", { class: "bars", d: bars.join("") }),
            element("path", { class: "area", d: line ? `${line}V${HEIGHT}H0z` : "" }),
            element("path", { class: "line", d: line }),
            ...circles,
        );
        circles[focused]?.focus({ preventScroll: true });
    }

    #circle(at, cx, cy) {
        const [value, opacity] = this.#points[at];
        const words = `Point ${at + 1} of ${this.#points.length}: value ${short(value)}, opacity ${short(opacity)}`;
        const circle = element("circle", { cx, cy, r: 6, tabindex: 0, role: "button", "aria-label": words });
        circle.addEventListener("focus", () => this.#told(`${short(value)} → ${short(opacity)}`));
        circle.addEventListener("blur", () => this.#told(""));
        circle.addEventListener("pointerdown", (event) => {
            event.preventDefault();
            // The circle is drawn anew while it moves, so the window follows the pointer.
            const follow = (moved) => this.#move(at, this.#at(moved));
            const end = () => {
                window.removeEventListener("pointermove", follow);
                window.removeEventListener("pointerup", end);
                window.removeEventListener("pointercancel", end);
            };
            window.addEventListener("pointermove", follow);
            window.addEventListener("pointerup", end);
            window.addEventListener("pointercancel", end);
            circle.focus({ preventScroll: true });
        });
        circle.addEventListener("dblclick", () => this.#remove(at));
        circle.addEventListener("keydown", (event) => {
            const [low, high] = this.#range;
            const step = (high - low) * STEP * (event.shiftKey ? 10 : 1);
            const [value, opacity] = this.#points[at];
            const moved = {
                ArrowLeft: [value - step, opacity],
                ArrowRight: [value + step, opacity],
                ArrowUp: [value, opacity + STEP * (event.shiftKey ? 10 : 1)],
                ArrowDown: [value, opacity - STEP * (event.shiftKey ? 10 : 1)],
            }[event.key];
            if (moved) this.#move(at, moved);
            else if (event.key === "Delete" || event.key === "Backspace") this.#remove(at);
            else return;
            event.preventDefault();
        });
        return circle;
    }
}
