// What cuts the volume: a slider for each side of a box, and a plane of any direction.
import { short } from "./plot.js";

const at = (id) => document.getElementById(id);
const AXES = ["x", "y", "z"];
/** A side at the end of its slider is this many times as far away, so that kernels which reach beyond the outermost voxels stay whole. */
const BEYOND = 10;
const DEGREES = 180 / Math.PI;

/** Whether a side is at the end of its slider, whose steps are rounded. */
function isAtEnd(side, half) {
    return Math.abs(side) >= 0.999 * half;
}

export class Clip {
    #change;
    #view;
    /** Half the box along each axis, and along its diagonal. */
    #half = [1, 1, 1];
    #reach = 1;
    #unit = "";
    /** The plane as it is, which the sliders round. */
    #plane = { azimuth: 0, elevation: 0, offset: 0 };
    /** Planes of the scene that have no sliders. */
    #further = [];

    /** `change` gets the settings of scene files that change; `view` is what they cut. */
    constructor(change, view) {
        [this.#change, this.#view] = [change, view];
        const heads = Object.assign(document.createElement("div"), { className: "axis heads" });
        heads.append(...["", "from", "to"].map((textContent) => Object.assign(document.createElement("span"), { textContent })));
        at("crop").append(heads, ...AXES.map((axis) => this.#row(axis)));
        at("plane").addEventListener("change", () => this.#cut());
        for (const name of ["azimuth", "elevation", "offset"]) {
            at(`plane-${name}`).addEventListener("input", (event) => {
                this.#plane[name] = Number(event.target.value);
                at("plane").checked = true;
                this.#cut();
            });
        }
        at("cut-here").addEventListener("click", async () => {
            const { direction, center } = await this.#view().camera();
            this.#turn(direction, direction.reduce((sum, component, axis) => sum + component * center[axis], 0));
        });
        at("other-side").addEventListener("click", () => this.#turn(this.#normal().map((component) => -component), -this.#plane.offset));
    }

    /** Shows what the scene cuts. */
    show({ dims, spacing, unit, crop, planes }) {
        this.#half = dims.map((count, axis) => (count * spacing[axis]) / 2);
        this.#reach = Math.hypot(...this.#half);
        this.#unit = unit ? ` ${unit}` : "";
        for (const slider of this.#sliders()) {
            const [half, end] = [this.#half[AXES.indexOf(slider.dataset.axis)], slider.dataset.end];
            const side = crop?.[end === "from" ? 0 : 1][AXES.indexOf(slider.dataset.axis)] ?? (end === "from" ? -half : half);
            Object.assign(slider, { min: -half, max: half, step: half / 100, value: side });
            this.#tell(slider);
        }
        // A plane that was switched off stays off, so that none of the others takes its sliders.
        const isOff = !at("plane").checked && JSON.stringify(planes) === JSON.stringify(this.#further);
        if (!isOff) this.#take(planes);
        this.#reflect();
    }

    /** Gives the first of these planes the sliders. */
    #take([first, ...further]) {
        this.#further = further;
        at("plane").checked = first !== undefined;
        if (first) {
            const length = Math.hypot(...first.slice(0, 3));
            this.#aim(first.slice(0, 3).map((component) => component / length), -first[3] / length);
        }
    }

    /** Two sliders that cut the volume off along an axis. */
    #row(axis) {
        const row = Object.assign(document.createElement("div"), { className: "axis" });
        row.append(Object.assign(document.createElement("span"), { textContent: axis }));
        for (const end of ["from", "to"]) {
            const slider = Object.assign(document.createElement("input"), { type: "range" });
            Object.assign(slider.dataset, { axis, end });
            slider.setAttribute("aria-label", `Keep ${axis} ${end}`);
            slider.addEventListener("input", () => {
                this.#tell(slider);
                this.#crop();
            });
            row.append(slider);
        }
        return row;
    }

    #sliders() {
        return [...document.querySelectorAll("#crop input")];
    }

    #tell(slider) {
        slider.setAttribute("aria-valuetext", `${short(Number(slider.value))}${this.#unit}`);
    }

    #crop() {
        const ends = (end) => this.#sliders().filter((slider) => slider.dataset.end === end).map((slider) => Number(slider.value));
        const [low, high] = [ends("from"), ends("to")];
        if (this.#half.every((half, axis) => low[axis] < 0 && isAtEnd(low[axis], half) && high[axis] > 0 && isAtEnd(high[axis], half))) {
            this.#change({ "clip.crop": null });
            return;
        }
        // Sliders that have passed each other keep what is between them; an empty box is refused, so a hair is kept.
        const crop = this.#half.map((half, axis) => {
            const [from, to] = [Math.min(low[axis], high[axis]), Math.max(low[axis], high[axis])];
            const begin = from < 0 && isAtEnd(from, half) ? -BEYOND * half : from;
            return [begin, Math.max(to > 0 && isAtEnd(to, half) ? BEYOND * half : to, begin + 1e-4 * half)];
        });
        this.#change({ "clip.crop": [crop.map(([from]) => from), crop.map(([, to]) => to)] });
    }

    /** The plane's normal, which points to what is kept. */
    #normal() {
        const [azimuth, elevation] = [this.#plane.azimuth / DEGREES, this.#plane.elevation / DEGREES];
        return [Math.sin(azimuth) * Math.cos(elevation), Math.cos(azimuth) * Math.cos(elevation), Math.sin(elevation)];
    }

    #aim([x, y, z], offset) {
        this.#plane = { azimuth: Math.atan2(x, y) * DEGREES, elevation: Math.asin(Math.min(Math.max(z, -1), 1)) * DEGREES, offset };
    }

    /** Cuts by another plane. */
    #turn(normal, offset) {
        this.#aim(normal, offset);
        at("plane").checked = true;
        this.#reflect();
        this.#cut();
    }

    #cut() {
        const plane = [...this.#normal(), -this.#plane.offset];
        const planes = at("plane").checked ? [plane, ...this.#further] : this.#further;
        this.#reflect();
        this.#change({ "clip.planes": planes });
    }

    #reflect() {
        const { azimuth, elevation, offset } = this.#plane;
        Object.assign(at("plane-offset"), { min: -this.#reach, max: this.#reach, step: this.#reach / 200 });
        for (const [name, value, text] of [
            ["azimuth", azimuth, `${Math.round(azimuth)}°`],
            ["elevation", elevation, `${Math.round(elevation)}°`],
            ["offset", offset, `${short(offset)}${this.#unit}`],
        ]) {
            at(`plane-${name}`).value = value;
            at(`plane-${name}`).setAttribute("aria-valuetext", text);
            at(`plane-${name}-value`).textContent = text;
        }
    }
}
